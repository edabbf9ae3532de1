"""The interface of all links."""

import time
from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable


class Chunk(NamedTuple):
    """Bytes that arrived together, and their arrival time in nanoseconds of the link's clock (`Link.is_real_time`)."""

    data: bytes
    arrival_ns: int


class Link(Protocol):
    """A bidirectional byte stream.

    name: name in error messages. is_real_time: whether the source does not wait for its reader, so that arrival times
    are those of this computer's monotonic clock. is_recorded: whether the link plays a recording, which accepts no
    commands and whose end is not a failure. baud: bits per second on the wire. has_flow_control: whether the other end
    stops the writer before its receive buffer is full (RTS/CTS), so that no written byte is lost.
    """

    name: str
    is_real_time: bool
    is_recorded: bool
    baud: float
    has_flow_control: bool

    def read(self, timeout_s: float) -> Chunk | None:
        """Return the next bytes of the link; None if no byte arrived within `timeout_s`.

        Raises EOFError at the end of a recording, `LinkError` if the link fails.
        """
        ...

    def write(self, data: bytes) -> None:
        """Send bytes. Raises `LinkError`."""
        ...

    def close(self) -> None:
        """Close the port, process or file. May be called twice."""
        ...


@runtime_checkable
class SteppedLink(Link, Protocol):
    """A link whose time advances only while `read` is called; timeouts are measured with its clock."""

    def now_s(self) -> float:
        """Return the present time of the link's clock, seconds."""
        ...


def get_clock(link: Link) -> Callable[[], float]:
    """Return the clock for the timeout of a reply from `link`, a function that returns seconds."""
    return link.now_s if isinstance(link, SteppedLink) else time.monotonic
