"""Helpers for tests of recordings: read the frames of a recording in any format, and compare two lists of frames."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from taxel.hand import Hand
from taxel.recording.formats import open_recording
from taxel.skin import Skin
from taxel.stream import LossAccount, TaxelFrame

ALL_FIELDS = ("address", "cycle", "sequence", "time_s", "board_time_us", "hub_time_us", "raw_counts")
TABLE_FIELDS = ("address", "cycle", "sequence", "board_time_us", "raw_counts")
"""Fields that a table of frames keeps exactly. Times are kept to the microsecond."""


class RecordedSkin(NamedTuple):
    """A capture file, the frames and losses that it contains, and the hand."""

    path: Path
    frames: list[TaxelFrame]
    losses: LossAccount
    hand: Hand


def read_frames(path: Path, hand: Hand | None = None) -> tuple[list[TaxelFrame], LossAccount]:
    """Return all frames of a recording in any format, and its losses. hand: None: the hand of the recording."""
    link, recorded_hand = open_recording(path, hand)
    with Skin(link, recorded_hand) as skin:
        return list(skin), skin.losses


def find_differing_fields(a: list[TaxelFrame], b: list[TaxelFrame], *names: str) -> list[str]:
    """Return those of the named fields that differ in at least one frame of two recordings.

    If the recordings have different numbers of frames, return one text with both numbers instead.
    """
    if len(a) != len(b):
        return [f"{len(a)} and {len(b)} frames"]
    return [
        name
        for name in names
        if not all(np.array_equal(getattr(x, name), getattr(y, name)) for x, y in zip(a, b, strict=True))
    ]
