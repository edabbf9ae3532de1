"""A skin that is recorded in an MCAP file: the hub's bytes, and the frames as ROS 2 topics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from taxel.hand import Hand
from taxel.link import Chunk, Link
from taxel.proximity import ProximityWatch
from taxel.ros.topics import JointSource, SkinTopics, TopicMessage
from taxel.skin.confirmed_bytes import ConfirmedBytes
from taxel.skin.recording_link import RecordingLink
from taxel.skin.recording_skin import RecordingSkin
from taxel.skin.skin import Skin
from taxel.stream import TaxelFrame

if TYPE_CHECKING:  # the library mcap is loaded only when an MCAP file is written
    from taxel.ros.mcap_file import McapFile

BASELINE_METADATA = "taxel_baseline"
BOARDS_METADATA = "taxel_boards"


class McapBytes(ConfirmedBytes):
    """Writer of the hub's bytes into an MCAP file that the caller opens and closes.

    Bytes are written when they are confirmed, because compressed chunks cannot be cut.
    """

    def __init__(self, file: McapFile, header: Mapping[str, Any]) -> None:
        """Create a writer of received bytes into an open MCAP file; header: header of the recording with its clock."""
        super().__init__()
        self._file = file
        self._offset_ns = int(header["epoch_offset_ns"])
        self._uses_hub_clock = header["clock"] == "hub"
        self.frame_ns = self._offset_ns
        """Time of the latest frame, Unix nanoseconds."""

    def _append(self, chunk: Chunk) -> None:
        """Append a chunk to the MCAP file, at the time of the latest frame if arrival times are not real."""
        time_ns = chunk.arrival_ns
        file_ns = self.frame_ns if self._uses_hub_clock else time_ns + self._offset_ns
        self._file.write_bytes(chunk.data, time_ns, file_ns)

    def tick(self) -> None:
        """Write buffered data of the MCAP file to disk if this is due."""
        self._file.tick()

    def close(self) -> None:
        """Do nothing: the topics are completed after the link is closed, and then `McapSkin` closes the file."""


class McapSkin(RecordingSkin):
    """A skin whose frames are written to an MCAP file as topics, beside the bytes that contained them."""

    def __init__(
        self,
        link: Link,
        hand: Hand,
        file: McapFile,
        header: Mapping[str, Any],
        joints: JointSource | None,
        proximity: ProximityWatch | None = None,
    ) -> None:
        """Open a skin on a link and record its bytes and ROS topics in an open MCAP file.

        header: header of the recording. joints: function that returns the joint angles of the hand's robot, radians;
        None: all 0. proximity: estimators of targets before contact, whose estimates become topics. Raises
        JointCountError for a wrong number of joint angles. After an error the link is closed and the file stays open.
        """
        self._file = file
        self._bytes = McapBytes(file, header)
        self._delivered: list[TopicMessage] = []
        super().__init__(RecordingLink(link, self._bytes), hand)
        try:
            self._topics = SkinTopics(hand, self.hub, int(header["epoch_offset_ns"]), joints, proximity=proximity)
        except BaseException:
            Skin.close(self)  # not `self.close`, which also writes the last messages of the topics
            raise
        self._has_baseline = False

    def _check_frame(self, frame: TaxelFrame) -> TaxelFrame:
        """Check a taxel frame and return it; collect its ROS messages until its bytes are written.

        When the baseline is complete, it is added to the metadata of the MCAP file.
        """
        frame = super()._check_frame(frame)
        self._bytes.frame_ns = self._topics.time_ns(frame.time_s)
        self._delivered.extend(self._topics.take(frame))
        if self._topics.baseline is not None and not self._has_baseline:
            self._has_baseline = True
            values = {name: np.asarray(value).tolist() for name, value in vars(self._topics.baseline).items()}
            self._file.add_metadata(BASELINE_METADATA, values)
        return frame

    def _write_delivered(self, position: int, splits: bool) -> None:
        """Write the bytes of the delivered frames, and then the messages of these frames."""
        with self._file.group():
            super()._write_delivered(position, splits)
            self._publish_delivered()

    def _publish_delivered(self) -> None:
        """Write the messages of the delivered frames."""
        for message in self._delivered:
            self._file.publish(message)
        self._delivered.clear()

    def end_recording(self) -> None:
        """End the bytes after the last frame that the reader has received, and write the messages of these frames."""
        super().end_recording()
        if not self._file.is_closed:
            self._publish_delivered()

    def close(self) -> None:
        """Stop the frames of the hub, write the last messages to the MCAP file, and close link and file."""
        super().close()
        if self._file.is_closed:
            return
        try:
            for message in self._topics.finish():
                self._file.publish(message)
            boards = {f"0x{address:02X}": _encode_json_fields(fields) for address, fields in self.hub.boards.items()}
            self._file.add_metadata(BOARDS_METADATA, boards)
        finally:
            self._file.close()


def _encode_json_fields(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return message fields as JSON values; bytes become hexadecimal text."""
    return {name: value.hex() if isinstance(value, bytes) else value for name, value in fields.items()}
