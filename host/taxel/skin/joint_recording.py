"""A skin that is recorded to a capture, with the measured joint angles of every poll cycle in a file beside it."""

import os
from pathlib import Path
from typing import Final

from taxel.hand import Hand
from taxel.hand.joint_history import JointFileWriter, JointHistory
from taxel.output import LiveOutput
from taxel.skin.recording_link import RecordingLink
from taxel.skin.recording_skin import RecordingSkin
from taxel.stream import TaxelFrame

JOINT_SUFFIX: Final = ".joints.csv"


def get_joint_path(capture: str | os.PathLike[str]) -> Path:
    """Return the path of the file with the joint angles of a capture: its name with ".joints.csv" appended."""
    return Path(os.fspath(capture) + JOINT_SUFFIX)


class JointRecordingSkin(RecordingSkin):
    """A skin on a link that records the bytes; the joint angles of each poll cycle are written to their own file."""

    def __init__(self, link: RecordingLink, hand: Hand, joints: JointHistory, output: LiveOutput) -> None:
        """Open the skin, and write the column names of the joint angles to the file `output`.

        After an error the file is removed.
        """
        self._joints = joints
        try:
            self._writer = JointFileWriter(output, joints.names)
            super().__init__(link, hand)
        except BaseException:
            output.discard()
            raise

    def _check_frame(self, frame: TaxelFrame) -> TaxelFrame:
        """Check a taxel frame and return it; write the joint angles at the first frame of each poll cycle."""
        frame = super()._check_frame(frame)
        self._writer.write_frame(self._joints, frame.cycle, frame.time_s)
        return frame

    def close(self) -> None:
        """Close the skin and the file of joint angles."""
        try:
            super().close()
        finally:
            self._writer.finish(self._joints)
