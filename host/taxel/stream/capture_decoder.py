"""Whole captures as batches, at memory speed: blocks of the file, taken apart and decoded in C."""

import os
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.link import CaptureLink
from taxel.link.capture import RECORD_HEAD, RECORD_MAX
from taxel.stream.decoder import Batch, StreamDecoder
from taxel.stream.native import codec_library

BLOCK = 1 << 18
"""Bytes of the file at a time: small enough for a core's own cache, large enough that calls cost nothing."""

ARRIVAL = np.dtype([("end", "<u8"), ("time_ns", "<u8")])
"""`struct taxel_capture_arrival` of firmware/codec/capture.h: a record's end in the stream, and when it arrived."""

_BLOCK_VALUES = 4


class CapturedBatch(NamedTuple):
    """Frames, and the arrivals (dtype `ARRIVAL`) of the records in which they end."""

    batch: Batch
    arrivals: NDArray[np.void]


class CaptureDecoder:
    """Decodes a capture once: iterate over it. Its memory does not grow with the file.

    `decoder` counts losses as it goes on (see `LossAccount`). `has_arrivals`: the times of arrival mean something.
    Iterating raises `CaptureError`, after everything before it was given, if the file is damaged or cut short; making
    one, if it is no capture.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._link = CaptureLink(path)
        self.header, self.baud, self.has_arrivals = self._link.header, self._link.baud, self._link.has_arrivals
        self.decoder = StreamDecoder()
        self._gather = codec_library().taxel_capture_gather
        self._found = np.zeros(_BLOCK_VALUES, dtype=np.uint64)
        self._make_room(BLOCK)

    def _make_room(self, size: int) -> None:
        self._block = np.empty(size, dtype=np.uint8)
        self._arrivals = np.empty(size // RECORD_HEAD, dtype=ARRIVAL)

    def __iter__(self) -> Iterator[CapturedBatch]:
        fill = position = 0
        with self._link as link:
            while size := link.read_into(self._block.data[fill:]):
                fill += size
                at = self._block.ctypes.data
                self._gather(at, fill, position, self._arrivals.ctypes.data, self._found.ctypes.data)
                used, payload, records, wanted = self._found.tolist()
                position += payload
                if payload:
                    arrivals = np.frombuffer(self._arrivals[:records].tobytes(), dtype=ARRIVAL)
                    for batch in self.decoder.push(self._block[:payload]):
                        yield CapturedBatch(batch, arrivals)
                self._keep(slice(used, fill), wanted)
                fill -= used
                if wanted > RECORD_HEAD + RECORD_MAX:
                    break
            for batch in self.decoder.finish():
                yield CapturedBatch(batch, np.array([(position, arrivals[-1]["time_ns"])], dtype=ARRIVAL))
            if fill:
                raise link.broken(link.position - fill, is_cut=wanted <= RECORD_HEAD + RECORD_MAX)

    def _keep(self, rest: slice, wanted: int) -> None:
        """The beginning of a record to the front of the block; a larger block if the record needs one.

        Never larger than what the file still has: a length that a damaged file claims reserves nothing.
        """
        begun = self._block[rest].copy()
        size = min(wanted, len(begun) + self._link.bytes_left)
        if size > len(self._block) and wanted <= RECORD_HEAD + RECORD_MAX:
            self._make_room(size)
        self._block[: len(begun)] = begun


def decode_capture(path: str | os.PathLike[str]) -> Iterator[Batch]:
    """The batches of a capture, one after the other; see `CaptureDecoder`.

    >>> frames = sum(len(batch.taxels) for batch in decode_capture("capture.bin"))  # doctest: +SKIP
    """
    return (batch for batch, _ in CaptureDecoder(path))
