"""View of the skin on a terminal, and its keys."""

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
    """Reader of single keys from standard input without Enter; no keys if standard input is no terminal."""

    def __init__(self) -> None:
        """Create a reader of single keys from standard input; without a terminal it returns no keys."""
        self._descriptor = sys.stdin.fileno() if sys.stdin is not None and sys.stdin.isatty() else -1
        self._saved: list[Any] | None = None

    def begin(self) -> None:
        """Make the terminal deliver each key at once without echo. Ctrl-C still interrupts the program."""
        if self._descriptor >= 0:
            import termios
            import tty

            self._saved = termios.tcgetattr(self._descriptor)
            # TCSADRAIN keeps the keys that were typed while the skin was opened.
            tty.setcbreak(self._descriptor, termios.TCSADRAIN)

    def read(self) -> str:
        """Return the keys that were typed since the last call, without waiting."""
        if self._saved is None or not select.select([self._descriptor], [], [], 0.0)[0]:
            return ""
        return os.read(self._descriptor, 64).decode(errors="replace")

    def end(self) -> None:
        """Restore the settings that the terminal had before `begin`."""
        if self._saved is not None:
            import termios

            with contextlib.suppress(termios.error):
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._saved)
            self._saved = None


class TerminalView:
    """View of the monitor on the whole terminal, which is restored at the end.

    A context manager and a `taxel.monitor.View`. Keys: q quits, b measures the baseline again, t shows the table
    instead of the map on a screen without space for both.
    """

    def __init__(self, console: Console, monitor: SkinMonitor, title: str) -> None:
        """Create a view of a skin monitor on the terminal of `console`; title: text of the first line."""
        self._console = console
        self._monitor = monitor
        self._screen = Screen(monitor.hand, title, monitor.threshold)
        self._keys = Keys()
        self._alternate = console.screen(hide_cursor=True)
        self._has_colour = console.color_system is not None and not console.no_color
        self._is_quit = False
        self.last: SkinReading | None = None

    def __enter__(self) -> Self:
        """Take over the keyboard and show the alternate screen of the terminal."""
        self._keys.begin()
        self._alternate.__enter__()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Leave the alternate screen and restore the keyboard of the terminal."""
        self._alternate.__exit__(kind, error, trace)
        self._keys.end()

    def draw(self, reading: SkinReading) -> None:
        """Show a reading of the skin on the terminal, and store it as `last`."""
        self.last = reading
        width, height = self._console.size
        canvas = self._screen.draw(reading, width, height, self._has_colour)
        self._console.control(Control.home())
        self._console.print(canvas, end="", soft_wrap=True)

    def is_done(self, reading: SkinReading) -> bool:
        """Execute the commands of the typed keys, and return whether the user has typed q (quit) since the start."""
        for key in self._keys.read().lower():
            if key == "q":
                self._is_quit = True
            elif key == "b":
                self._monitor.restart_baseline()
            elif key == "t":
                self._screen.shows_table = not self._screen.shows_table
        return self._is_quit
