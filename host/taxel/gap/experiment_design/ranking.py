"""What to press next: presses ranked by the information that they would add.

Two things are asked. Of a found effect and another that cannot be told from it: how far a press sets them apart,
whichever is there and however the other's values give way. Of a found effect's values: how much narrower their
intervals become. Both are told in bits, half the binary logarithm of a ratio of variances (Lindley 1956; for a pair, of
how much of either effect there is), and added.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from taxel.gap.effects.proximity import Proximity
from taxel.gap.experiment_design.candidates import Batch, PlannedContact, batches
from taxel.gap.experiment_design.contact_variance import ContactVariance
from taxel.gap.experiment_design.findings import Findings, values_of
from taxel.gap.experiment_design.information import Added, CompositeInformation, Felt, Left
from taxel.gap.fitting.cores import in_copies
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

MOST_CONTACTS: Final = 10
"""Of a report."""

WELL_KNOWN: Final = 0.05
"""Standard error of a value, over the largest of its kind, below which no more of it is asked for."""

LEAST_BITS: Final = 0.01
"""A press that adds less tells nothing."""

LEAST_DECREASE: Final = 0.01
"""Relative decrease of a standard error below which a press is no reason to record: the smallest that is shown."""


@dataclass(frozen=True)
class Advice:
    """A press. gain: bits. separates: names of effects that it tells apart, or of a value that it tells. why: words."""

    contact: PlannedContact
    gain: float
    separates: tuple[str, ...]
    why: str

    def to_json(self) -> dict[str, Any]:
        """For the report."""
        return {**self.contact.to_json(), "separates": list(self.separates), "gain": self.gain, "why": self.why}


@dataclass(frozen=True)
class NextContacts:
    """line: what they are ranked by. presses: the most telling first."""

    line: str
    contacts: tuple[Advice, ...]

    def to_json(self) -> list[dict[str, Any]]:
        """For the report."""
        return [one.to_json() for one in self.contacts]


def rank_next_contacts(findings: Findings, more: Sequence[State] = (), most: int = MOST_CONTACTS) -> NextContacts:
    """Rank the recorded presses, once more or changed, and those that only the simulator made (`more`)."""
    if not findings.names:
        return NextContacts("The verdict has no effect whose parameters a further grasp could determine.", ())
    questions = _Questions(findings)
    answers = in_copies(findings.judge.state, questions.answers, _every(findings, more))
    found = sorted((one for own in answers for one in own if one.gain > LEAST_BITS), key=lambda one: -one.gain)
    return NextContacts(questions.line, tuple(found[:most]))


def _every(findings: Findings, more: Sequence[State]) -> Iterator[Batch]:
    composites = [findings.composite, *findings.rivals.values()]
    effects = [link.effect for composite in composites for link in composite.links]
    memory, near = any(one.memory for one in effects), any(isinstance(one, Proximity) for one in effects)
    for number, state in enumerate((findings.judge.state, *more)):
        yield from batches(state, recorded=number == 0, memory=memory, near=near)


@dataclass(frozen=True, eq=False)
class _Pair:
    """A found effect and one that looks like it. left: what either's values leave of the difference of the two."""

    names: tuple[str, str]
    other: CompositeInformation
    left: tuple[Left, Left]

    @property
    def apart2(self) -> float:
        """Squared distance so far, in units of what scatters."""
        return min(left.value for left in self.left)


class _Questions:
    """What is open after a diagnosis."""

    def __init__(self, findings: Findings) -> None:
        self._judge, self._scatter = findings.judge, ContactVariance.of(findings.judge)
        self._found = CompositeInformation.of(findings.judge, findings.composite)
        self._values = values = values_of(findings)
        expected = np.sqrt(np.diag(self._found.covariance)[values.place])
        self._error2 = np.where(np.isnan(values.error), expected, values.error) ** 2
        enough2 = (WELL_KNOWN * values.size) ** 2
        self._all_known = bool((self._error2 <= enough2).all())
        self._pairs = []
        for names, composite in findings.rivals.items():
            other = CompositeInformation.of(findings.judge, composite)
            difference = np.nan_to_num(other.features - self._found.features)
            self._pairs.append(_Pair(names, other, (self._found.left(difference), other.left(difference))))
        # Where nothing else is open, what is known well may be known better.
        self._enough2 = np.zeros_like(enough2) if self._all_known and not self._pairs else enough2

    @property
    def line(self) -> str:
        """What presses are ranked by."""
        if self._pairs:
            told = "; ".join(" and ".join(_words(name) for name in pair.names) for pair in self._pairs)
            return f"Confounded effects: {told}."
        if not len(self._values.place):
            return "No effects are confounded, and the effects have no parameters that a further grasp could determine."
        if self._all_known:
            known = f"all parameters have a relative standard error of at most {100 * WELL_KNOWN:.0f} %"
            return f"No effects are confounded, and {known}; the grasps are ranked by the reduction of these errors."
        return "No effects are confounded; the grasps are ranked by the reduction of the parameters' intervals."

    def answers(self, batch: Batch) -> list[Advice]:
        """What each press of a batch would add."""
        found = Felt.of(self._found, batch.state)
        if batch.again:
            weight = self._scatter.weight_again(self._judge, found.features)
        else:
            weight = self._scatter.weight(batch.state.mean, found.features)
        others = [Felt.of(pair.other, batch.state) for pair in self._pairs]
        apart = [np.nan_to_num(other.features - found.features) for other in others]
        advice = []
        for number, contact in enumerate(batch.contacts):
            told = found.added(number, weight)
            after = [
                min(
                    pair.left[0].after(told, difference[number]),
                    pair.left[1].after(other.added(number, weight), difference[number]),
                )
                for pair, other, difference in zip(self._pairs, others, apart, strict=True)
            ]
            advice.append(self._advice(contact, np.array(after), told))
        return advice

    def _advice(self, contact: PlannedContact, after: FloatArray, added: Added) -> Advice:
        """after: squared distance of each pair with the press, f64[pairs]."""
        before = np.array([pair.apart2 for pair in self._pairs])
        apart = np.maximum(0.5 * np.log2((1.0 + after) / (1.0 + before)), 0.0)
        told, label, share = self._told(added)
        gain = float(apart.sum() + told)
        if len(apart) and apart.max() > max(told, LEAST_BITS):
            best = int(apart.argmax())
            names = self._pairs[best].names
            deviations = f"{np.sqrt(after[best]):.1f} standard deviations instead of {np.sqrt(before[best]):.1f}"
            return Advice(
                contact, gain, names, f"{_words(names[0])} and {_words(names[1])} would differ by {deviations}"
            )
        if not label or share < LEAST_DECREASE:
            return Advice(contact, 0.0, (), "")
        why = f"the standard error of {label} decreases by {100 * share:.0f} %"
        return Advice(contact, gain, (label,), why)

    def _told(self, added: Added) -> tuple[float, str, float]:
        """Bits of the effects' values, of each effect the mean; which of them gains most, and the share by which its
        error falls.
        """
        values = self._values
        if not len(values.place):
            return 0.0, "", 0.0
        before, after = np.diag(self._found.covariance), self._found.variance_after(added)
        left = np.clip(after[values.place] / before[values.place], 0.0, 1.0)
        kept = (left * self._error2 + self._enough2) / np.maximum(self._error2 + self._enough2, 1e-300)
        bits = -0.5 * np.log2(np.maximum(kept, 1e-12))
        means = np.bincount(values.owner, bits) / np.bincount(values.owner)
        best = int(bits.argmax())
        return float(means.sum()), values.labels[best], 1.0 - float(np.sqrt(left[best]))


def _words(name: str) -> str:
    return name.replace("_", " ")
