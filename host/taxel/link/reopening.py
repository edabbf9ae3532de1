"""A link that waits for its port when the port vanishes, and opens it again."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from taxel.link.base import Chunk, Link
from taxel.link.errors import LinkError, PortVanishedError

RETRY_S: Final = 0.5
"""Time between two attempts to open the port, seconds, so that a replugged adapter is used within a second."""


@dataclass
class Gap:
    """A time without data, in Unix seconds.

    start_s: time at which the port vanished. end_s: time of the first bytes afterwards; None: no bytes yet.
    """

    start_s: float
    end_s: float | None = None

    def get_seconds(self, now_s: float) -> float:
        """Return the duration of the gap, seconds; that up to `now_s` (Unix seconds) for a gap that has not ended."""
        return (now_s if self.end_s is None else self.end_s) - self.start_s


@dataclass
class Reconnection:
    """State of a link that is opened again.

    openings: how often the port was opened. is_open: whether the port is open. problem: message of the latest failure.
    gaps: times without data. is_enabled: whether a vanished port is opened again.
    """

    openings: int = 1
    is_open: bool = True
    problem: str = ""
    gaps: list[Gap] = field(default_factory=list)
    is_enabled: bool = False
    """Set after the first handshake: an error before it is a wrong port or setting, which no waiting repairs."""


class ReopeningLink:
    """A real-time link that returns no bytes while its port is missing, and continues when the port is back.

    Bytes written meanwhile are lost, as on a cable that is not plugged in. `reconnection`: state and gaps; while it is
    not enabled, a vanished port raises `PortVanishedError` as without this class.
    """

    def __init__(self, link: Link, reopen: Callable[[], Link]) -> None:
        """Wrap an open link. reopen: opens the port again and returns its link; raises `LinkError` while it cannot."""
        self._link: Link | None = link
        self._reopen = reopen
        self.reconnection = Reconnection()
        self.name = link.name
        self.baud = link.baud
        self.is_real_time = link.is_real_time
        self.is_recorded = link.is_recorded
        self.has_flow_control = link.has_flow_control
        self._closing = threading.Event()
        self._write_failure: PortVanishedError | None = None
        self._tried_s = float("-inf")

    def read(self, timeout_s: float) -> Chunk | None:
        """Return the next bytes; None without bytes within `timeout_s` seconds, or while the port is missing."""
        if self._link is None:
            self._try_to_open(timeout_s)
            return None
        try:
            if self._write_failure is not None:
                raise self._write_failure
            chunk = self._link.read(timeout_s)
        except PortVanishedError as error:
            if not self.reconnection.is_enabled:
                raise
            self._close_lost_port(error)
            return None
        # The first bytes after the port was opened again end the gap.
        gaps = self.reconnection.gaps
        if chunk is not None and gaps and gaps[-1].end_s is None:
            gaps[-1].end_s = time.time()
        return chunk

    def _close_lost_port(self, error: PortVanishedError) -> None:
        """Close the vanished port, and start a gap unless the last gap has not ended yet. error: reason of the loss."""
        link, self._link = self._link, None
        if link is not None:
            link.close()
        self._write_failure = None
        self.reconnection.problem = error.problem
        self.reconnection.is_open = False
        if not self.reconnection.gaps or self.reconnection.gaps[-1].end_s is not None:
            self.reconnection.gaps.append(Gap(time.time()))

    def _try_to_open(self, timeout_s: float) -> None:
        """Try to open the port if `RETRY_S` has passed since the last attempt; otherwise wait at most `timeout_s`."""
        wait_s = self._tried_s + RETRY_S - time.monotonic()
        if wait_s > 0.0:
            self._closing.wait(min(wait_s, timeout_s))
            return
        self._tried_s = time.monotonic()
        try:
            link = self._reopen()
        except LinkError as error:
            self.reconnection.problem = error.problem
            return
        if self._closing.is_set():
            link.close()
            return
        self._link = link
        self.reconnection.openings += 1
        self.reconnection.is_open = True

    def write(self, data: bytes) -> None:
        """Send bytes; they are lost while the port is missing."""
        link = self._link
        if link is None:
            return
        try:
            link.write(data)
        except PortVanishedError as error:
            if not self.reconnection.is_enabled:
                raise
            self._write_failure = error  # the reading thread closes the port

    def close(self) -> None:
        """Close the port, and end the waiting for it."""
        self._closing.set()
        if self._link is not None:
            self._link.close()
