"""The reference of a skin: its rest state, and the contacts of a reference session by condition."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from taxel.recording.grasp import Grasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import Phase
from taxel.recording.grasp_tables import SensorTable, TaxelTable
from taxel.signal.rest_level import RestLevel, estimate_settings
from taxel.twin.errors import TwinInputError
from taxel.twin.live_session import LiveSession
from taxel.twin.noise_level import ROUNDING, NoiseLevel
from taxel.twin.places import Places
from taxel.twin.schedule import Condition, Contact, ContactSchedule
from taxel.twin.steps import BEFORE, BINS, HOLD, REST, Step, StepBuilder, find_bin_position
from taxel.types import FloatArray, IntArray

PRIOR_DEGREES_OF_FREEDOM: Final = 6.0
"""Weight of the variance that all conditions share in the estimated variance of one condition, as degrees of freedom.
For a condition with seven repeats (six degrees of freedom), the condition's variance and the shared variance have equal
weight (chosen; the scale of every statistic is fitted afterwards, see `null_model.py`)."""

LEAST_REPEATS: Final = 3
"""Smallest number of repeats of a condition for which its contacts are tested. With fewer repeats the contacts are only
shown, because no variance is known."""

NEIGHBOUR_PITCHES: Final = 1.6
"""Largest distance of a taxel's neighbours, in pitches (distance of adjacent taxels): the eight taxels around it."""


@dataclass(frozen=True, eq=False)
class ConditionReference:
    """Statistics of the contacts of one condition in the reference, for each time bin (BINS) and each of n taxels.

    mean: f64[BINS, n], mean signal, counts. squares: f64[BINS, n], sum of the squared deviations from the mean.
    repeats: number of contacts. scale: f64[BINS, n], counts: sum of the largest mean signal among a taxel and its
    neighbours and of the mean signal's change to the adjacent bins. Deviations caused by position, force and time are
    proportional to this scale.
    """

    mean: FloatArray
    squares: FloatArray
    repeats: float
    scale: FloatArray


@dataclass(frozen=True, eq=False)
class Reference:
    """State without contact, and contacts, of a healthy skin with n taxels and s boards.

    taxels, sensors, places: tables and places of the skin. rest: f64[n], mean raw count without contact.
    noise_variance: f64[n], noise variance of one frame, counts^2. conditions: statistics of the contacts, by condition.
    relative_variance: f64[BINS], variance of a signal relative to the square of `ConditionReference.scale`.
    session_ratio: f64[BINS], variance between sessions relative to the variance within a session; 0 for one session.
    missing: f64[s, 2], numbers of missing and expected frames. steps: session number and frame sums of each contact, in
    order of time. baseline_s: median length of the interval before a contact, seconds. rest_level: model of the drift
    without contact. noise_level: sums from which the noise variance follows.
    """

    taxels: TaxelTable
    sensors: SensorTable
    places: Places
    rest: FloatArray
    noise_variance: FloatArray
    conditions: Mapping[Condition, ConditionReference]
    relative_variance: FloatArray
    session_ratio: FloatArray
    missing: FloatArray
    steps: tuple[tuple[int, Step], ...]
    baseline_s: float
    rest_level: RestLevel
    noise_level: NoiseLevel

    def has_variance(self, known: ConditionReference) -> bool:
        """Whether the variance of a condition's contacts is known, so that its contacts are tested."""
        return known.repeats >= LEAST_REPEATS

    def expect(self, step: Step) -> ConditionReference | None:
        """Return the statistics of a step's condition; None without a contact, or for an unknown condition."""
        return self.conditions.get(step.contact.condition) if step.contact is not None else None

    def expect_frame(
        self, live: LiveSession, contact: Contact, time_s: float, measured: FloatArray
    ) -> tuple[FloatArray, FloatArray] | None:
        """Predict the signals of one frame of a contact: f64[n], counts, and their variance without noise, f64[n].

        live: earlier contacts of the session. measured: f64[n], signals of the frame, counts, which only a subclass
        uses; NaN: not measured. Returns None for an unknown condition.
        """
        known = self.conditions.get(contact.condition)
        if known is None:
            return None
        mean, _ = live.predict(contact.condition, known.mean, known.repeats)
        position = find_bin_position(contact, time_s)
        low = int(np.clip(np.floor(position), 0, len(mean) - 2))
        share = float(np.clip(position - low, 0.0, 1.0))
        predicted = (1.0 - share) * mean[low] + share * mean[low + 1]
        return predicted, np.asarray(self.relative_variance[low] * known.scale[low] ** 2)

    def leave_out(self, step: Step) -> Reference:
        """Return a reference that contains only the condition of a contact, with the statistics of its other repeats.

        step: a contact of this reference. The reference is returned unchanged for a step without contact, and for a
        condition with a single repeat.
        """
        known = self.expect(step)
        if step.contact is None or known is None or known.repeats < 2:
            return self
        # Without a value with the deviation d, the mean of K values changes by -d / (K - 1), and the sum of the squared
        # deviations by -d^2 K / (K - 1).
        deviation = np.nan_to_num(compute_signals(step)) - known.mean
        others = known.repeats - 1
        others_only = ConditionReference(
            known.mean - deviation / others,
            np.maximum(known.squares - deviation**2 * known.repeats / others, 0.0),
            others,
            known.scale,
        )
        return replace(self, conditions={step.contact.condition: others_only})

    def compute_variance(self, known: ConditionReference, step: Step) -> FloatArray:
        """Compute the variance of a contact's signals about the true mean of its condition, f64[BINS, n], counts^2.

        The variance between contacts is a weighted mean of the variance of this condition and of the variance that all
        conditions share, relative to their scale. known: statistics of the condition. step: the contact; its numbers of
        averaged frames determine the part of the variance that is noise.
        """
        shared = PRIOR_DEGREES_OF_FREEDOM * self.relative_variance[:, None] * known.scale**2
        between = (shared + known.squares) / (PRIOR_DEGREES_OF_FREEDOM + known.repeats - 1)
        return np.asarray(between + self.compute_noise(step))

    def compute_noise(self, step: Step) -> FloatArray:
        """Compute the noise variance of a step's signals, f64[BINS, n], counts^2; infinite for a bin without frames."""
        with np.errstate(divide="ignore"):
            return np.asarray(self.noise_variance * (1.0 / step.count + 1.0 / step.count[BEFORE]))


def compute_signals(step: Step) -> FloatArray:
    """Compute the signal of each time bin, f64[BINS, n]: mean raw count before the contact minus mean count of the bin.

    Bins without a valid frame are NaN.
    """
    means = step.compute_means()
    return np.asarray(means[BEFORE] - means)


def read_reference(path: str | PathLike[str]) -> Reference:
    """Learn a reference from a grasp dataset of version 1. Raises DatasetError and TwinInputError with a one-line
    message.
    """
    with GraspDataset(path) as data:
        steps = [
            (grasp.session, make_step(grasp, data.sensors.index_of(data.taxels), data.sensors.s)) for grasp in data
        ]
        return learn_reference(data.taxels, data.sensors, steps, str(path))


def make_step(grasp: Grasp, taxel_board: IntArray, boards: int) -> Step:
    """Sum the frames of one grasp of a dataset. taxel_board: i64[n], index of each taxel's board. boards: number of
    boards.
    """
    contact = find_contact(grasp)
    builder = StepBuilder(ContactSchedule([contact]), taxel_board, boards)
    done = builder.take(grasp.timestamp, grasp.raw_counts, grasp.valid)
    after = np.array([contact.end_s])  # a frame after the contact completes its step
    done += builder.take(after, grasp.raw_counts[-1:], np.zeros_like(grasp.valid[-1:]))
    return next(step for step in done if step.contact is not None)


def find_contact(grasp: Grasp) -> Contact:
    """Return the times of a grasp's phases as a contact.

    Raises TwinInputError if the first frame is not in the baseline phase, if a phase number decreases, or if there is
    no hold phase.
    """
    place = f"/grasps/{grasp.id}/phase"
    phase, time_s = grasp.phase.astype(np.int64), grasp.timestamp
    if (np.diff(phase) < 0).any() or not (phase == Phase.HOLD).any() or phase[0] != Phase.BASELINE:
        raise TwinInputError(place, "baseline, closing and hold in this order", "another order", "leave the grasp out")
    period = float(np.median(np.diff(time_s)))
    end = float(time_s[-1]) + period
    starts = [
        float(time_s[np.flatnonzero(phase >= number)[0]]) if (phase >= number).any() else end
        for number in (Phase.CLOSING, Phase.HOLD, Phase.RELEASE, Phase.RECOVERY)
    ]
    return Contact((starts[0], starts[1], starts[2], starts[3], end), (grasp.object, grasp.approach))


def learn_reference(
    taxels: TaxelTable, sensors: SensorTable, steps: Sequence[tuple[int, Step]], name: str
) -> Reference:
    """Learn the reference of a healthy skin from recorded contacts; `Twin` compares later contacts with it.

    The reference contains counts and noise without contact, and mean and variance of the signals of each condition
    (object and approach). steps: session number and step (frame sums), in order of time; steps without a contact
    (`contact` is None) are not used. name: name of the source in messages. Raises TwinInputError if no condition has at
    least `LEAST_REPEATS` repeats.
    """
    contacts = [(session, step) for session, step in steps if step.contact is not None]
    near = find_neighbours(taxels, sensors.index_of(taxels))
    pairs = np.sum([step.pairs for _, step in contacts], axis=0)
    squares = np.sum([step.squared_difference for _, step in contacts], axis=0)
    # The difference of two frames has twice the noise variance of one frame.
    noise = squares / np.maximum(2 * pairs, 1) + ROUNDING
    counts = sum((step.count[REST] for _, step in contacts), np.zeros(taxels.n, np.int64))
    totals = sum((step.total[REST] for _, step in contacts), np.zeros(taxels.n, np.int64))
    by_condition: dict[Condition, list[tuple[int, FloatArray]]] = {}
    for session, step in contacts:
        if step.contact is not None:
            by_condition.setdefault(step.contact.condition, []).append((session, compute_signals(step)))
    conditions = {key: _learn_condition(signals, near) for key, signals in sorted(by_condition.items())}
    tested = {key: one for key, one in conditions.items() if one.repeats >= LEAST_REPEATS}
    if not tested:
        raise TwinInputError(
            f"{name}: /grasps",
            f"a condition (object, approach) with at least {LEAST_REPEATS} repeats",
            f"{len(contacts)} contacts of {len(conditions)} conditions",
            "record more repeats",
        )
    received = sum((step.received for _, step in contacts), np.zeros(sensors.s, np.int64))
    expected = sum((step.expected for _, step in contacts), np.zeros(sensors.s, np.int64))
    mean_noise = compute_mean_noise(noise, [step for _, step in contacts])
    baselines_s = [step.contact.start_s - step.start_s for _, step in contacts if step.contact is not None]
    return Reference(
        taxels=taxels,
        sensors=sensors,
        places=Places.of(taxels, sensors),
        rest=np.asarray(totals / np.maximum(counts, 1)),
        noise_variance=np.asarray(noise),
        conditions=conditions,
        relative_variance=compute_relative_variance(tested.values(), mean_noise),
        session_ratio=_compute_session_ratio([by_condition[key] for key in tested]),
        missing=np.column_stack([expected - received, expected]).astype(np.float64),
        steps=tuple(contacts),
        baseline_s=float(np.median(baselines_s)),
        rest_level=_learn_rest(contacts, RestLevel.start(np.asarray(noise), sensors.index_of(taxels))),
        noise_level=NoiseLevel(squares=squares.astype(np.float64), pairs=pairs.astype(np.float64)),
    )


def _learn_rest(contacts: Sequence[tuple[int, Step]], level: RestLevel) -> RestLevel:
    """Learn the drift of the counts without contact from all contacts, in order of time; return the learnt model.

    A first pass learns the loadings (response of each taxel to the drift of its board). In a second pass, the changes
    from step to step, minus the common change of the board, give the variances. level: initial model, changed in place.
    """
    _follow_rest(contacts, level)
    second = RestLevel(level.noise_variance, level.board, level.loading.copy(), level.loading_variance.copy())
    second.settings = estimate_settings(*_follow_rest(contacts, second, is_naive=True))
    return second


def _follow_rest(
    contacts: Sequence[tuple[int, Step]], level: RestLevel, is_naive: bool = False
) -> tuple[list[FloatArray], list[FloatArray], list[FloatArray]]:
    """Update `level` with every step; return prediction errors, noise variances of the means, and common changes.

    Each list has one array for each step but the first of a session: f64[n], counts (NaN: unknown); f64[n], counts^2;
    f64[s], change that all taxels of a board share, counts. is_naive: the counts of every step replace the tracked
    counts, so that the errors are changes from step to step.
    """
    errors: list[FloatArray] = []
    noise: list[FloatArray] = []
    common: list[FloatArray] = []
    last = None
    all_taxels = np.ones(len(level.board), dtype=bool)
    for session, step in contacts:
        if session != last:
            level.forget(all_taxels)
        known = level.is_known
        mean, _ = step.compute_rest()
        error, _ = level.update(mean, step.count[REST], ~np.isfinite(mean))
        if is_naive:
            level.level = np.where(np.isfinite(mean), mean, level.level)
        if session == last:
            errors.append(np.where(known & np.isfinite(mean), error, np.nan))
            noise.append(level.noise_variance / np.maximum(step.count[REST], 1))
            common.append(level.common)
        last = session
    return errors, noise, common


def _learn_condition(signals: Sequence[tuple[int, FloatArray]], near: list[IntArray]) -> ConditionReference:
    """Compute the statistics of the contacts of a condition.

    signals: session number and signals f64[BINS, n] of each contact. near: for each taxel, the indices of its
    neighbours and of the taxel itself.
    """
    values = np.stack([np.nan_to_num(value) for _, value in signals])
    mean = values.mean(axis=0)
    return ConditionReference(mean, ((values - mean) ** 2).sum(axis=0), len(signals), compute_scale(mean, near))


def compute_scale(mean: FloatArray, near: list[IntArray]) -> FloatArray:
    """Compute the scale of the deviations from mean signals f64[BINS, n], counts: see `ConditionReference`.

    near: for each taxel, the indices of its neighbours and of the taxel itself. Small errors of position and force
    change a signal in proportion to the signals around the taxel, small errors of time in proportion to the change
    between time bins.
    """
    largest = np.stack([np.abs(mean[:, taxels]).max(axis=1) for taxels in near], axis=1)
    padded = np.vstack([mean[:1], mean, mean[-1:]])
    change = 0.5 * np.abs(padded[2:] - padded[:-2])
    return np.asarray(largest + change)


def find_neighbours(taxels: TaxelTable, board: IntArray) -> list[IntArray]:
    """Return for each taxel the indices of its neighbours on the same board and of the taxel itself."""
    found: list[IntArray] = [np.array([taxel]) for taxel in range(taxels.n)]
    for column in np.unique(board).tolist():
        members = np.flatnonzero(board == column)
        if len(members) < 2:
            continue
        tree = cKDTree(taxels.position[members])
        nearest = np.asarray(tree.query(taxels.position[members], k=2)[0])  # of each taxel: itself, and its neighbour
        pitch = float(np.median(nearest[:, 1]))
        around = tree.query_ball_point(taxels.position[members], NEIGHBOUR_PITCHES * pitch)
        for taxel, near in zip(members.tolist(), around, strict=True):
            found[taxel] = members[np.array(near)]
    return found


def compute_mean_noise(noise_variance: FloatArray, contacts: Sequence[Step]) -> FloatArray:
    """Return the noise variance of the mean count of a time bin of the hold phase, f64[n], counts^2.

    noise_variance: f64[n], of one frame: a mean of m frames has 1/m of this variance.
    """
    return np.asarray(
        noise_variance * float(np.mean([np.nanmean(1.0 / np.maximum(step.count[HOLD], 1)) for step in contacts]))
    )


def compute_relative_variance(conditions: Iterable[ConditionReference], mean_noise: FloatArray) -> FloatArray:
    """Compute the variance between contacts, without the noise of the frames, relative to `scale` squared, f64[BINS].

    mean_noise: f64[n], noise variance of the mean count of a time bin of the hold phase, counts^2. A signal is the
    difference of two means, so its noise variance is taken as twice this value.
    """
    excess, size = np.zeros(BINS), np.zeros(BINS)
    for one in conditions:
        excess += np.maximum(one.squares - (one.repeats - 1) * 2.0 * mean_noise, 0.0).sum(axis=1)
        size += (one.repeats - 1) * (one.scale**2).sum(axis=1)
    return np.asarray(excess / np.maximum(size, 1e-9))


def _compute_session_ratio(conditions: Sequence[Sequence[tuple[int, FloatArray]]]) -> FloatArray:
    """Compute the variance between sessions relative to the variance within sessions, f64[BINS], at least 0.

    conditions: for each condition, session number and signals f64[BINS, n] of each contact. The estimate uses the
    method of moments; it is 0 if no condition was recorded in two sessions.
    """
    within, between = np.zeros(BINS), np.zeros(BINS)
    freedom_within = freedom_between = 0
    repeats: list[float] = []
    for signals in conditions:
        sessions = sorted({session for session, _ in signals})
        if len(sessions) < 2:
            continue
        means = []
        for session in sessions:
            values = np.stack([np.nan_to_num(value) for number, value in signals if number == session])
            within += ((values - values.mean(axis=0)) ** 2).sum(axis=(0, 2))
            freedom_within += len(values) - 1
            means.append(values.mean(axis=0))
            repeats.append(1.0 / len(values))
        stack = np.stack(means)
        between += ((stack - stack.mean(axis=0)) ** 2).sum(axis=(0, 2))
        freedom_between += len(sessions) - 1
    if not freedom_within or not freedom_between:
        return np.zeros(BINS)
    # The means of sessions with K contacts vary by 1 / K of the variance within sessions even without a difference.
    ratio = (between / freedom_between) / np.maximum(within / freedom_within, 1e-12) - float(np.mean(repeats))
    return np.asarray(np.maximum(ratio, 0.0))
