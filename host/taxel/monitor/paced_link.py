"""Playback of a capture at its recorded speed or a multiple of it, as a link."""

import os
import time

from taxel.errors import TaxelError
from taxel.hand import Hand
from taxel.link import Chunk, Link
from taxel.skin import Skin, open_waiting_source

SPEED_MAX = 1e6


class SpeedError(TaxelError, ValueError):
    """A playback speed outside the permitted range, or for a source that is not a recording."""


class PacedLink:
    """A recorded link whose chunks of bytes are delivered at their recorded intervals, divided by `speed`."""

    def __init__(self, link: Link, speed: float = 1.0) -> None:
        """Create a link that plays the chunks of a recorded link at `speed` times the recorded speed."""
        self._link = link
        self._speed = speed
        self._next: Chunk | None = None
        self._first_ns: int | None = None
        self._started_s = 0.0
        self._has_returned_chunk = False
        self.name = link.name
        self.baud = link.baud
        self.is_real_time = link.is_real_time
        self.is_recorded = link.is_recorded
        self.has_flow_control = link.has_flow_control

    def read(self, timeout_s: float) -> Chunk | None:
        """Return the next recorded chunk of bytes if it is due within `timeout_s` seconds, else None.

        The call after a returned chunk does not wait, so that a caller that collects chunks gets only the chunks that
        are due.
        """
        if self._next is None:
            self._next = self._link.read(timeout_s)
            if self._next is None:
                return None
        wait_s = self._compute_due_s(self._next) - time.monotonic()
        if wait_s > 0.0:
            if self._has_returned_chunk:
                self._has_returned_chunk = False
                return None
            time.sleep(min(wait_s, timeout_s))
            if wait_s > timeout_s:
                return None
        chunk, self._next, self._has_returned_chunk = self._next, None, True
        return chunk

    def _compute_due_s(self, chunk: Chunk) -> float:
        """Compute the time of the monotonic clock, seconds, at which a recorded chunk is due.

        The first chunk is due immediately, and sets the start of the playback.
        """
        if self._first_ns is None:
            self._first_ns, self._started_s = chunk.arrival_ns, time.monotonic()
        return self._started_s + (chunk.arrival_ns - self._first_ns) * 1e-9 / self._speed

    def write(self, data: bytes) -> None:
        """Raise the error of the recorded link, which takes no commands."""
        self._link.write(data)

    def close(self) -> None:
        """Close the recorded link."""
        self._link.close()


def open_paced(
    url: str, hand: Hand | str | os.PathLike[str] | None = None, rate_hz: float | None = None, speed: float = 1.0
) -> Skin:
    """Open a skin as `taxel.open` does; a recording, such as `file:`, is played at `speed` times its recorded speed.

    If a port disappears later, the skin waits until the port is back (`Skin.reconnection`).

    Raises the errors of `taxel.open`, and `SpeedError` for a speed of 0 or less, or for a speed other than 1 with a
    source that is not a recording.
    """
    if not 0.0 < speed <= SPEED_MAX:
        raise SpeedError(f"speed: expected a number above 0 and at most {SPEED_MAX:g}, found {speed:g}")
    link, description = open_waiting_source(url, hand)
    if speed != 1.0 and not link.is_recorded:
        link.close()
        raise SpeedError(f"{url}: a speed is for a recording (file:capture.bin); for an emulator use ?speed=max")
    return Skin(PacedLink(link, speed) if link.is_recorded else link, description, rate_hz)
