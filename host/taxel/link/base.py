"""What every link can do."""

from typing import NamedTuple, Protocol


class Chunk(NamedTuple):
    """Bytes that arrived together, and when: nanoseconds on the link's own clock (see `Link.is_real_time`)."""

    data: bytes
    arrival_ns: int


class Link(Protocol):
    """A source of bytes that may also take some.

    `name` goes into messages. `is_real_time`: the source does not wait for its reader, and arrival times are this
    machine's monotonic clock. `is_recorded`: nobody answers, and the end is an end rather than a failure. `baud`:
    bits a second on the wire.
    """

    name: str
    is_real_time: bool
    is_recorded: bool
    baud: float

    def read(self, timeout_s: float) -> Chunk | None:
        """The next bytes; None if none came in time. Raises EOFError at the end, `LinkError` for a failure."""
        ...

    def write(self, data: bytes) -> None:
        """Send bytes. Raises `LinkError`."""
        ...

    def close(self) -> None:
        """Let go of the port, process or file. May be called twice."""
        ...
