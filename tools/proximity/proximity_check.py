"""One skin of the check: its calibration, and approaches in other worlds, whose true distances the estimator never
reads.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from proximity_frames import iterate_arrivals
from proximity_sampling import Plan, SkinParts, plan_approaches, sample_skin

from taxel.emulated.calibration_stage import record_calibration
from taxel.emulated.target_stage import TrueDistance, record_target_motions
from taxel.hand import Hand, load_hand
from taxel.hand.world import WorldSettings
from taxel.proximity import ProximityCalibration, ProximityEstimate, ProximityWatch, calibrate, collect_holds
from taxel.proximity.calibration_merge import merge_calibrations
from taxel.proximity.watch import WARNING_PROBABILITY
from taxel.skin import open_skin

HAND = "original"
RANGE_M = (0.0005, 0.005)
"""Distances at which the error is scored."""

PREDICTED_SPEED_M_S = 0.05
RELEASE_SHARE = 0.5
"""A warning ends when the probability falls below this share of its limit."""

AFTER_S = 0.15
"""Time after the horizon within which a contact still confirms a warning."""


@dataclass(frozen=True)
class Approach:
    """Score of one approach.

    warnings: number of predicted contacts that did not follow. lead_s: time from the warning to the contact; None
    without one of them. errors_m: estimated minus true distance of each frame in range. covered: for each of these
    frames, whether the interval contains the true distance. missing: number of frames in range without an estimate.
    named: names that the estimator gave to the target, for each frame in range.
    """

    target: str
    board_kind: str
    kind: str
    shape: str
    speed_m_s: float
    has_contact: bool
    warnings: int
    lead_s: float | None
    errors_m: tuple[float, ...]
    covered: tuple[bool, ...]
    missing: int
    named: tuple[str, ...]


@dataclass(frozen=True)
class SkinResult:
    """Scores of one skin.

    idle_warnings: number of warnings outside all approaches. idle_s: time outside all approaches, summed over the
    boards.
    """

    approaches: tuple[Approach, ...]
    idle_warnings: int
    idle_s: float


@dataclass(frozen=True)
class Task:
    """Work of one process.

    seed, number: seed of the run and number of the skin. worlds: number of worlds of each group. approaches: per world.
    """

    seed: int
    number: int
    worlds: int
    approaches: int


def run_skin(task: Task) -> SkinResult:
    """Calibrate one skin, and score the estimator in worlds with other seeds.

    Each of the `task.worlds` groups consists of a world with random speeds and a world with `PREDICTED_SPEED_M_S`. Two
    more worlds test the recognition of the target.
    """
    rng = np.random.default_rng([task.seed, task.number])
    hand, skin = load_hand(HAND), sample_skin(rng)
    with tempfile.TemporaryDirectory(prefix="taxel-") as name:
        folder = Path(name)
        grounded = calibrate_skin(folder, hand, skin, "grounded", rng)
        both = merge_calibrations(grounded, calibrate_skin(folder, hand, skin, "acrylic", rng))
        results = []
        for _ in range(task.worlds):
            results.append(
                run_world(folder, hand, skin, "grounded", grounded, ("contact", "stop", "hold"), None, task, rng)
            )
            kinds = ("contact", "contact", "stop", "pass")
            results.append(run_world(folder, hand, skin, "grounded", grounded, kinds, PREDICTED_SPEED_M_S, task, rng))
        for target in ("grounded", "acrylic"):
            results.append(
                run_world(folder, hand, skin, target, both, ("contact", "hold"), None, task, rng, named=True)
            )
    approaches = tuple(approach for result in results for approach in result.approaches)
    return SkinResult(approaches, sum(each.idle_warnings for each in results), sum(each.idle_s for each in results))


def calibrate_skin(
    folder: Path, hand: Hand, skin: SkinParts, target: str, rng: np.random.Generator
) -> ProximityCalibration:
    """Record a calibration session on one board of each kind and return the calibration of all board kinds.

    folder: place of the capture, which is deleted at the end. target: the calibrated target, "grounded" or "acrylic".
    """
    boards = list({board.kind.name: board.name for board in hand.boards}.values())
    effects = skin.format_effects(target, rng)
    settings = WorldSettings(seed=int(rng.integers(1 << 31)), parts_seed=skin.parts_seed, effects=effects)
    capture = folder / "calibration.bin"
    holds = record_calibration(capture, hand, boards, target, settings)
    with open_skin(f"file:{capture}", hand) as opened:
        counts = collect_holds(opened, hand, holds)
    capture.unlink()
    return calibrate(hand, counts)


def run_world(
    folder: Path,
    hand: Hand,
    skin: SkinParts,
    target: str,
    calibration: ProximityCalibration,
    kinds: tuple[str, ...],
    speed_m_s: float | None,
    task: Task,
    rng: np.random.Generator,
    named: bool = False,
) -> SkinResult:
    """Record one world with random approaches, run the estimator on its frames, and score its estimates.

    target: "grounded" or "acrylic". calibration: calibration that the estimator uses. kinds: kinds of approach to
    choose from. speed_m_s: speed of all approaches; None: random. named: whether the recognition of the target is
    scored.
    """
    plan = plan_approaches(hand, [board.name for board in hand.boards], task.approaches, rng, kinds, speed_m_s)
    effects = skin.format_effects(target, rng)
    settings = WorldSettings(seed=int(rng.integers(1 << 31)), parts_seed=skin.parts_seed, effects=effects)
    capture = folder / "world.bin"
    motions = [approach.motion for approach in plan.approaches]
    truths = record_target_motions(capture, hand, plan.shapes, motions, plan.duration_s, settings)
    watch = ProximityWatch(hand, calibration)
    estimates: dict[str, list[tuple[ProximityEstimate, float]]] = {board.name: [] for board in hand.boards}
    for frame, arrival_s in iterate_arrivals(capture, hand):
        estimate = watch.take(frame, arrival_s)
        if estimate is not None:
            estimates[estimate.board].append((estimate, arrival_s))
    capture.unlink()
    return score_world(hand, plan, truths, estimates, target if named else "")


def score_world(
    hand: Hand,
    plan: Plan,
    truths: list[TrueDistance],
    estimates: dict[str, list[tuple[ProximityEstimate, float]]],
    target: str,
) -> SkinResult:
    """Compare the estimates of one world with the true distances.

    truths: true distances during each approach of the plan. estimates: (estimate, arrival time in seconds) of each
    frame, by board. target: name of the target if its recognition is scored; otherwise "".

    A warning is a predicted contact (`find_warnings`). A warning is false if no contact follows, or if it ends more
    than `AFTER_S` before the contact. A warning that begins outside the approaches to its board is an idle warning.
    """
    warnings = [(name, *times) for name, rows in estimates.items() for times in find_warnings(rows)]
    used: set[tuple[str, float, float]] = set()
    approaches = []
    for planned, truth in zip(plan.approaches, truths, strict=True):
        begin, end = truth.time_s[0], truth.time_s[-1]
        of_board = [each for each in warnings if each[0] == truth.board and begin <= each[1] <= end]
        used.update(of_board)
        touched = np.flatnonzero(truth.distance_m <= 0.0)
        contact_s = float(truth.time_s[touched[0]]) if len(touched) else None
        before = [each[1] for each in of_board if contact_s is not None and each[1] <= contact_s]
        # A warning predicts the contact if it ends at most AFTER_S before the contact, or later.
        confirmed = [
            each
            for each in of_board
            if contact_s is not None and contact_s - each[2] <= AFTER_S and each[1] <= contact_s
        ]
        false = [each for each in of_board if each not in confirmed and (contact_s is None or each[1] < contact_s)]
        rows = [
            each
            for each, _ in estimates[truth.board]
            if begin <= each.time_s <= (end if contact_s is None else contact_s)
        ]
        in_range = list(_select_range(rows, truth))
        known = [(estimate, true) for estimate, true in in_range if estimate.distance_m is not None]
        ranges = [(estimate.distance_m, true) for estimate, true in known if estimate.distance_m is not None]
        approaches.append(
            Approach(
                target=target,
                board_kind=hand.find_board(truth.board).kind.name,
                kind=planned.kind,
                shape=planned.shape,
                speed_m_s=planned.speed_m_s,
                has_contact=contact_s is not None,
                warnings=len(false),
                lead_s=contact_s - confirmed[0][1] if contact_s is not None and confirmed and before else None,
                errors_m=tuple(value.median - true for value, true in ranges),
                covered=tuple(value.low <= true <= value.high for value, true in ranges),
                missing=len(in_range) - len(known),
                named=tuple(estimate.target or "" for estimate, _ in known),
            )
        )
    idle = plan.duration_s * len(estimates) - sum(truth.time_s[-1] - truth.time_s[0] for truth in truths)
    return SkinResult(tuple(approaches), len(set(warnings) - used), float(idle))


def _select_range(rows: list[ProximityEstimate], truth: TrueDistance) -> Iterator[tuple[ProximityEstimate, float]]:
    """Yield each estimate whose true distance is in the scored range, with this distance in metres."""
    # An infinite distance becomes 1 m, which is outside the scored range: np.interp requires finite values.
    finite = np.where(np.isfinite(truth.distance_m), truth.distance_m, 1.0)
    for estimate in rows:
        true = float(np.interp(estimate.time_s, truth.time_s, finite))
        if RANGE_M[0] <= true <= RANGE_M[1]:
            yield estimate, true


def find_warnings(rows: list[tuple[ProximityEstimate, float]]) -> list[tuple[float, float]]:
    """Return two arrival times for each warning of one board: of its first and its last frame above the threshold.

    rows: (estimate, arrival time in seconds) of each frame. A warning begins when the probability of a contact soon
    exceeds the threshold `WARNING_PROBABILITY`. The warning ends when this probability falls below `RELEASE_SHARE`
    times the threshold; a later frame above the threshold begins a new warning.
    """
    found: list[tuple[float, float]] = []
    first: float | None = None
    last = 0.0
    for estimate, arrival_s in rows:
        if estimate.contact > 0.5 and first is None:
            continue  # a contact that was not predicted
        if estimate.contact_soon > WARNING_PROBABILITY:
            first = arrival_s if first is None else first
            last = arrival_s
        elif first is not None and estimate.contact_soon < RELEASE_SHARE * WARNING_PROBABILITY:
            found.append((first, last))
            first = None
    if first is not None:
        found.append((first, last))
    return found
