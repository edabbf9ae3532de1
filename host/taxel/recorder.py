"""A skin whose bytes, or whose topics too, are written to a file while they are used."""

from __future__ import annotations

import importlib.metadata
import os
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from taxel.hand import Hand
from taxel.hand.description import description_text
from taxel.link import CaptureError, CaptureWriter, Chunk, Link
from taxel.link.capture import EXISTS
from taxel.ros.mcap_file import McapFile
from taxel.ros.topics import SkinTopics
from taxel.skin import Skin, open_source
from taxel.stream import TaxelFrame
from taxel.stream.frame_stream import has_arrivals

MCAP_SUFFIX = ".mcap"
BASELINE_METADATA = "taxel_baseline"
BOARDS_METADATA = "taxel_boards"

Joints = Callable[[], npt.ArrayLike]
"""Gives the joint angles of the hand's robot, radians [j], in the order of its `joint_names`."""


class ByteWriter(Protocol):
    """What a `RecordingLink` writes to."""

    def write(self, data: bytes, time_ns: int) -> None:
        """Append bytes that arrived at `time_ns` on the link's clock."""
        ...

    def tick(self) -> None:
        """Nothing has arrived for a while."""
        ...

    def close(self) -> None:
        """No more bytes will come."""
        ...


class RecordingLink:
    """Another link, with every chunk that it brings appended to a recording before anybody sees it."""

    def __init__(self, link: Link, writer: ByteWriter) -> None:
        self._link = link
        self._writer = writer
        self.name = link.name
        self.baud = link.baud
        self.is_real_time = link.is_real_time
        self.is_recorded = link.is_recorded
        self.holds_back = link.holds_back
        self.has_arrivals = has_arrivals(link)
        self.header: dict[str, Any] = getattr(link, "header", {})

    def read(self, timeout_s: float) -> Chunk | None:
        """The next bytes, written down."""
        chunk = self._link.read(timeout_s)
        if chunk is not None:
            self._writer.write(chunk.data, chunk.arrival_ns)
        else:
            self._writer.tick()
        return chunk

    def write(self, data: bytes) -> None:
        """Send bytes; they are not recorded."""
        self._link.write(data)

    def close(self) -> None:
        """Close link and recording."""
        self._link.close()
        self._writer.close()


class McapBytes:
    """Writes the hub's bytes into an MCAP file; the file stays the caller's."""

    def __init__(self, file: McapFile, header: Mapping[str, Any]) -> None:
        self._file = file
        self._offset_ns = int(header["epoch_offset_ns"])
        self._follows_frames = header["clock"] == "hub"
        self.frame_ns = self._offset_ns  # of the latest frame, Unix time

    def write(self, data: bytes, time_ns: int) -> None:
        """Append bytes."""
        self._file.write_bytes(data, time_ns, self.frame_ns if self._follows_frames else time_ns + self._offset_ns)

    def tick(self) -> None:
        """Let the file write what waits."""
        self._file.tick()

    def close(self) -> None:
        """The topics may still have something to say."""


class McapSkin(Skin):
    """A skin whose frames are written to an MCAP file as topics, with the bytes that they came in."""

    def __init__(
        self, link: Link, hand: Hand, file: McapFile, header: Mapping[str, Any], joints: Joints | None
    ) -> None:
        self._file = file
        self._bytes = McapBytes(file, header)
        super().__init__(RecordingLink(link, self._bytes), hand)
        self._topics = SkinTopics(hand, self.hub, int(header["epoch_offset_ns"]), joints)
        self._has_baseline = False

    def _checked(self, frame: TaxelFrame) -> TaxelFrame:
        frame = super()._checked(frame)
        self._bytes.frame_ns = self._topics.time_ns(frame.time_s)
        for message in self._topics.take(frame):
            self._file.publish(message)
        if self._topics.baseline is not None and not self._has_baseline:
            self._has_baseline = True
            values = {name: np.asarray(value).tolist() for name, value in vars(self._topics.baseline).items()}
            self._file.add_metadata(BASELINE_METADATA, values)
        return frame

    def close(self) -> None:
        """Stop the stream, write what is left, close link and file."""
        super().close()
        try:
            for message in self._topics.finish():
                self._file.publish(message)
            self._file.add_metadata(BOARDS_METADATA, {f"0x{a:02X}": _shown(f) for a, f in self.hub.boards.items()})
        finally:
            self._file.close()


def _shown(fields: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value.hex() if isinstance(value, bytes) else value for name, value in fields.items()}


def recording_header(url: str, link: Link, hand: Hand, given: Hand | str | os.PathLike[str] | None) -> dict[str, Any]:
    """What a recording says of itself, as JSON values, so that the file alone is enough to read it.

    `clock`: "host": arrival times are the time base; "hub": the hub's own clock is. `epoch_offset_ns`: from that clock
    to Unix time; 0 where nobody knows. `hand_description`: the text of the hand's file, where there is one. A source
    that is a recording itself keeps what it said.
    """
    clock = "host" if has_arrivals(link) else "hub"
    offset_ns = time.time_ns() - (time.monotonic_ns() if clock == "host" else 0)
    head: dict[str, Any] = {
        "url": url,
        "hand": hand.name,
        "baud": link.baud,
        "clock": clock,
        "epoch_offset_ns": 0 if link.is_recorded else offset_ns,
        "taxel_version": importlib.metadata.version("taxel"),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
    }
    text = description_text(hand if given is None else given)
    if text is not None:
        head["hand_description"] = text
    return head | getattr(link, "header", {}) | {"clock": clock} if link.is_recorded else head


def open_recorded(
    url: str,
    path: str | os.PathLike[str],
    hand: Hand | str | None = None,
    overwrite: bool = False,
    joint_position: npt.ArrayLike | Joints | None = None,
) -> Skin:
    """As `taxel.open`, and everything that arrives goes to the file `path` as well.

    A name that ends in .mcap: an MCAP file with the hub's bytes and the skin's topics; any other: a capture, the bytes
    alone. `joint_position`: of the hand's robot, radians [j], or what gives it at any time; None: all 0 (for the TF
    tree and the contact cloud of an MCAP file). Raises `CaptureError` before anything is opened if the file exists and
    `overwrite` is False.
    """
    if os.path.exists(path) and not overwrite:
        raise CaptureError(os.fspath(path), EXISTS)
    link, description = open_source(url, hand)
    try:
        header = recording_header(url, link, description, hand)
    except BaseException:
        link.close()
        raise
    return record_link(link, description, header, path, overwrite, joint_position)


def record_link(
    link: Link,
    hand: Hand,
    header: dict[str, Any],
    path: str | os.PathLike[str],
    overwrite: bool = False,
    joint_position: npt.ArrayLike | Joints | None = None,
) -> Skin:
    """The skin at an open link, recorded as `open_recorded` does; closes the link if that cannot be."""
    if os.fspath(path).endswith(MCAP_SUFFIX):
        return _open_mcap(link, hand, header, path, overwrite, joint_position)
    try:
        writer = CaptureWriter(path, header, overwrite)
    except BaseException:
        link.close()
        raise
    try:
        return Skin(RecordingLink(link, writer), hand)
    except BaseException:
        if writer.records == 0:
            os.unlink(path)  # nothing ever came: an empty capture helps nobody
        raise


def joint_source(joint_position: npt.ArrayLike | Joints | None) -> Joints | None:
    """What gives the joint angles: the given one, or fixed angles; None for none."""
    if joint_position is None or callable(joint_position):
        return joint_position
    fixed = np.asarray(joint_position, dtype=np.float64)
    return lambda: fixed


def _open_mcap(
    link: Link,
    hand: Hand,
    header: dict[str, Any],
    path: str | os.PathLike[str],
    overwrite: bool,
    joint_position: npt.ArrayLike | Joints | None,
) -> Skin:
    if joint_position is None:
        joint_position = header.get("joint_position")
    elif not callable(joint_position):
        header["joint_position"] = np.asarray(joint_position, dtype=np.float64).tolist()
    try:
        file = McapFile(path, header, overwrite)
    except BaseException:
        link.close()
        raise
    try:
        return McapSkin(link, hand, file, header, joint_source(joint_position))
    except BaseException:
        file.close()
        if file.messages == 0:
            os.unlink(path)
        raise
