"""Loop of the monitor: processes every frame and draws several readings per second."""

import time
from typing import Protocol

from taxel.monitor.model import SkinMonitor
from taxel.monitor.reading import SkinReading
from taxel.skin import Skin

POLL_S = 0.02
"""Interval between two polls of the skin, seconds. Many frames in one poll cost little more than one frame."""

DRAWS_HZ = 10.0


class View(Protocol):
    """Interface of a display of the skin monitor's readings."""

    def draw(self, reading: SkinReading) -> None:
        """Show a reading of the skin to the user."""
        ...

    def is_done(self, reading: SkinReading) -> bool:
        """Whether the user has ended the view; called after each `draw`."""
        ...


def watch(
    skin: Skin, monitor: SkinMonitor, view: View, seconds: float | None = None, draws_hz: float = DRAWS_HZ
) -> SkinReading:
    """Process the frames of a skin and draw readings until the view is done or the stream ends.

    seconds: largest duration; None: unlimited. draws_hz: readings drawn per second. Returns the last reading. Errors of
    the skin are raised again after a last reading is drawn.
    """
    started_s = time.monotonic()
    due_s = started_s + 1.0 / draws_hz
    is_ended = False
    try:
        while True:
            try:
                monitor.take(skin.poll(POLL_S), time.monotonic())
            except EOFError:
                is_ended = True
            now_s = time.monotonic()
            is_over = seconds is not None and now_s - started_s >= seconds
            if now_s >= due_s or is_ended or is_over:
                reading = monitor.read(now_s, is_ended)
                view.draw(reading)
                if is_ended or is_over or view.is_done(reading):
                    return reading
                # The interval starts now if the loop is late: missed drawings are not repeated.
                due_s = max(due_s + 1.0 / draws_hz, now_s)
            if skin.link.is_real_time:
                time.sleep(max(0.0, min(POLL_S, due_s - time.monotonic())))
    except Exception:
        view.draw(monitor.read(time.monotonic(), is_ended=True))
        raise
