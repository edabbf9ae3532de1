"""A link whose bytes are recorded while they are read, and the header of the recording."""

import os
import time
from datetime import UTC, datetime
from typing import Any, Protocol

from taxel.hand import Hand
from taxel.hand.loading import read_hand_text
from taxel.link import Chunk, Link, Reconnection
from taxel.stream.frame_stream import has_arrivals
from taxel.version import VERSION


class ByteWriter(Protocol):
    """Interface of the writers that record received bytes with their arrival times."""

    def write(self, data: bytes, time_ns: int) -> None:
        """Append received bytes to the recording; time_ns: their arrival, nanoseconds of the link's clock."""
        ...

    def tick(self) -> None:
        """Write buffered data to disk if this is due; called after a read without data."""
        ...

    def confirm(self, position: int, splits: bool = False) -> None:
        """Mark the bytes before `position` of the stream as received by the reader, so that they stay in the recording.

        splits: write these bytes now, even if a chunk of received bytes is then divided into two.
        """
        ...

    def cut(self, position: int) -> None:
        """Remove the bytes from `position` of the stream on; called after the last `write`."""
        ...

    def close(self) -> None:
        """Complete the recording; called once, after the last bytes."""
        ...


class RecordingLink:
    """A link that appends every received chunk to a recording before it returns the chunk to the reader."""

    def __init__(self, link: Link, writer: ByteWriter) -> None:
        """Wrap `link` so that every received chunk of bytes is appended to a recording by `writer`."""
        self._link = link
        self._writer = writer
        self.name = link.name
        self.baud = link.baud
        self.is_real_time = link.is_real_time
        self.is_recorded = link.is_recorded
        self.has_flow_control = link.has_flow_control
        self.has_arrivals = has_arrivals(link)
        self.header: dict[str, Any] = getattr(link, "header", {})
        self.reconnection: Reconnection | None = getattr(link, "reconnection", None)

    def read(self, timeout_s: float) -> Chunk | None:
        """Return the next chunk of bytes of the link after recording it; None after `timeout_s` seconds."""
        chunk = self._link.read(timeout_s)
        if chunk is not None:
            self._writer.write(chunk.data, chunk.arrival_ns)
        else:
            self._writer.tick()
        return chunk

    def write(self, data: bytes) -> None:
        """Send bytes to the hub. Sent bytes are not recorded."""
        self._link.write(data)

    def confirm(self, position: int, splits: bool = False) -> None:
        """Mark the first `position` bytes as received by the reader; splits: as in `ByteWriter.confirm`."""
        self._writer.confirm(position, splits)

    def cut(self, position: int) -> None:
        """Remove all bytes after the first `position` bytes from the recording. The link must not be read meanwhile."""
        self._writer.cut(position)

    def close(self) -> None:
        """Close the recorded link, then the recording."""
        try:
            self._link.close()
        finally:
            self._writer.close()


def make_recording_header(
    url: str, link: Link, hand: Hand, hand_source: Hand | str | os.PathLike[str] | None
) -> dict[str, Any]:
    """Return the header of a recording as JSON values; with it the recording can be read without any other file.

    hand_source: the hand as the caller named it, whose description text is stored if there is one; None: `hand`.
    Fields: `clock`, the time base ("host": arrival times; "hub": the hub's clock); `epoch_offset_ns`, Unix time minus
    the time of that clock, nanoseconds (0: unknown); `hand_description`, text of the hand's file. If the link plays a
    recording, the fields of that recording's header take precedence, except `clock`.
    """
    clock = "host" if has_arrivals(link) else "hub"
    # The clock "host" is `time.monotonic`. The clock "hub" of a live emulator begins at 0 at about the present time.
    offset_ns = time.time_ns() - (time.monotonic_ns() if clock == "host" else 0)
    header: dict[str, Any] = {
        "url": url,
        "hand": hand.name,
        "baud": link.baud,
        "clock": clock,
        "epoch_offset_ns": 0 if link.is_recorded else offset_ns,
        "taxel_version": VERSION,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    text = read_hand_text(hand if hand_source is None else hand_source)
    if text is not None:
        header["hand_description"] = text
    return header | getattr(link, "header", {}) | {"clock": clock} if link.is_recorded else header
