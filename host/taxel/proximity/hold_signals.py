"""Frames of each hold, and the signals of targets relative to the intervals without a target before and after them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from taxel.hand import Hand
from taxel.proximity.errors import ProximityError
from taxel.proximity.holds import REST, Hold
from taxel.stream import TaxelFrame
from taxel.types import FloatArray

MIN_FRAMES = 10
"""Smallest number of frames in a hold. With white noise of 4 counts, the mean of 10 frames has a standard error of 1.3
counts."""


@dataclass(frozen=True, eq=False)
class HoldCounts:
    """The T frames of one hold of a board with n taxels. time_s: f64[T], seconds. raw_counts: f64[T, n]."""

    hold: Hold
    time_s: FloatArray
    raw_counts: FloatArray

    @property
    def middle_s(self) -> float:
        """Mean time of the frames, seconds."""
        return float(self.time_s.mean())


@dataclass(frozen=True, eq=False)
class HeldSignal:
    """Mean signals of a board while a target rests at a known distance.

    board, target: names. signal_counts: f64[n], baseline minus raw count. frames: number of averaged frames.
    """

    board: str
    target: str
    distance_m: float
    signal_counts: FloatArray
    frames: int


def collect_holds(frames: Iterable[TaxelFrame], hand: Hand, holds: Sequence[Hold]) -> list[HoldCounts]:
    """Collect the frames of a recording that belong to each hold; the result has the order of `holds`.

    Raises `ProximityError` for a hold with fewer than `MIN_FRAMES` frames.
    """
    by_address: dict[int, list[tuple[int, Hold]]] = {}
    for index, hold in enumerate(holds):
        by_address.setdefault(hand.find_board(hold.board).address, []).append((index, hold))
    arrived: list[list[TaxelFrame]] = [[] for _ in holds]
    for frame in frames:
        for index, hold in by_address.get(frame.address, ()):
            if hold.start_s <= frame.time_s < hold.end_s:
                arrived[index].append(frame)
    return [make_hold_counts(hold, kept) for hold, kept in zip(holds, arrived, strict=True)]


def make_hold_counts(hold: Hold, frames: Sequence[TaxelFrame]) -> HoldCounts:
    """Combine the frames of one hold. Raises `ProximityError` for fewer than `MIN_FRAMES` frames."""
    if len(frames) < MIN_FRAMES:
        place = REST if hold.distance_m is None else f"hold at {1e3 * hold.distance_m:g} mm"
        raise ProximityError(
            f"{hold.board}: {place} from {hold.start_s:g} s to {hold.end_s:g} s: expected at least {MIN_FRAMES} "
            f"frames, found {len(frames)}; check the times of the holds and the connection of the board"
        )
    times = np.array([frame.time_s for frame in frames])
    return HoldCounts(hold, times, np.array([frame.raw_counts for frame in frames], dtype=np.float64))


def compute_held_signals(counts: Sequence[HoldCounts]) -> list[HeldSignal]:
    """Compute the signal of each hold with a target.

    The baseline is interpolated in time between the holds without a target (rests) of the same board, so that a linear
    drift between two rests has no influence. Raises `ProximityError` for a board without a rest.
    """
    signals = []
    for each in counts:
        if each.hold.distance_m is None:
            continue
        rests = [rest for rest in counts if rest.hold.distance_m is None and rest.hold.board == each.hold.board]
        if not rests:
            raise ProximityError(
                f"{each.hold.board}: expected a rest before the held distances, found none; add a line with the target "
                f"'rest', during which nothing is near the board"
            )
        baseline = _interpolate_baseline(rests, each.middle_s)
        signal = baseline - each.raw_counts.mean(axis=0)
        signals.append(HeldSignal(each.hold.board, each.hold.target, each.hold.distance_m, signal, len(each.time_s)))
    return signals


def _interpolate_baseline(rests: Sequence[HoldCounts], time_s: float) -> FloatArray:
    """Interpolate the mean raw counts f64[n] of holds without a target at a time.

    Before the first and after the last of these holds, the mean counts of the nearest one are returned.
    """
    in_order = sorted(rests, key=lambda rest: rest.middle_s)
    times = np.array([rest.middle_s for rest in in_order])
    means = np.array([rest.raw_counts.mean(axis=0) for rest in in_order])
    after = int(np.searchsorted(times, time_s))
    if after in (0, len(times)):
        return np.asarray(means[min(after, len(times) - 1)])
    share = (time_s - times[after - 1]) / (times[after] - times[after - 1])
    return np.asarray(means[after - 1] + share * (means[after] - means[after - 1]))
