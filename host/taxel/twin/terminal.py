"""View of a twin on a terminal: measured signal, predicted signal, residual, history and alarms."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from typing import Final

import numpy as np
from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from taxel.hand.errors import format_address
from taxel.twin.events import format_time
from taxel.twin.prediction import TwinFrame
from taxel.twin.session import TwinSession, Update

DRAWS_HZ: Final = 5.0
"""Largest rate at which the screen is drawn, hertz; events are drawn at once."""

BARS: Final = " ▁▂▃▄▅▆▇█"
"""Characters of a bar chart, from 0 to the largest value."""

RESIDUAL_FLOORS: Final = 3.0
"""Residual, in floors, from which a board is highlighted: three standard deviations between repeats."""

SHOWN_EVENTS: Final = 8
"""Number of the latest events on the screen."""


class TwinScreen:
    """Formats the current state of a twin as text. title: text of the first line."""

    def __init__(self, session: TwinSession, title: str) -> None:
        """Create the screen of a session."""
        self._session = session
        self._title = title
        self._history: deque[float] = deque(maxlen=200)
        self._events: deque[str] = deque(maxlen=SHOWN_EVENTS)
        self._steps = 0
        self._evidence = 0.0

    def take(self, update: Update) -> None:
        """Add the results of an update to the state that is drawn."""
        if update.frame is not None and np.isfinite(update.frame.rms):
            self._history.append(update.frame.rms)
        self._events += [str(event) for event in update.events]
        self._steps += len(update.results)
        for result in update.results:
            self._evidence = result.evidence

    def draw(self, frame: TwinFrame, width: int) -> Group:
        """Draw the state with the newest frame. width: characters."""
        active = len(self._session.twin.active)
        state = Text(f"{active} active alarms" if active else "no alarm", style="bold red" if active else "bold green")
        contact = frame.condition or "no contact announced"
        head = Text.assemble(
            (" taxel twin ", "reverse"), f" {self._title} · {format_time(frame.time_s)} · {contact} · ", state
        )
        steps = f"{self._steps} steps, evidence of a change {self._evidence:.1e} (alarm at 1)"
        if self._session.skipped:
            steps += f", {self._session.skipped} frames not shown"
        lines = [head, Text(steps, style="dim"), self._draw_header()]
        lines += [self._draw_board(number, frame) for number in range(self._session.twin.reference.sensors.s)]
        # 18: width of the label, and one character of margin.
        lines.append(Text.assemble(("residual, floors ", "dim"), self._draw_history(width - 18)))
        lines += [Text(text[: 2 * width]) for text in self._events]  # an event fills at most two lines
        return Group(*lines)

    @staticmethod
    def _draw_header() -> Text:
        names = "".join(f"{name:>10s}" for name in ("measured", "predicted", "residual"))
        return Text(f"{'board':<24s}{names}  (largest signal, counts; RMS, floors)", style="bold")

    def _draw_board(self, number: int, frame: TwinFrame) -> Text:
        """Format the line of a board: largest measured and predicted signal, and RMS of its residual."""
        reference = self._session.twin.reference
        on_board = reference.places.board == number
        address = format_address(int(reference.sensors.address[number]))
        name = f"{reference.sensors.name[number].replace('_', ' ')} {address}"
        residual = frame.residual[on_board]
        known = residual[np.isfinite(residual)]
        rms = float(np.sqrt(np.mean(known**2))) if known.size else float("nan")
        style = "bold red" if rms > RESIDUAL_FLOORS else ""
        measured, predicted = _format_largest(frame.measured[on_board]), _format_largest(frame.predicted[on_board])
        return Text(f"{name:<24s}{measured:>10s}{predicted:>10s}{rms:10.1f}", style=style)

    def _draw_history(self, width: int) -> Text:
        """Format the RMS residuals of the latest `width` frames as a bar chart of one line."""
        values = list(self._history)[-max(width, 1) :]
        top = max([RESIDUAL_FLOORS, *values])
        return Text("".join(BARS[round((len(BARS) - 1) * min(value / top, 1.0))] for value in values))


def show_on_terminal(updates: Iterator[Update], session: TwinSession, console: Console, title: str) -> None:
    """Show the updates until the stream ends; frames that arrive between two drawings of the screen are not shown."""
    screen = TwinScreen(session, title)
    due = 0.0
    newest: TwinFrame | None = None
    with Live(console=console, auto_refresh=False, screen=False) as live:
        for update in updates:
            screen.take(update)
            newest = update.frame or newest
            if newest is not None and (time.monotonic() >= due or update.events):
                live.update(screen.draw(newest, console.width), refresh=True)
                due = time.monotonic() + 1.0 / DRAWS_HZ
        if newest is not None:
            live.update(screen.draw(newest, console.width), refresh=True)


def _format_largest(values: np.ndarray) -> str:
    """Format the largest finite value without decimals; "-" if there is none."""
    known = values[np.isfinite(values)]
    return f"{known.max():.0f}" if known.size else "-"
