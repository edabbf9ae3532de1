"""A reference whose contacts are predicted by the simulator, at poses that are estimated from the contact.

The contacts of the healthy skin show how far the simulator is wrong. A signal is modelled as

    measured = course[time bin] * simulated + deviation of the condition + deviation of the contact,

where both deviations are normal with variances in proportion to the squared scale of the signals. The ratio of their
variances follows from the healthy skin (method of moments). The deviation of a condition that the healthy skin repeats
is known in part; a new condition has the expectation of the simulator alone, with the variance of both deviations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from taxel.twin.errors import TwinInputError
from taxel.twin.live_session import LiveSession
from taxel.twin.reference import (
    LEAST_REPEATS,
    ConditionReference,
    Reference,
    compute_mean_noise,
    compute_relative_variance,
    compute_scale,
    compute_signals,
    find_neighbours,
)
from taxel.twin.schedule import Condition, Contact
from taxel.twin.simulated.contact_fit import ContactPoses
from taxel.twin.simulated.predicted_contacts import SimulatedContacts, compute_hold_signal
from taxel.twin.steps import BINS, CLOSING, HOLD, RECOVERY, RELEASE, Step, find_bin_position
from taxel.types import FloatArray, IntArray

LEAST_RATIO: Final = 1e-3
"""Smallest ratio of the variances of the two deviations: an estimate of 0 would be a certainty."""


@dataclass(frozen=True, eq=False)
class ConditionDeviation:
    """Deviation of the contacts of a condition from their predictions.

    mean: f64[BINS, n], mean deviation, counts. squares: f64[BINS, n], sum of the squared deviations from this mean.
    contacts: number of contacts. scale: f64[BINS, n], mean scale of the signals, counts.
    """

    mean: FloatArray
    squares: FloatArray
    contacts: int
    scale: FloatArray


@dataclass(frozen=True, eq=False)
class SimulatedReference(Reference):
    """Reference of a skin whose contacts the simulator predicts.

    predictions: of contacts. near: for each taxel, the indices of its neighbours and of the taxel itself. course:
    f64[BINS], signal in each time bin relative to the predicted signal in the hold phase. deviations: by condition.
    ratio: variance of the deviation of a condition relative to that of a contact. `relative_variance` is the variance
    of the deviation of a contact.
    """

    predictions: SimulatedContacts
    near: list[IntArray]
    course: FloatArray
    deviations: Mapping[Condition, ConditionDeviation]
    ratio: float

    def has_variance(self, known: ConditionReference) -> bool:
        """Return True: the variance of a contact is known for new conditions too."""
        return True

    def expect(self, step: Step) -> ConditionReference | None:
        """Return the prediction of a contact with its variance; None if the contact cannot be predicted."""
        predicted = self.predictions.predict(step)
        if step.contact is None or predicted is None:
            return None
        return self._make_expectation(predicted, step.contact.condition)

    def expect_frame(
        self, live: LiveSession, contact: Contact, time_s: float, measured: FloatArray
    ) -> tuple[FloatArray, FloatArray] | None:
        """Predict the signals of one frame at the poses of its time; as `Reference.expect_frame`."""
        predicted = self.predictions.predict_frame(contact, time_s, measured)
        if predicted is None:
            return None
        # The poses are estimated from this frame, so that the values of the hold phase apply in every phase.
        known, hold = self._make_expectation(predicted, contact.condition), HOLD.start
        near = int(np.clip(round(find_bin_position(contact, time_s)), CLOSING.start, RECOVERY))
        variance = (1.0 + 1.0 / known.repeats) * self.relative_variance[near] * known.scale[hold] ** 2
        return known.mean[hold], np.asarray(variance)

    def leave_out(self, step: Step) -> Reference:
        """Return the reference without the contact of a step; the mean deviation of its condition is corrected.

        Without another contact of the condition, the condition is left out. The reference is returned unchanged for a
        step without a contact that can be predicted.
        """
        predicted = self.predictions.predict(step)
        if step.contact is None or predicted is None:
            return self
        condition = step.contact.condition
        known = self.deviations[condition]
        others = {key: each for key, each in self.deviations.items() if key != condition}
        if known.contacts > 1:
            deviation = np.nan_to_num(compute_signals(step)) - self.course[:, None] * predicted
            mean = (known.contacts * known.mean - deviation) / (known.contacts - 1)
            others[condition] = replace(known, mean=mean, contacts=known.contacts - 1)
        return replace(self, deviations=others)

    def _make_expectation(self, predicted: FloatArray, condition: Condition) -> ConditionReference:
        """Return the statistics of a contact with predicted signals f64[n] in the hold phase.

        The number of repeats in the result is the number of contacts whose mean would have the same variance as this
        prediction; it need not be an integer. The simulator does not predict the course of closing and release. For a
        condition with too few contacts, the variance of these phases is infinite, so that they are not compared.
        """
        mean = self.course[:, None] * predicted
        known = self.deviations.get(condition)
        contacts = 0 if known is None else known.contacts
        if known is not None:
            mean = mean + known.mean * contacts * self.ratio / (1.0 + contacts * self.ratio)
        scale = compute_scale(mean, self.near)
        repeats = contacts + 1.0 / self.ratio
        squares = (repeats - 1.0) * self.relative_variance[:, None] * scale**2
        if contacts < LEAST_REPEATS:
            squares[CLOSING] = squares[RELEASE] = np.inf
        return ConditionReference(mean, squares, repeats, scale)


def learn_simulated_reference(
    reference: Reference, predictions: SimulatedContacts, poses: Sequence[ContactPoses]
) -> SimulatedReference:
    """Compare the contacts of a healthy skin with their predictions; return the reference for the simulator mode.

    reference: learnt from the healthy skin. predictions: contains the simulators; the usual motions and the contacts of
    the reference are stored in it. poses: nominal poses of each contact of the reference. Raises TwinInputError if the
    simulator explains too few contacts.
    """
    near = find_neighbours(reference.taxels, reference.sensors.index_of(reference.taxels))
    steps = [step for _, step in reference.steps]
    predictions.usual.update(_find_usual_motions(steps, predictions, poses))
    for step, nominal in zip(steps, poses, strict=True):
        predictions.learn(step, nominal)
    pairs: dict[Condition, list[tuple[FloatArray, FloatArray]]] = {}
    for step in steps:
        if step.contact is not None and (predicted := predictions.predict(step)) is not None:
            pairs.setdefault(step.contact.condition, []).append((predicted, np.nan_to_num(compute_signals(step))))
    if max(map(len, pairs.values()), default=0) < LEAST_REPEATS:
        raise TwinInputError(
            "--simulate: reference",
            f"a condition with at least {LEAST_REPEATS} contacts that the simulator explains",
            f"{sum(map(len, pairs.values()))} of {len(steps)} contacts",
            "check hand, objects and poses of the reference, or leave out --simulate",
        )
    course = _fit_course([pair for found in pairs.values() for pair in found])
    deviations = {key: _compute_deviation(found, course, near) for key, found in pairs.items()}
    noise = compute_mean_noise(reference.noise_variance, steps)
    within = [ConditionReference(each.mean, each.squares, each.contacts, each.scale) for each in deviations.values()]
    base = {each.name: getattr(reference, each.name) for each in fields(Reference)}
    base["relative_variance"] = compute_relative_variance(within, noise)
    ratio = _estimate_ratio(list(deviations.values()), base["relative_variance"])
    return SimulatedReference(
        **base, predictions=predictions, near=near, course=course, deviations=deviations, ratio=ratio
    )


def _find_usual_motions(
    steps: Sequence[Step], predictions: SimulatedContacts, poses: Sequence[ContactPoses]
) -> dict[Condition, FloatArray]:
    """Return the usual motion of the contacts of each condition, f64[6 + s]. poses: nominal poses of each step.

    The usual motion is the median of the motions of K contacts times K / (K + 1): it is shrunk towards 0 as if one more
    contact needed no motion.
    """
    motions: dict[Condition, list[FloatArray]] = {}
    for step, nominal in zip(steps, poses, strict=True):
        if (
            step.contact is not None
            and (simulator := predictions.simulators.get(step.contact.condition[0])) is not None
        ):
            estimate = simulator.estimate(nominal, compute_hold_signal(step))
            motions.setdefault(step.contact.condition, []).append(estimate.motion)
    return {key: np.median(found, axis=0) * len(found) / (len(found) + 1) for key, found in motions.items()}


def _fit_course(pairs: Sequence[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Fit the signal of each time bin relative to the predicted signal in the hold phase by least squares, f64[BINS].

    pairs: predicted signals f64[n] and measured signals f64[BINS, n] of each contact. The value of the hold phase is
    near 1; it corrects a sensor model whose signals are too large or too small by a common factor.
    """
    product, square = np.zeros(BINS), 1e-9
    for predicted, signals in pairs:
        product += signals @ predicted
        square += float(predicted @ predicted)
    return np.asarray(product / square)


def _compute_deviation(
    pairs: Sequence[tuple[FloatArray, FloatArray]], course: FloatArray, near: list[IntArray]
) -> ConditionDeviation:
    """Compare the contacts of a condition with their predictions. pairs, course: as in `_fit_course`."""
    simulated = np.stack([course[:, None] * predicted for predicted, _ in pairs])
    deviations = np.stack([signals for _, signals in pairs]) - simulated
    mean = deviations.mean(axis=0)
    scale = compute_scale(simulated.mean(axis=0) + mean, near)
    return ConditionDeviation(mean, ((deviations - mean) ** 2).sum(axis=0), len(pairs), scale)


def _estimate_ratio(deviations: Sequence[ConditionDeviation], within: FloatArray) -> float:
    """Estimate the variance of the deviation of a condition relative to that of a contact, in the hold phase.

    within: f64[BINS], variance of the deviation of a contact relative to the squared scale. The mean deviation of K
    contacts has the variance of the condition's deviation plus 1 / K of that of a contact.
    """
    size = sum(float((each.scale[HOLD] ** 2).sum()) for each in deviations)
    total = sum(float((each.mean[HOLD] ** 2).sum()) for each in deviations)
    error = sum(float((within[HOLD, None] * each.scale[HOLD] ** 2).sum()) / each.contacts for each in deviations)
    variance = float(within[HOLD].mean())
    return max((total - error) / max(size * variance, 1e-12), LEAST_RATIO)
