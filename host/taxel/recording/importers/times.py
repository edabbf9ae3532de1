"""Recognition of the field with the times, and of its unit."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.recording.importers.fields import Field, Source
from taxel.recording.importers.mapping import Times
from taxel.recording.importers.source_ros import RECORD_TIME

_NAMES: Final = (
    re.compile(r"(.*[.:])?header\.stamp"),
    re.compile(r"time(_?s(ec(onds)?)?)?|timestamps?(_?s)?|t(_?s)?", re.IGNORECASE),
    re.compile(r"(.*[_/ .])?(time|timestamps?|stamp|seconds)([_ /\[(]*(s|sec|ms|us|ns)[\])]?)?", re.IGNORECASE),
    re.compile(rf".*:{RECORD_TIME}"),
)
"""Patterns of field names that indicate times, the most certain pattern first."""

_LARGEST_STEP: Final = (("s", 0.5), ("ms", 500.0), ("us", 5e5), ("ns", np.inf))
"""Largest median step between two frames in each unit. Origin: tactile sensors have rates from 2 Hz to 1 kHz, which
give steps below 0.5 s, and of 1 to 500 ms, 1e3 to 5e5 us and 1e6 to 5e8 ns. Times of a slower sensor in seconds would
be taken as milliseconds.
"""


def rank_time_name(name: str) -> int:
    """Return how certainly a field name indicates times: the index of its pattern in `_NAMES`, 0 for the most certain.

    A name that matches no pattern gets the number of patterns.
    """
    ranks = (rank for rank, pattern in enumerate(_NAMES) if pattern.fullmatch(name))
    return next(ranks, len(_NAMES))


def is_increasing(array: NDArray[Any]) -> bool:
    """Whether an array is finite and increases from entry to entry in more than half of its steps.

    Single decreases are permitted, because times may start again at 0 in each contact.
    """
    steps = np.diff(array.ravel().astype(np.float64))
    return len(steps) > 0 and bool(np.isfinite(steps).all()) and bool((steps > 0).mean() > 0.5)


def find_time(source: Source, frames: int, near: str = "", candidates: Iterable[Field] | None = None) -> Field | None:
    """Return the field that most probably contains the times of `frames` frames; None if there is none.

    near: name of a field, such as that of the values; if it belongs to a ROS topic, only fields of this topic with a
    name of a time are considered. candidates: fields to choose from; None: all.
    """
    topic = near.partition(":")[0] if ":" in near else ""
    best: tuple[int, Field] | None = None
    for field in source.fields.values() if candidates is None else candidates:
        if not field.is_numeric or field.shape not in ((frames,), (frames, 1)):
            continue
        if topic and not field.name.startswith(f"{topic}:"):
            continue
        rank = rank_time_name(field.name)
        if (best is None or rank < best[0]) and (rank < len(_NAMES) or not topic) and is_increasing(field.load()):
            best = (rank, field)
    return None if best is None else best[1]


def guess_unit(name: str, array: NDArray[Any]) -> str:
    """Return the unit of times (key of `TIME_UNITS`): from a name such as time_ms, else from the median step."""
    match = re.search(r"[_ /\[(](s|sec|ms|us|ns)[\])]?$", name, re.IGNORECASE)
    if match is not None:
        return "s" if match[1].lower() == "sec" else match[1].lower()
    steps = np.diff(array.ravel()[:10_000]).astype(np.float64)
    positive = steps[np.isfinite(steps) & (steps > 0)]
    step = float(np.median(positive)) if len(positive) else 0.0
    return next(unit for unit, largest in _LARGEST_STEP if step <= largest)


def find_times(source: Source, frames: int, unit: str | None, rate_hz: float | None) -> Times:
    """Return the field and unit of the times in a file of a known layout, or the given frame rate.

    unit: declared unit; None: inferred. rate_hz: frame rate that replaces the file's times; None: the times are used.
    Raises DatasetError if the file has no times and no rate is given.
    """
    if rate_hz is not None:
        return Times(rate_hz=rate_hz)
    field = find_time(
        source, frames, candidates=[f for f in source.fields.values() if rank_time_name(f.name) < len(_NAMES)]
    )
    if field is None:
        remedy = "add the field, or give the frame rate with --rate-hz"
        source.at("time").fail(f"a field time with {frames} increasing entries", "none", remedy)
    return Times(field.name, unit or guess_unit(field.name, field.load()))
