"""What the gap diagnosis says of the thesis's campaign, beside the thesis's own shares (Figure 5.13)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from taxel.thesis.matching import ObjectResult
from taxel.thesis.printed import STAGES
from taxel.thesis.tables import contributions

LARGEST: Final = "contact_propagation"
"""What the thesis holds responsible for the largest part of its gap (5.6.2)."""


@dataclass(frozen=True)
class Beside:
    """named: the diagnosis's causes, strongest first. shares: of each in the shrink of the gap, percent (Shapley).

    steps: each treatment step's mean share over the objects, percent; ours and the thesis's.
    """

    one_line: str
    named: tuple[str, ...]
    shares: dict[str, float]
    steps: dict[str, tuple[float, float]]

    @property
    def finds_largest(self) -> bool:
        """Whether contact propagation is named, and has the largest share."""
        return bool(self.shares) and max(self.shares, key=lambda name: self.shares[name]) == LARGEST


def beside(
    report: Mapping[str, Any], results: Sequence[ObjectResult], printed: Mapping[str, Mapping[str, float]]
) -> Beside:
    """report: of the gap diagnosis of the same datasets. printed: mean distance by object and stage."""
    found = {entry["name"]: float(entry["shapley_share"]) for entry in report["effects"] if entry["in_verdict"]}
    whole = sum(max(share, 0.0) for share in found.values())
    largest_first = sorted(found.items(), key=lambda item: -item[1])
    shares = {name: 100.0 * share / whole if whole > 0 else 0.0 for name, share in largest_first}
    ours = [contributions({stage: one.to_sim[stage].mean_m for stage in STAGES}) for one in results]
    theirs = [contributions(printed[one.thesis]) for one in results]
    steps = {
        stage: (_mean([row[k] for row in ours]), _mean([row[k] for row in theirs]))
        for k, stage in enumerate(STAGES[1:])
    }
    verdict = report["verdict"]
    return Beside(str(verdict["one_line"]), tuple(verdict["effects"]), shares, steps)


def _mean(values: Sequence[float]) -> float:
    return sum(values) / max(len(values), 1)
