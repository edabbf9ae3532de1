"""A skin whose recording contains exactly what its reader has received."""

import time
from collections.abc import Callable
from typing import Final

from taxel.hand import Hand
from taxel.skin.recording_link import RecordingLink
from taxel.skin.skin import Skin
from taxel.stream import TaxelFrame

WRITE_PERIOD_S: Final = 0.1
"""Longest time between two writes of delivered frames, seconds. A killed program loses the frames since the last write;
a shorter time divides the received bytes into smaller parts.
"""


class RecordingSkin(Skin):
    """A skin on a link that records the bytes. The recording ends after the last frame that the reader has received.

    The link is read ahead of the reader: by milliseconds from a port, by seconds from an emulator at full speed.
    `end_s`: time of `time.monotonic` at which the iteration over a real-time source ends although no frame arrives;
    None: never.
    """

    _is_recording = True

    def __init__(self, link: RecordingLink, hand: Hand) -> None:
        """Open the skin of a hand on a link that records its bytes."""
        self._recording = link
        self._written_s = time.monotonic()
        self.end_s: float | None = None
        self.on_wait: Callable[[], None] = _do_nothing
        """Called before each wait for bytes, at least ten times in a second."""
        super().__init__(link, hand)

    def _read_link(self, timeout_s: float = 0.1) -> None:
        """Write all bytes read so far, because the reader has received all their frames; then read the link.

        Raises EOFError at the time `end_s` of a real-time source.
        """
        if self.end_s is not None and self.link.is_real_time and time.monotonic() >= self.end_s:
            raise EOFError
        self.on_wait()
        self._write_delivered(self._stream.link_position, splits=False)
        self._written_s = time.monotonic()
        super()._read_link(timeout_s)

    def _check_frame(self, frame: TaxelFrame) -> TaxelFrame:
        """Check a taxel frame and return it; write the bytes of earlier frames if `WRITE_PERIOD_S` has passed."""
        frame = super()._check_frame(frame)
        now_s = time.monotonic()
        if now_s - self._written_s > WRITE_PERIOD_S and not self.link.is_recorded:
            self._write_delivered(self._stream.delivered_position, splits=True)
            self._written_s = now_s
        return frame

    def _write_delivered(self, position: int, splits: bool) -> None:
        """Write the bytes of delivered frames, up to `position` on the link; splits: as in `ByteWriter.confirm`."""
        self._recording.confirm(position, splits)

    def end_recording(self) -> None:
        """Stop reading the link, and end the recording after the last frame that the reader has received.

        Losses and byte counts of the skin then describe the recording. Raises `CaptureError` if the file cannot be
        written.
        """
        self._stream.release()
        self._recording.cut(self._stream.cut())

    def close(self) -> None:
        """End the recording, stop the stream of the hub and close the link."""
        try:
            self.end_recording()
        finally:
            super().close()


def _do_nothing() -> None:
    """Do nothing: the reader needs no call."""
