"""Frames of a capture with the times at which their last byte arrived."""

from collections.abc import Iterator
from pathlib import Path

from taxel.hand import Hand
from taxel.link import Chunk, Link
from taxel.skin import Skin, open_source
from taxel.stream import TaxelFrame


class SingleChunkLink:
    """Recorded link that returns one chunk per poll, and has the arrival time of the latest one."""

    def __init__(self, link: Link) -> None:
        """Wrap a recorded link. `arrival_s`: arrival time of the latest chunk, seconds."""
        self._link = link
        self._has_returned = False
        self.arrival_s = 0.0
        self.name, self.baud = link.name, link.baud
        self.is_real_time, self.is_recorded = link.is_real_time, link.is_recorded
        self.has_flow_control = link.has_flow_control
        self.has_arrivals = getattr(link, "has_arrivals", True)

    def read(self, timeout_s: float) -> Chunk | None:
        """Return the next chunk; after each chunk return None once, which ends the poll.

        All frames of one poll therefore have the arrival time `arrival_s`.
        """
        if self._has_returned:
            self._has_returned = False
            return None
        chunk = self._link.read(timeout_s)
        if chunk is not None:
            self.arrival_s = 1e-9 * chunk.arrival_ns
            self._has_returned = True
        return chunk

    def write(self, data: bytes) -> None:
        """Pass the bytes to the recorded link, which raises its error."""
        self._link.write(data)

    def close(self) -> None:
        """Close the recorded link."""
        self._link.close()


def iterate_arrivals(capture: Path, hand: Hand) -> Iterator[tuple[TaxelFrame, float]]:
    """Yield the frames of a capture, each with its arrival time in seconds of virtual time."""
    source, _ = open_source(f"file:{capture}", hand)
    link = SingleChunkLink(source)
    with Skin(link, hand) as skin:
        while True:
            try:
                frames = skin.poll(0.0)
            except EOFError:
                return
            for frame in frames:
                yield frame, link.arrival_s
