"""Batch decoder of hub frames: Python binding of the C decoder (firmware/codec/batch.c)."""

import ctypes
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.stream.native import ROW_SIZE, BatchOutput, load_codec_library
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
"""Row flag: the CRC of the hub's frame is correct, but the CRC-32 of the board inside it is not."""

ADDRESSES = 128
TOTALS = 4 + 4 * ADDRESSES

_ROWS = 4096
_COUNTS = 1 << 18
_PAYLOADS = 1 << 16

HUB_RESTARTED = 2
"""Row flag: the hub has restarted, and its sequence numbers begin at 0."""

NO_KEY_FRAME = 4
"""Row flag: a delta frame whose key frame this host does not have; the row has no counts."""

_ACKNOWLEDGEMENTS = 3 * ACKNOWLEDGE_MAX


class Batch(NamedTuple):
    """Decoded frames in stream order: taxel frames in `taxel_rows`, all other frames in `message_rows` (dtype `ROW`).

    `counts` holds the concatenated raw counts of the taxel frames, `payloads` the concatenated payloads of the other
    frames; `offset` and `size` of a row locate its part.
    """

    taxel_rows: NDArray[np.void]
    message_rows: NDArray[np.void]
    counts: NDArray[np.uint16]
    payloads: bytes


class StreamDecoder:
    """Decoder of a stream of hub frames; a damaged frame never hides a valid frame next to it."""

    def __init__(self) -> None:
        """Create a decoder of hub frames with its C state and the output arrays that the C library fills."""
        self._library = load_codec_library()
        assert ROW.itemsize == ROW_SIZE
        self._state = ctypes.create_string_buffer(self._library.taxel_batch_struct_size())
        self._taxel_rows = np.zeros(_ROWS, dtype=ROW)
        self._message_rows = np.zeros(_ROWS, dtype=ROW)
        self._counts = np.zeros(_COUNTS, dtype=np.uint16)
        self._payloads = np.zeros(_PAYLOADS, dtype=np.uint8)
        self._output = BatchOutput(
            self._taxel_rows.ctypes.data, self._message_rows.ctypes.data,
            self._counts.ctypes.data, self._payloads.ctypes.data, _ROWS, _COUNTS, _PAYLOADS,
        )  # fmt: skip
        self._output_address = ctypes.addressof(self._output)
        self._output_sizes = np.ctypeslib.as_array(
            (ctypes.c_uint64 * 4).from_buffer(self._output, ctypes.sizeof(BatchOutput) - 32)  # the last four members
        )
        self._acknowledgements = ctypes.create_string_buffer(_ACKNOWLEDGEMENTS)
        self._library.taxel_batch_init(self._state, 1)

    @property
    def totals(self) -> NDArray[np.uint64]:
        """Copy of the loss counters of the C decoder (`struct taxel_batch_totals`), u64[4 + 4 * 128].

        Frames, lost frames, restarts, unknown frames; then received, missing, damaged and undecoded frames by board
        address.
        """
        address = self._library.taxel_batch_totals(self._state)
        return np.ctypeslib.as_array((ctypes.c_uint64 * TOTALS).from_address(address)).copy()

    @property
    def discarded_bytes(self) -> int:
        """Number of bytes that were part of no frame; delimiters are not counted."""
        return int(self._library.taxel_batch_discarded_bytes(self._state))

    def save_state(self) -> bytes:
        """Return a copy of the state of the C decoder: 0.3 MB, its counters among them."""
        return self._state.raw

    def restore_state(self, state: bytes) -> None:
        """Set the state of the C decoder to a copy that `save_state` of this decoder returned."""
        ctypes.memmove(self._state, state, len(state))

    def forget_cycles(self) -> None:
        """Reset the tracking of poll cycles before a stream restart, so that no interrupted cycle counts as missing."""
        self._library.taxel_batch_forget_cycles(self._state)

    def take_acknowledgements(self) -> bytes:
        """Remove and return pending acknowledgements of key frames, as the payload of an ACKNOWLEDGE frame.

        Empty if none are pending. The caller must send the payload, and repeat the call until the result is empty.
        """
        size = self._library.taxel_batch_take_acknowledgements(self._state, self._acknowledgements, _ACKNOWLEDGEMENTS)
        return self._acknowledgements.raw[:size] if size else b""

    def push(self, data: bytes | NDArray[np.uint8]) -> list[Batch]:
        """Return the frames of the hub completed by the bytes `data`: usually one batch, several for large `data`."""
        batches: list[Batch] = []
        source: bytes | int = data if isinstance(data, bytes) else data.ctypes.data
        remaining = len(data)
        while remaining:
            consumed = self._library.taxel_batch_decode(self._state, source, remaining, self._output_address)
            self._append_batch(batches)
            remaining -= consumed
            if remaining:  # getting an address is slow and rarely needed
                start = source if isinstance(source, int) else np.frombuffer(source, dtype=np.uint8).ctypes.data
                source = start + consumed
        return batches

    def finish(self) -> list[Batch]:
        """Return the frames in the undecoded remainder after the end of a stream without a final delimiter."""
        self._library.taxel_batch_finish(self._state, self._output_address)
        batches: list[Batch] = []
        self._append_batch(batches)
        return batches

    def _append_batch(self, batches: list[Batch]) -> None:
        """Append a copy of the output buffers of the C decoder as a batch, unless they are empty."""
        taxels, messages, counts, payloads = self._output_sizes.tolist()
        if taxels or messages:
            batches.append(
                Batch(
                    _copy_rows(self._taxel_rows, taxels),
                    _copy_rows(self._message_rows, messages),
                    self._counts[:counts].copy(),
                    self._payloads[:payloads].tobytes(),
                )
            )


def _copy_rows(table: NDArray[np.void], count: int) -> NDArray[np.void]:
    """Return a copy of the first `count` rows of an output array of the C decoder."""
    # Copied as bytes: numpy copies structured arrays field by field, which is twenty times slower.
    return np.frombuffer(table[:count].tobytes(), dtype=ROW)
