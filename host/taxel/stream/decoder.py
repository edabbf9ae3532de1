"""Bytes to frames, in batches, through the C decoder."""

import ctypes
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.stream.native import ROW_SIZE, BatchOutput, codec_library
from taxel_protocol.limits import ACKNOWLEDGE_MAX

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
        ("lost_before", "<u2"),
        ("missing_before", "<u2"),
        ("type", "u1"),
        ("address", "u1"),
        ("flags", "u1"),
        ("reserved", "u1"),
        ("length", "<u2"),
    ],
    align=True,
)
"""`struct taxel_batch_row` of firmware/codec/batch.h."""

BOARD_CRC_BAD = 1
"""Row flag: hub and wire were right, but the board's own CRC-32 is not."""

ADDRESSES = 128
TOTALS = 3 + 4 * ADDRESSES

_ROWS = 4096
_COUNTS = 1 << 18
_PAYLOADS = 1 << 16


HUB_RESTARTED = 2
"""Row flag: the hub has started anew and counts from 0 again."""

NO_REFERENCE = 4
"""Row flag: a compact snapshot, coded against a reference that this host does not have: it has no counts."""

_ANSWERS = 3 * ACKNOWLEDGE_MAX


class Batch(NamedTuple):
    """Frames in the order in which they ended: taxel frames in `taxels`, all others in `others`, both with dtype `ROW`.

    `counts` holds the raw counts of all taxel frames one after the other, `payloads` the payload
    bytes of all other frames; a row's `offset` and `size` say where its part lies.
    """

    taxels: NDArray[np.void]
    others: NDArray[np.void]
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
        self._taxels = np.zeros(_ROWS, dtype=ROW)
        self._others = np.zeros(_ROWS, dtype=ROW)
        self._counts = np.zeros(_COUNTS, dtype=np.uint16)
        self._payloads = np.zeros(_PAYLOADS, dtype=np.uint8)
        self._output = BatchOutput(
            self._taxels.ctypes.data, self._others.ctypes.data, self._counts.ctypes.data, self._payloads.ctypes.data,
            _ROWS, _COUNTS, _PAYLOADS,
        )  # fmt: skip
        self._output_address = ctypes.addressof(self._output)
        self._counts_found = np.ctypeslib.as_array(
            (ctypes.c_uint64 * 4).from_buffer(self._output, ctypes.sizeof(BatchOutput) - 32)  # the last four members
        )
        self._answers = ctypes.create_string_buffer(_ANSWERS)
        self._library.taxel_batch_init(self._state, 1)

    @property
    def totals(self) -> NDArray[np.uint64]:
        """`struct taxel_batch_totals` of firmware/codec/batch.h as it is now: frames, lost, restarts, then 4 x 128 by
        address.
        """
        address = self._library.taxel_batch_totals(self._state)
        return np.ctypeslib.as_array((ctypes.c_uint64 * TOTALS).from_address(address)).copy()

    @property
    def discarded_bytes(self) -> int:
        """Bytes so far that were part of no frame."""
        return int(self._library.taxel_batch_discarded_bytes(self._state))

    def forget_cycles(self) -> None:
        """The stream is about to be started again: boards that the cut cycle had not come to are not missing."""
        self._library.taxel_batch_forget_cycles(self._state)

    def answers(self) -> bytes:
        """Payload of an ACKNOWLEDGE frame with what boards of compact snapshots wait for; empty: nothing to say.

        What was fetched counts as sent.
        """
        size = self._library.taxel_batch_answers(self._state, self._answers, _ANSWERS)
        return self._answers.raw[:size] if size else b""

    def push(self, data: bytes | NDArray[np.uint8]) -> list[Batch]:
        """Frames completed by `data`: usually one batch, more when there is very much of it."""
        batches: list[Batch] = []
        source: bytes | int = data if isinstance(data, bytes) else data.ctypes.data
        left = len(data)
        while left:
            taken = self._library.taxel_batch_decode(self._state, source, left, self._output_address)
            self._take(batches)
            left -= taken
            if left:  # an address is dear, and hardly ever needed
                start = source if isinstance(source, int) else np.frombuffer(source, dtype=np.uint8).ctypes.data
                source = start + taken
        return batches

    def finish(self) -> list[Batch]:
        """Frames in what is left when the stream has ended without a delimiter."""
        self._library.taxel_batch_finish(self._state, self._output_address)
        batches: list[Batch] = []
        self._take(batches)
        return batches

    def _take(self, batches: list[Batch]) -> None:
        taxels, others, counts, payloads = self._counts_found.tolist()
        if taxels or others:
            batches.append(
                Batch(
                    _rows(self._taxels, taxels),
                    _rows(self._others, others),
                    self._counts[:counts].copy(),
                    self._payloads[:payloads].tobytes(),
                )
            )


def _rows(table: NDArray[np.void], count: int) -> NDArray[np.void]:
    # A copy by bytes: numpy copies structured arrays field by field, twenty times slower.
    return np.frombuffer(table[:count].tobytes(), dtype=ROW)
