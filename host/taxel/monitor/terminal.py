"""The skin on a terminal, and its keys."""

from __future__ import annotations

import contextlib
import os
import select
import sys
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.control import Control

from taxel.monitor.model import SkinMonitor
from taxel.monitor.reading import SkinReading
from taxel.monitor.screen import Screen


class Keys:
    """Keys as they are pressed, without Enter; nothing where standard input is no terminal."""

    def __init__(self) -> None:
        self._descriptor = sys.stdin.fileno() if sys.stdin is not None and sys.stdin.isatty() else -1
        self._saved: list[Any] | None = None

    def begin(self) -> None:
        """Let the terminal hand over each key at once and show none; Ctrl-C stays what it is."""
        if self._descriptor >= 0:
            import termios
            import tty

            self._saved = termios.tcgetattr(self._descriptor)
            tty.setcbreak(self._descriptor, termios.TCSADRAIN)  # keeps what was typed while the skin was opened

    def pressed(self) -> str:
        """What has been pressed since the last call."""
        if self._saved is None or not select.select([self._descriptor], [], [], 0.0)[0]:
            return ""
        return os.read(self._descriptor, 64).decode(errors="replace")

    def end(self) -> None:
        """Give the terminal back as it was."""
        if self._saved is not None:
            import termios

            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._saved)
            self._saved = None


class TerminalView:
    """Draws on the whole terminal and gives it back at the end. A context manager and a `taxel.monitor.View`.

    Keys: q ends, b takes the baseline again, t shows the table instead of the map where there is no room for both.
    """

    def __init__(self, console: Console, monitor: SkinMonitor, title: str) -> None:
        self._console = console
        self._monitor = monitor
        self._screen = Screen(monitor.hand, title, monitor.threshold)
        self._keys = Keys()
        self._alternate = console.screen(hide_cursor=True)
        self._has_colour = console.color_system is not None and not console.no_color
        self._is_left = False
        self.last: SkinReading | None = None

    def __enter__(self) -> Self:
        self._keys.begin()
        self._alternate.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._alternate.__exit__(kind, error, trace)
        self._keys.end()

    def draw(self, reading: SkinReading) -> None:
        """Show a reading, and keep it as `last`."""
        self.last = reading
        width, height = self._console.size
        canvas = self._screen.draw(reading, width, height, self._has_colour)
        self._console.control(Control.home())
        self._console.print(canvas, end="", soft_wrap=True)

    def is_done(self, reading: SkinReading) -> bool:
        """Whether q was pressed."""
        for key in self._keys.pressed().lower():
            if key == "q":
                self._is_left = True
            elif key == "b":
                self._monitor.begin_baseline()
            elif key == "t":
                self._screen.shows_table = not self._screen.shows_table
        return self._is_left
