"""Bytes of a recording in pieces with their times, for replay in real time."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from taxel.link import Link
from taxel.stream.decoder import StreamDecoder
from taxel.stream.encoder import FramesLink
from taxel.stream.frame_stream import has_arrivals

_WRAP_US = 1 << 32


class TimedBytes(NamedTuple):
    """Bytes and their arrival time, seconds on the clock of the recording."""

    data: bytes
    time_s: float


class StreamStart(NamedTuple):
    """Start of the taxel frames in a recording.

    `skip`: number of bytes before the first taxel frame. `sequence`: sequence number of this frame.
    """

    skip: int
    sequence: int


def read_timed_bytes(link: Link) -> Iterator[TimedBytes]:
    """Yield all bytes of a recording with their times.

    If the recording has no real arrival times, each piece ends with a taxel frame and has the time at which the hub
    read that frame's board. Raises the errors of the link except EOFError.
    """
    if has_arrivals(link) or isinstance(link, FramesLink):
        yield from _read_chunks(link)
    else:
        yield from _read_by_hub_time(link)


def _read_chunks(link: Link) -> Iterator[TimedBytes]:
    """Yield the chunks of a recording with their arrival times, seconds."""
    while True:
        try:
            chunk = link.read(0.0)
        except EOFError:
            return
        if chunk is not None:
            yield TimedBytes(chunk.data, chunk.arrival_ns * 1e-9)


def _read_by_hub_time(link: Link) -> Iterator[TimedBytes]:
    """Yield the bytes of a recording without real arrival times in pieces that end with a taxel frame.

    The time of a piece is the hub time of the frame at its end, seconds.
    """
    decoder = StreamDecoder()
    chunk_start = hub_us = 0
    time_s = 0.0
    for data, _ in _read_chunks(link):
        position = chunk_start
        for batch in decoder.push(data):
            rows = batch.taxel_rows
            for end, now_us in zip(rows["stream_position"].tolist(), rows["hub_time_us"].tolist(), strict=True):
                # Signed difference of times modulo 2^32: correct across a wrap of the 32-bit hub time.
                step = (now_us - hub_us + _WRAP_US // 2) % _WRAP_US - _WRAP_US // 2
                hub_us += step
                time_s = hub_us * 1e-6
                if chunk_start <= end and position < end <= chunk_start + len(data):
                    yield TimedBytes(data[position - chunk_start : end - chunk_start], time_s)
                    position = end
        if position < chunk_start + len(data):
            yield TimedBytes(data[position - chunk_start :], time_s)
        chunk_start += len(data)


def find_stream_start(link: Link, search_bytes: int = 1 << 22) -> StreamStart | None:
    """Find the first taxel frame of a recording; None if its first `search_bytes` bytes contain none.

    The result contains the end of the last message before this frame, bytes of the stream, and the frame's sequence
    number.
    """
    decoder = StreamDecoder()
    skip = size = 0
    for data, _ in _read_chunks(link):
        size += len(data)
        for batch in decoder.push(data):
            message_ends = batch.message_rows["stream_position"].astype(np.int64)
            if len(batch.taxel_rows):
                first = int(batch.taxel_rows["stream_position"][0])
                earlier = message_ends[message_ends < first]
                skip = int(earlier[-1]) if len(earlier) else skip
                return StreamStart(skip, int(batch.taxel_rows["sequence"][0]))
            skip = int(message_ends[-1]) if len(message_ends) else skip
        if size > search_bytes:
            return None
    return None
