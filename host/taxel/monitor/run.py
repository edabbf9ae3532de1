"""The loop between a skin and a view: every frame is taken, a few readings a second are drawn."""

import time
from typing import Protocol

from taxel.monitor.model import SkinMonitor
from taxel.monitor.reading import SkinReading
from taxel.skin import Skin

POLL_S = 0.02
"""Frames are taken in portions of this much time: many at once cost little more than one."""

DRAWS_HZ = 10.0


class View(Protocol):
    """What shows readings."""

    def draw(self, reading: SkinReading) -> None:
        """Show a reading."""
        ...

    def is_done(self, reading: SkinReading) -> bool:
        """Whether the one who watches has had enough: asked after each drawing."""
        ...


def watch(
    skin: Skin, monitor: SkinMonitor, view: View, seconds: float | None = None, draws_hz: float = DRAWS_HZ
) -> SkinReading:
    """Take frames and draw `draws_hz` readings a second until the view is done, the stream ends or `seconds` are over.

    Returns the last reading, which was drawn. Raises what the skin raises, after a last drawing.
    """
    began_s = time.monotonic()
    due_s = began_s + 1.0 / draws_hz
    is_ended = False
    try:
        while True:
            try:
                monitor.take(skin.poll(POLL_S), time.monotonic())
            except EOFError:
                is_ended = True
            now_s = time.monotonic()
            is_over = seconds is not None and now_s - began_s >= seconds
            if now_s >= due_s or is_ended or is_over:
                reading = monitor.read(now_s, is_ended)
                view.draw(reading)
                if is_ended or is_over or view.is_done(reading):
                    return reading
                # From now, not from the last: after a pause there is nothing to catch up with.
                due_s = max(due_s + 1.0 / draws_hz, now_s)
            if skin.link.is_real_time:
                time.sleep(max(0.0, min(POLL_S, due_s - time.monotonic())))
    except Exception:
        view.draw(monitor.read(time.monotonic(), is_ended=True))
        raise
