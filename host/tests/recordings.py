"""What tests of recordings share: frames of a recording in any form, and how two differ."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from taxel.hand import Hand
from taxel.recording.forms import open_recording
from taxel.skin import Skin
from taxel.stream import LossAccount, TaxelFrame

ALL = ("address", "cycle", "sequence", "time_s", "board_time_us", "hub_time_us", "raw_counts")
KEPT = ("address", "cycle", "sequence", "board_time_us", "raw_counts")
"""What every table of frames keeps to the last bit; times are kept to the microsecond."""


class Recorded(NamedTuple):
    """A capture, its frames, and the hand."""

    path: Path
    frames: list[TaxelFrame]
    losses: LossAccount
    hand: Hand


def frames_in(path: Path, hand: Hand | None = None) -> tuple[list[TaxelFrame], LossAccount]:
    """All frames of a recording in any form."""
    link, own = open_recording(path, hand)
    with Skin(link, own) as skin:
        return list(skin), skin.losses


def differences(a: list[TaxelFrame], b: list[TaxelFrame], *names: str) -> list[str]:
    """Which of the named fields are not the same in all frames of two recordings."""
    if len(a) != len(b):
        return [f"{len(a)} and {len(b)} frames"]
    return [
        name
        for name in names
        if not all(np.array_equal(getattr(x, name), getattr(y, name)) for x, y in zip(a, b, strict=True))
    ]
