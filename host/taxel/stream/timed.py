"""A recording's bytes, each piece with the time at which it is due."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from taxel.link import Link
from taxel.stream.decoder import StreamDecoder
from taxel.stream.encoder import FramesLink
from taxel.stream.frame_stream import has_arrivals

_WRAP_US = 1 << 32


class TimedBytes(NamedTuple):
    """Bytes, and when they came: seconds on the recording's clock."""

    data: bytes
    time_s: float


class Beginning(NamedTuple):
    """Where a recording's taxel frames begin. `skip`: bytes before that; `sequence`: of the hub's first frame there."""

    skip: int
    sequence: int


def timed_bytes(link: Link) -> Iterator[TimedBytes]:
    """All bytes of a recording.

    Where arrival times mean nothing, pieces end with taxel frames and have the hub's time of reading. Raises what the
    link raises but for its end.
    """
    if has_arrivals(link) or isinstance(link, FramesLink):
        yield from _by_arrival(link)
    else:
        yield from _by_hub(link)


def _chunks(link: Link) -> Iterator[TimedBytes]:
    while True:
        try:
            chunk = link.read(0.0)
        except EOFError:
            return
        if chunk is not None:
            yield TimedBytes(chunk.data, chunk.arrival_ns * 1e-9)


def _by_arrival(link: Link) -> Iterator[TimedBytes]:
    yield from _chunks(link)


def _by_hub(link: Link) -> Iterator[TimedBytes]:
    decoder = StreamDecoder()
    begun = hub_us = 0
    time_s = 0.0
    for data, _ in _chunks(link):
        at = begun
        for batch in decoder.push(data):
            rows = batch.taxels
            for end, now_us in zip(rows["stream_position"].tolist(), rows["hub_time_us"].tolist(), strict=True):
                step = (now_us - hub_us + _WRAP_US // 2) % _WRAP_US - _WRAP_US // 2
                hub_us += step
                time_s = hub_us * 1e-6
                if begun <= end and at < end <= begun + len(data):
                    yield TimedBytes(data[at - begun : end - begun], time_s)
                    at = end
        if at < begun + len(data):
            yield TimedBytes(data[at - begun :], time_s)
        begun += len(data)


def beginning_of(link: Link, at_most: int = 1 << 22) -> Beginning | None:
    """Where the first taxel frame of a recording begins; None if none is in its first `at_most` bytes."""
    decoder = StreamDecoder()
    before = size = 0
    for data, _ in _chunks(link):
        size += len(data)
        for batch in decoder.push(data):
            others = batch.others["stream_position"].astype(np.int64)
            if len(batch.taxels):
                first = int(batch.taxels["stream_position"][0])
                earlier = others[others < first]
                before = int(earlier[-1]) if len(earlier) else before
                return Beginning(before, int(batch.taxels["sequence"][0]))
            before = int(others[-1]) if len(others) else before
        if size > at_most:
            return None
    return None
