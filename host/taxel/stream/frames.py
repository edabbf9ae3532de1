"""What comes out of a stream: taxel frames, and the hub's messages as named fields."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.stream.decoder import Batch
from taxel_protocol import FrameType
from taxel_protocol.frames import FRAMES
from taxel_protocol.layout import unpack


class TaxelFrame(NamedTuple):
    """One board's snapshot.

    `raw_counts` u16[n] in the board's taxel order (TX by TX, RX by RX); contact lowers a count. `time_s`: when the
    scan began, on the host's clock (seconds; see `Skin.clock`). `cycle`: the hub's poll cycle; the frames of one
    cycle show the skin at one time. `sequence`: the board's scan number. `board_time_us`, `hub_time_us`: as sent,
    modulo 2^32.
    """

    address: int
    cycle: int
    sequence: int
    time_s: float
    board_time_us: int
    hub_time_us: int
    raw_counts: NDArray[np.uint16]


class HubMessage(NamedTuple):
    """Any other frame: `fields` by flat name as in taxel_protocol.frames, and the bytes after them."""

    type: FrameType
    fields: dict[str, Any]
    tail: bytes


def messages_of(batch: Batch) -> list[HubMessage]:
    """The hub's messages in a batch, in order."""
    rows = batch.others
    messages: list[HubMessage] = []
    if not len(rows):
        return messages
    for code, offset, size in zip(rows["type"].tolist(), rows["offset"].tolist(), rows["size"].tolist(), strict=True):
        kind = FrameType(code)
        fields, tail = unpack(FRAMES[kind].payload, batch.payloads[offset : offset + size])
        messages.append(HubMessage(kind, fields, tail))
    return messages


def taxel_frames_of(batch: Batch, rows: NDArray[np.void], times_s: NDArray[np.float64]) -> list[TaxelFrame]:
    """Taxel frames of `rows` (rows of the batch's `taxels` that have counts), which began at `times_s` [k] seconds."""
    counts = batch.counts
    starts = rows["offset"].tolist()
    ends = (rows["offset"] + rows["size"]).tolist()
    parts = [counts[start:end] for start, end in zip(starts, ends, strict=True)]
    columns = [rows[name].tolist() for name in ("address", "cycle", "board_sequence")]
    clocks = [rows[name].tolist() for name in ("board_time_us", "hub_time_us")]
    return list(map(TaxelFrame._make, zip(*columns, times_s.tolist(), *clocks, parts, strict=True)))
