"""Ranking of candidate contacts by the information that each of them would add, in bits (Lindley 1956).

The gain of a contact is the sum of two parts:

- Confounded pairs: for a named effect and an effect that is confounded with it, 1/2 log2((1 + L') / (1 + L)). L and L'
  are the squared distances of the predictions of the two effects without and with the contact, in units of the
  variance, after the parameters of either effect have adapted; the smaller of the two distances counts.
- Parameters of the named effects: 1/2 log2 of the ratio of the variances without and with the contact.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from taxel.gap.effects.proximity import Proximity
from taxel.gap.experiment_design.candidates import ContactBatch, PlannedContact, generate_batches
from taxel.gap.experiment_design.contact_variance import ContactVariance
from taxel.gap.experiment_design.findings import Findings, collect_parameter_values
from taxel.gap.experiment_design.information import (
    AddedInformation,
    CandidatePrediction,
    CompositeInformation,
    RemainingDifference,
)
from taxel.gap.fitting.parallel import map_in_processes
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

MAX_CONTACTS: Final = 10
"""Largest number of recommended contacts in a report. Chosen: a list of ten is short enough to read."""

SUFFICIENT_RELATIVE_ERROR: Final = 0.05
"""Relative standard error of a parameter value that is sufficient: 5 % of the largest value of the parameter.

Chosen. A smaller limit gives more weight to contacts that improve parameters which are already well determined.
"""

MIN_GAIN_BITS: Final = 0.01
"""Gain in bits at or below which a contact is not listed. Chosen: 0.01 bits reduce a standard error by 0.7 %."""

MIN_ERROR_DECREASE: Final = 0.01
"""Relative decrease of a standard error below which a contact is not recommended: 1 %, the resolution of the text."""


@dataclass(frozen=True)
class RankedContact:
    """A recommended contact.

    Attributes:
        contact: the contact.
        gain: information gain, bits.
        separates: names of the two effects that the contact separates, or label of the parameter that it improves.
        reason: the recommendation's reason as text for the user.
    """

    contact: PlannedContact
    gain: float
    separates: tuple[str, ...]
    reason: str

    def to_json(self) -> dict[str, Any]:
        """Return the entry of the field `next_presses` of the report."""
        return {**self.contact.to_json(), "separates": list(self.separates), "gain": self.gain, "why": self.reason}


@dataclass(frozen=True)
class ContactRanking:
    """Recommended contacts, largest gain first. criterion: text that states the criterion of the ranking."""

    criterion: str
    contacts: tuple[RankedContact, ...]

    def to_json(self) -> list[dict[str, Any]]:
        """Return the field `next_presses` of the report."""
        return [ranked.to_json() for ranked in self.contacts]


def rank_next_contacts(
    findings: Findings, unrecorded: Sequence[State] = (), limit: int = MAX_CONTACTS
) -> ContactRanking:
    """Rank repetitions and variations of the recorded contacts, and approaches that were only simulated.

    findings: open questions of a diagnosis. unrecorded: states of simulated approaches without a recording. limit:
    largest number of contacts in the result.
    """
    if not findings.names:
        return ContactRanking("The verdict has no effect whose parameters a further grasp could determine.", ())
    ranker = _ContactRanker(findings)
    batches = _generate_all_batches(findings, unrecorded)
    ranked_batches = map_in_processes(findings.fit_data.state, ranker.rank_batch, batches)
    gainful = (ranked for batch in ranked_batches for ranked in batch if ranked.gain > MIN_GAIN_BITS)
    ranked = sorted(gainful, key=lambda ranked: -ranked.gain)
    return ContactRanking(ranker.criterion, tuple(ranked[:limit]))


def _generate_all_batches(findings: Findings, unrecorded: Sequence[State]) -> Iterator[ContactBatch]:
    """Yield all candidate contacts, with the variations that matter for the effects of the findings."""
    composites = [findings.composite, *findings.rivals.values()]
    effects = [fitted.effect for composite in composites for fitted in composite.fitted_effects]
    is_time_dependent = any(effect.memory for effect in effects)
    has_proximity = any(isinstance(effect, Proximity) for effect in effects)
    for number, state in enumerate((findings.fit_data.state, *unrecorded)):
        yield from generate_batches(
            state, is_recorded=number == 0, is_time_dependent=is_time_dependent, has_proximity=has_proximity
        )


@dataclass(frozen=True, eq=False)
class _ConfoundedPair:
    """A named effect and an effect that is confounded with it.

    Attributes:
        names: the named effect and the other effect.
        other: information on the composite model with the other effect in place of the named effect.
        remaining: difference of the two models after the values of the named model, and of the other, have adapted.
    """

    names: tuple[str, str]
    other: CompositeInformation
    remaining: tuple[RemainingDifference, RemainingDifference]

    @property
    def squared_distance(self) -> float:
        """Squared distance of the two models on the recorded contacts, in units of the variance."""
        return min(difference.squared_length for difference in self.remaining)


class _ContactRanker:
    """Information gain of candidate contacts on the open questions of a diagnosis."""

    def __init__(self, findings: Findings) -> None:
        """Prepare the open questions: the standard errors of the parameter values, and the confounded pairs.

        `_error2`: squared standard errors of the values, from the jackknife over sessions where possible, otherwise
        from the fit. `_sufficient2`: squared errors that are sufficient. `_pairs`: for each confounded pair the part of
        the difference of its models that remains on the recorded contacts.
        """
        fit_data = findings.fit_data
        self._fit_data, self._variance = fit_data, ContactVariance.estimate(fit_data)
        self._named = CompositeInformation.compute(fit_data, findings.composite)
        self._values = values = collect_parameter_values(findings)
        predicted_error = np.sqrt(np.diag(self._named.covariance)[values.index])
        self._error2 = np.where(np.isnan(values.standard_error), predicted_error, values.standard_error) ** 2
        sufficient2 = (SUFFICIENT_RELATIVE_ERROR * values.scale) ** 2
        self._are_errors_sufficient = bool((self._error2 <= sufficient2).all())
        self._pairs = []
        for names, composite in findings.rivals.items():
            other = CompositeInformation.compute(fit_data, composite)
            difference = np.nan_to_num(other.features - self._named.features)
            remaining = self._named.compute_remaining(difference), other.compute_remaining(difference)
            self._pairs.append(_ConfoundedPair(names, other, remaining))
        # If all errors suffice and no effects are confounded, a limit of 0 ranks contacts by further error reduction.
        self._sufficient2 = (
            np.zeros_like(sufficient2) if self._are_errors_sufficient and not self._pairs else sufficient2
        )

    @property
    def criterion(self) -> str:
        """Text that states the criterion of the ranking."""
        if self._pairs:
            pairs = "; ".join(" and ".join(_format_name(name) for name in pair.names) for pair in self._pairs)
            return f"Confounded effects: {pairs}."
        if not len(self._values.index):
            return "No effects are confounded, and the effects have no parameters that a further grasp could determine."
        if self._are_errors_sufficient:
            limit = 100 * SUFFICIENT_RELATIVE_ERROR
            errors = f"all parameters have a relative standard error of at most {limit:.0f} %"
            return f"No effects are confounded, and {errors}; the grasps are ranked by the reduction of these errors."
        return "No effects are confounded; the grasps are ranked by the reduction of the parameters' intervals."

    def rank_batch(self, batch: ContactBatch) -> list[RankedContact]:
        """Return each contact of a batch with its information gain and the reason for a recommendation."""
        named = CandidatePrediction.compute(self._named, batch.state)
        if batch.is_repeat:
            weight = self._variance.compute_repeat_weight(self._fit_data, named.features)
        else:
            weight = self._variance.compute_weight(batch.state.mean, named.features)
        others = [CandidatePrediction.compute(pair.other, batch.state) for pair in self._pairs]
        differences = [np.nan_to_num(other.features - named.features) for other in others]
        ranked = []
        for number, contact in enumerate(batch.contacts):
            added = named.compute_added(number, weight)
            # The two models differ only as far as neither of them can adapt to the other: the smaller distance counts.
            squared_after = [
                min(
                    pair.remaining[0].compute_squared_length_after(added, difference[number]),
                    pair.remaining[1].compute_squared_length_after(
                        other.compute_added(number, weight), difference[number]
                    ),
                )
                for pair, other, difference in zip(self._pairs, others, differences, strict=True)
            ]
            ranked.append(self._rank_contact(contact, np.array(squared_after), added))
        return ranked

    def _rank_contact(
        self, contact: PlannedContact, squared_after: FloatArray, added: AddedInformation
    ) -> RankedContact:
        """Return a contact with its gain and the reason; a gain of 0 if the contact is not worth a recommendation.

        The gain of a confounded pair is 0.5 log2((1 + squared distance after) / (1 + squared distance before)), bits.
        squared_after: f64[pairs], squared distance of each confounded pair with the contact, in units of the variance.
        """
        squared_before = np.array([pair.squared_distance for pair in self._pairs])
        pair_gains = np.maximum(0.5 * np.log2((1.0 + squared_after) / (1.0 + squared_before)), 0.0)
        parameter_gain, label, decrease = self._compute_parameter_gain(added)
        gain = float(pair_gains.sum() + parameter_gain)
        if len(pair_gains) and pair_gains.max() > max(parameter_gain, MIN_GAIN_BITS):
            best = int(pair_gains.argmax())
            names = self._pairs[best].names
            before, after = np.sqrt(squared_before[best]), np.sqrt(squared_after[best])
            deviations = f"{after:.1f} standard deviations instead of {before:.1f}"
            reason = f"{_format_name(names[0])} and {_format_name(names[1])} would differ by {deviations}"
            return RankedContact(contact, gain, names, reason)
        if not label or decrease < MIN_ERROR_DECREASE:
            return RankedContact(contact, 0.0, (), "")
        reason = f"the standard error of {label} decreases by {100 * decrease:.0f} %"
        return RankedContact(contact, gain, (label,), reason)

    def _compute_parameter_gain(self, added: AddedInformation) -> tuple[float, str, float]:
        """Return the gain on the parameters in bits, the label of the value with the largest gain, and the relative
        decrease of the standard error of this value.

        The gain is averaged over the values of each effect, and summed over the effects. The sufficient squared error
        is added to both squared errors, so that a further reduction of a sufficiently small error gains little. Without
        parameters the result is (0, "", 0).
        """
        values = self._values
        if not len(values.index):
            return 0.0, "", 0.0
        before, after = np.diag(self._named.covariance), self._named.compute_variance_after(added)
        variance_ratio = np.clip(after[values.index] / before[values.index], 0.0, 1.0)
        total2 = np.maximum(self._error2 + self._sufficient2, 1e-300)
        limited_ratio = (variance_ratio * self._error2 + self._sufficient2) / total2
        bits = -0.5 * np.log2(np.maximum(limited_ratio, 1e-12))
        means = np.bincount(values.effect_index, bits) / np.bincount(values.effect_index)
        best = int(bits.argmax())
        return float(means.sum()), values.labels[best], 1.0 - float(np.sqrt(variance_ratio[best]))


def _format_name(name: str) -> str:
    """Return the name of an effect as text for the user."""
    return name.replace("_", " ")
