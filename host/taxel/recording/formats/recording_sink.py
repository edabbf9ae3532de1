"""Target of a conversion to a capture or an MCAP file, which the skin writes while its frames are read."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from taxel.output import LiveOutput, PendingOutput
from taxel.recording.formats.frame_table import convert_output_errors
from taxel.skin.joint_recording import get_joint_path
from taxel.stream import TaxelFrame


class RecordingSink:
    """Writer of a capture or an MCAP file under a temporary name; the file gets its final name when it is complete."""

    def __init__(self, path: Path, overwrite: bool, has_joints: bool) -> None:
        """Create the temporary file of the recording.

        has_joints: also create the temporary file of the joint angles, which are stored beside a capture. Raises
        CaptureError if the system refuses, or if another program writes the output.
        """
        self._path = path
        self._joints: PendingOutput | None = None
        with ExitStack() as stack, convert_output_errors(path):
            self._pending = PendingOutput(path, overwrite=overwrite)
            stack.callback(self._pending.discard)
            if has_joints:
                self._joints = PendingOutput(get_joint_path(path), overwrite=overwrite)
            stack.pop_all()

    def open(self) -> tuple[LiveOutput, LiveOutput | None]:
        """Open the temporary files; return (recording, joint-angle file or None). Raises CaptureError."""
        with convert_output_errors(self._path):
            recording = LiveOutput.without_name(self._pending.part)
            return recording, None if self._joints is None else LiveOutput.without_name(self._joints.part)

    @contextmanager
    def discarded_on_error(self) -> Iterator[None]:
        """Context manager that removes the temporary files if the block fails."""
        try:
            yield
        except BaseException:
            self.close(is_complete=False)
            raise

    def take(self, frame: TaxelFrame) -> None:
        """Do nothing: the skin has written the frame."""

    def close(self, is_complete: bool) -> None:
        """Give the recording its final name, or remove it if it is not complete."""
        outputs = [output for output in (self._joints, self._pending) if output is not None]
        try:
            if is_complete:
                with convert_output_errors(self._path):
                    for output in outputs:
                        output.commit()
        finally:
            for output in outputs:
                output.discard()
