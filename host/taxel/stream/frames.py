"""Decoded frames of a stream: taxel frames, and hub messages as named fields."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.stream.decoder import Batch
from taxel_protocol import FrameType
from taxel_protocol.frames import FRAMES
from taxel_protocol.layout import unpack


class TaxelFrame(NamedTuple):
    """One scan of one board.

    `raw_counts`: u16[n] in the board's taxel order (TX by TX, RX by RX); contact lowers a count. `time_s`: start of
    the scan, seconds on the host's clock (see `Skin.clock`). `cycle`: poll cycle of the hub; frames of the same cycle
    belong to the same skin frame. `sequence`: scan number of the board. `board_time_us`, `hub_time_us`: as sent, modulo
    2^32.
    """

    address: int
    cycle: int
    sequence: int
    time_s: float
    board_time_us: int
    hub_time_us: int
    raw_counts: NDArray[np.uint16]


class HubMessage(NamedTuple):
    """A decoded frame of a hub other than a taxel frame.

    `fields`: values by name as in `taxel_protocol.frames`; names of nested fields are joined by "_". `trailing_bytes`:
    bytes after the fields.
    """

    type: FrameType
    fields: dict[str, Any]
    trailing_bytes: bytes


def decode_messages(batch: Batch) -> list[HubMessage]:
    """Decode the hub messages of a batch, in stream order."""
    rows = batch.message_rows
    messages: list[HubMessage] = []
    if not len(rows):
        return messages
    for code, offset, size in zip(rows["type"].tolist(), rows["offset"].tolist(), rows["size"].tolist(), strict=True):
        kind = FrameType(code)
        fields, trailing_bytes = unpack(FRAMES[kind].payload, batch.payloads[offset : offset + size])
        messages.append(HubMessage(kind, fields, trailing_bytes))
    return messages


def build_taxel_frames(batch: Batch, rows: NDArray[np.void], times_s: NDArray[np.float64]) -> list[TaxelFrame]:
    """Build the taxel frames of k rows of `batch.taxel_rows`, each of which has counts.

    `times_s`: f64[k], scan starts, seconds on the host's clock.
    """
    counts = batch.counts
    starts = rows["offset"].tolist()
    ends = (rows["offset"] + rows["size"]).tolist()
    parts = [counts[start:end] for start, end in zip(starts, ends, strict=True)]
    columns = [rows[name].tolist() for name in ("address", "cycle", "board_sequence")]
    clocks = [rows[name].tolist() for name in ("board_time_us", "hub_time_us")]
    return list(map(TaxelFrame._make, zip(*columns, times_s.tolist(), *clocks, parts, strict=True)))
