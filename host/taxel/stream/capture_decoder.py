"""Decoder of whole capture files: reads the file in blocks and decodes the blocks in C."""

import os
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.link import CaptureLink
from taxel.link.capture import RECORD_HEAD, RECORD_MAX
from taxel.stream.decoder import Batch, StreamDecoder
from taxel.stream.native import load_codec_library

BLOCK = 1 << 18
"""Block size, bytes: small enough for the cache of one core, large enough that the call overhead is negligible."""

ARRIVAL = np.dtype([("end", "<u8"), ("time_ns", "<u8")])
"""`struct taxel_capture_arrival` of firmware/codec/capture.h: end of a record in the stream, and its arrival time."""

_BLOCK_VALUES = 4


class CapturedBatch(NamedTuple):
    """A batch of decoded frames, and the arrivals (dtype `ARRIVAL`) of the capture records in which the frames end."""

    batch: Batch
    arrivals: NDArray[np.void]


class CaptureDecoder:
    """Iterator over the batches of a capture file, for a single pass; memory use does not depend on the file size.

    `decoder` counts losses during the iteration (see `LossAccount`). `has_arrivals`: whether the arrival times are
    real times. The constructor raises `CaptureError` if the file is no capture. The iteration raises `CaptureError`
    after the last valid record if the file is damaged or truncated.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open a capture file for decoding; raise CaptureError if the file is no capture."""
        self._link = CaptureLink(path)
        self.header, self.baud, self.has_arrivals = self._link.header, self._link.baud, self._link.has_arrivals
        self.decoder = StreamDecoder()
        self._gather = load_codec_library().taxel_capture_gather
        self._block_values = np.zeros(_BLOCK_VALUES, dtype=np.uint64)
        self._allocate(BLOCK)

    def _allocate(self, size: int) -> None:
        """Allocate a block of `size` bytes for the content of the file, and an array for arrival times of records."""
        self._block = np.empty(size, dtype=np.uint8)
        self._arrivals = np.empty(size // RECORD_HEAD, dtype=ARRIVAL)

    def __iter__(self) -> Iterator[CapturedBatch]:
        """Yield batches of decoded frames with the arrival times of their bytes, block by block.

        Raises CaptureError after the last valid record of a damaged or truncated file.
        """
        fill = position = 0
        with self._link as link:
            while size := link.read_into(self._block.data[fill:]):
                fill += size
                block_address = self._block.ctypes.data
                self._gather(block_address, fill, position, self._arrivals.ctypes.data, self._block_values.ctypes.data)
                # Bytes of the complete records, their payload bytes, number of records, size of the incomplete record.
                used, payload, records, required = self._block_values.tolist()
                position += payload
                if payload:
                    arrivals = np.frombuffer(self._arrivals[:records].tobytes(), dtype=ARRIVAL)
                    for batch in self.decoder.push(self._block[:payload]):
                        yield CapturedBatch(batch, arrivals)
                self._keep_partial_record(slice(used, fill), required)
                fill -= used
                if required > RECORD_HEAD + RECORD_MAX:
                    break
            for batch in self.decoder.finish():
                yield CapturedBatch(batch, np.array([(position, arrivals[-1]["time_ns"])], dtype=ARRIVAL))
            if fill:
                raise link.make_damage_error(link.position - fill, is_interrupted=required <= RECORD_HEAD + RECORD_MAX)

    def _keep_partial_record(self, partial: slice, required: int) -> None:
        """Move an incomplete record to the front of the block; enlarge the block to `required` bytes if needed.

        The block never exceeds the bytes that remain in the file, so a damaged length field cannot exhaust memory.
        """
        begin = self._block[partial].copy()
        size = min(required, len(begin) + self._link.remaining_bytes)
        if size > len(self._block) and required <= RECORD_HEAD + RECORD_MAX:
            self._allocate(size)
        self._block[: len(begin)] = begin


def decode_capture(path: str | os.PathLike[str]) -> Iterator[Batch]:
    """Iterate over the batches of a capture file; see `CaptureDecoder`.

    >>> frames = sum(len(batch.taxel_rows) for batch in decode_capture("capture.bin"))  # doctest: +SKIP
    """
    return (batch for batch, _ in CaptureDecoder(path))
