"""Bytes that are decoded but not delivered: a stream that ends at an earlier frame is rewound to that frame."""

import numpy as np
from numpy.typing import NDArray

from taxel.stream.decoder import Batch, StreamDecoder


class UndeliveredBytes:
    """Bytes whose frames the reader may not have received yet, and the state of the decoder before them.

    A decoder processes all waiting bytes at once, while the reader takes one frame at a time and may end the stream at
    any frame. `window_start`: position of the first of these bytes in the stream.
    """

    def __init__(self) -> None:
        """Create an empty window at the start of a stream."""
        self.window_start = 0
        self._state = b""
        self._data: list[bytes] = []
        self._frame_ends: list[int] = []
        self._previous_end = 0
        self._last_end = 0

    def add(self, decoder: StreamDecoder, data: bytes, position: int, has_frames: bool) -> None:
        """Add bytes before they are decoded. If the reader has received all earlier frames, earlier bytes are dropped.

        position: position of the bytes in the stream. has_frames: whether earlier frames still wait for the reader.
        """
        if not has_frames or not self._state:
            self.window_start, self._state = position, decoder.save_state()
            self._data.clear()
            self._frame_ends.clear()
            self._previous_end = self._last_end
        self._data.append(data)

    def note_batch(self, batch: Batch) -> None:
        """Store the end of the last message or frame of a batch."""
        for rows in (batch.taxel_rows, batch.message_rows):
            if len(rows):
                self._last_end = max(self._last_end, int(rows["stream_position"][-1]))

    def note_frames(self, rows: NDArray[np.void]) -> None:
        """Store the ends of taxel frames that are passed to the reader."""
        self._frame_ends.extend(rows["stream_position"].tolist())

    def find_end(self, waiting: int) -> int:
        """Return the end of the last frame that the reader has received, bytes of the stream.

        waiting: number of frames that the reader has not received. If there are none, the messages after the last frame
        belong to the stream as well.
        """
        if not waiting:
            return self._last_end
        taken = len(self._frame_ends) - waiting
        return self._frame_ends[taken - 1] if taken > 0 else self._previous_end

    def rewind(self, decoder: StreamDecoder, end: int) -> None:
        """Set the decoder to its state at byte `end` of the stream; without added bytes, do nothing."""
        if not self._state:
            return
        decoder.restore_state(self._state)
        decoder.push(b"".join(self._data)[: max(end - self.window_start, 0)])
