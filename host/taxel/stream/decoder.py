"""Bytes to frames, in batches, through the C decoder."""

import ctypes
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from taxel_protocol import FrameType

from taxel.stream.native import ROW_SIZE, codec_library

ROW = np.dtype(
    [
        ("stream_position", "<u8"),
        ("hub_time_us", "<u4"),
        ("board_time_us", "<u4"),
        ("offset", "<u4"),
        ("size", "<u2"),
        ("sequence", "<u2"),
        ("cycle", "<u2"),
        ("board_sequence", "<u2"),
        ("type", "u1"),
        ("address", "u1"),
        ("flags", "u1"),
        ("reserved", "u1"),
    ],
    align=True,
)
"""`struct taxel_batch_row` of firmware/codec/batch.h."""

BOARD_CRC_BAD = 1
"""Row flag: hub and wire were right, but the board's own CRC-32 is not."""

_ROWS = 4096
_COUNTS = 1 << 18
_PAYLOADS = 1 << 16


class Batch(NamedTuple):
    """Frames in the order in which they ended.

    `rows` [k] has dtype `ROW`. `counts` holds the raw counts of all taxel frames one after the other, `payloads` the payload
    bytes of all other frames; a row's `offset` and `size` say where its part lies.
    """

    rows: NDArray[np.void]
    counts: NDArray[np.uint16]
    payloads: bytes


class StreamDecoder:
    """Decode a stream of hub frames; no valid frame is lost to a broken neighbour.

    `discarded_bytes` counts bytes that belong to no frame (delimiters do not count).
    """

    def __init__(self) -> None:
        self._library = codec_library()
        assert ROW.itemsize == ROW_SIZE
        self._state = ctypes.create_string_buffer(self._library.taxel_batch_struct_size())
        self._rows = np.zeros(_ROWS, dtype=ROW)
        self._counts = np.zeros(_COUNTS, dtype=np.uint16)
        self._payloads = np.zeros(_PAYLOADS, dtype=np.uint8)
        self._row_count = ctypes.c_size_t()
        self._output = (
            self._rows.ctypes.data, _ROWS, self._counts.ctypes.data, _COUNTS,
            self._payloads.ctypes.data, _PAYLOADS, ctypes.addressof(self._row_count),
        )  # fmt: skip
        self._library.taxel_batch_init(self._state, 1)

    @property
    def discarded_bytes(self) -> int:
        """Bytes so far that were part of no frame."""
        return int(self._library.taxel_batch_discarded_bytes(self._state))

    def push(self, data: bytes) -> list[Batch]:
        """Frames completed by `data`: usually one batch, more when there is very much of it."""
        batches = []
        view = data
        while view:
            taken = self._library.taxel_batch_decode(self._state, view, len(view), *self._output)
            if self._row_count.value:
                batches.append(self._take())
            view = view[taken:]
        return batches

    def finish(self) -> list[Batch]:
        """Frames in what is left when the stream has ended without a delimiter."""
        self._library.taxel_batch_finish(self._state, *self._output)
        return [self._take()] if self._row_count.value else []

    def _take(self) -> Batch:
        rows = self._rows[: self._row_count.value].copy()
        is_taxels = rows["type"] == FrameType.TAXELS
        counts = int(rows["size"][is_taxels].sum(dtype=np.int64))
        payloads = int(rows["size"][~is_taxels].sum(dtype=np.int64))
        return Batch(rows, self._counts[:counts].copy(), self._payloads[:payloads].tobytes())
