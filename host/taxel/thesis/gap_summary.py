"""Summary of the gap diagnosis of the datasets, with the shares of the treatment steps (Figure 5.13)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from taxel.thesis.object_result import ObjectResult
from taxel.thesis.printed import STAGES
from taxel.thesis.tables import compute_contributions

LARGEST_CAUSE: Final = "contact_propagation"
"""Effect to which the thesis attributes the largest part of its gap (5.6.2)."""


@dataclass(frozen=True)
class GapSummary:
    """Result of the gap diagnosis.

    headline: verdict in one line. causes: effects that the verdict names. shares: Shapley share of each named effect in
    the reduction of the gap, percent, largest first. steps: for each treatment step, its mean share of the decrease of
    the real-to-simulated distance over the objects, percent: reproduced, then printed.
    """

    headline: str
    causes: tuple[str, ...]
    shares: dict[str, float]
    steps: dict[str, tuple[float, float]]

    @property
    def is_largest_cause_found(self) -> bool:
        """Whether the diagnosis names contact propagation with the largest share."""
        return bool(self.shares) and max(self.shares, key=lambda name: self.shares[name]) == LARGEST_CAUSE

    def to_json(self) -> dict[str, Any]:
        """Convert the summary of the gap diagnosis to JSON values."""
        return {"one_line": self.headline, "named": self.causes, "shares": self.shares, "steps": self.steps}


def summarise_gap(
    report: Mapping[str, Any], results: Sequence[ObjectResult], printed: Mapping[str, Mapping[str, float]]
) -> GapSummary:
    """Return the verdict of a gap diagnosis, the shares of its effects, and the shares of the treatment steps.

    The shares of the effects in the verdict are their Shapley shares in percent of the sum of all positive shares.
    report: JSON values of the gap diagnosis. results: reproduced distances of each object, from the same datasets.
    printed: mean real-to-simulated distance that the thesis prints, metres, by object and stage.
    """
    named = {entry["name"]: float(entry["shapley_share"]) for entry in report["effects"] if entry["in_verdict"]}
    total = sum(max(share, 0.0) for share in named.values())
    largest_first = sorted(named.items(), key=lambda item: -item[1])
    shares = {name: 100.0 * share / total if total > 0 else 0.0 for name, share in largest_first}
    reproduced_shares = [
        compute_contributions({stage: result.to_sim[stage].mean_m for stage in STAGES}) for result in results
    ]
    printed_shares = [compute_contributions(printed[result.printed_name]) for result in results]
    steps = {
        stage: (_mean([row[k] for row in reproduced_shares]), _mean([row[k] for row in printed_shares]))
        for k, stage in enumerate(STAGES[1:])
    }
    verdict = report["verdict"]
    return GapSummary(str(verdict["one_line"]), tuple(verdict["effects"]), shares, steps)


def _mean(values: Sequence[float]) -> float:
    """Return the mean of the values; 0 without values."""
    return sum(values) / max(len(values), 1)
