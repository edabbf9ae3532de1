"""What every link can do."""

import time
from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable


class Chunk(NamedTuple):
    """Bytes that arrived together, and when: nanoseconds on the link's own clock (see `Link.is_real_time`)."""

    data: bytes
    arrival_ns: int


class Link(Protocol):
    """A source of bytes that may also take some.

    `name` goes into messages. `is_real_time`: the source does not wait for its reader, and arrival times are this
    machine's monotonic clock. `is_recorded`: nobody answers, and the end is an end rather than a failure. `baud`:
    bits a second on the wire. `holds_back`: whoever is at the other end makes this one wait before its own buffer is
    full (RTS/CTS), so that no byte written is lost there.
    """

    name: str
    is_real_time: bool
    is_recorded: bool
    baud: float
    holds_back: bool

    def read(self, timeout_s: float) -> Chunk | None:
        """The next bytes; None if none came in time. Raises EOFError at the end, `LinkError` for a failure."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes. Raises `LinkError`."""
        ...

    def close(self) -> None:
        """Let go of the port, process or file. May be called twice."""
        ...


@runtime_checkable
class SteppedLink(Link, Protocol):
    """A link whose time goes on only while somebody reads it: nobody reads ahead, and waiting is by its own clock."""

    def now_s(self) -> float:
        """Seconds of its clock."""
        ...


def clock_of(link: Link) -> Callable[[], float]:
    """The clock, in seconds, by which to wait for an answer from `link`."""
    return link.now_s if isinstance(link, SteppedLink) else time.monotonic
