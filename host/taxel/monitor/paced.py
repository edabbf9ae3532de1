"""A capture that plays at its own speed, as if its bytes came from a port."""

import os
import time

from taxel.errors import TaxelError
from taxel.hand import Hand
from taxel.link import Chunk, Link
from taxel.link.url import recorded_path
from taxel.skin import Skin, open_source

SPEED_MAX = 1e6


class SpeedError(TaxelError, ValueError):
    """A speed that nothing can be played at."""


class PacedLink:
    """A recorded link whose chunks come `speed` times as fast as they once arrived."""

    def __init__(self, link: Link, speed: float = 1.0) -> None:
        self._link = link
        self._speed = speed
        self._next: Chunk | None = None
        self._first_ns: int | None = None
        self._began_s = 0.0
        self._has_given = False
        self.name = link.name
        self.baud = link.baud
        self.is_real_time = link.is_real_time
        self.is_recorded = link.is_recorded
        self.holds_back = link.holds_back

    def read(self, timeout_s: float) -> Chunk | None:
        """The next chunk if its time has come within `timeout_s` seconds, else None.

        After a chunk it does not wait: whoever gathers chunks gets what is due and no more.
        """
        if self._next is None:
            self._next = self._link.read(timeout_s)
            if self._next is None:
                return None
        wait_s = self._due_s(self._next) - time.monotonic()
        if wait_s > 0.0:
            if self._has_given:
                self._has_given = False
                return None
            time.sleep(min(wait_s, timeout_s))
            if wait_s > timeout_s:
                return None
        chunk, self._next, self._has_given = self._next, None, True
        return chunk

    def _due_s(self, chunk: Chunk) -> float:
        if self._first_ns is None:
            self._first_ns, self._began_s = chunk.arrival_ns, time.monotonic()
        return self._began_s + (chunk.arrival_ns - self._first_ns) * 1e-9 / self._speed

    def write(self, data: bytes) -> None:
        """As the recorded link: refused."""
        self._link.write(data)

    def close(self) -> None:
        """Close the recorded link."""
        self._link.close()


def open_watched(
    url: str, hand: Hand | str | os.PathLike[str] | None = None, rate_hz: float | None = None, speed: float = 1.0
) -> Skin:
    """As `taxel.open`, but a recording (`file:`) plays at `speed` times the speed at which it was made.

    Raises what `taxel.open` raises, and `SpeedError` for a speed that is not above 0, or another one than 1 for what
    is not a recording.
    """
    if not 0.0 < speed <= SPEED_MAX:
        raise SpeedError(f"expected a speed above 0, at most {SPEED_MAX:g}, found {speed:g}")
    if speed != 1.0 and recorded_path(url) is None:
        raise SpeedError(f"{url}: a speed is for a recording (file:capture.bin); for an emulator there is ?speed=max")
    link, description = open_source(url, hand)
    return Skin(PacedLink(link, speed) if link.is_recorded else link, description, rate_hz)
