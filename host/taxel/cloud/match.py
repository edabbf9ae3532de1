"""Which model a contact cloud is of.

The cloud is aligned to each model (`registration`), as the thesis does for its Tables I-13 to I-18, and the distances
of its points to each are measured. Where the cloud also tells which taxels felt nothing, the model with the largest
evidence is the best (`evidence`): what touched and what did not, each grasp with an object that lay a little aside.
Without silent taxels it is the model with the smallest mean distance.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats
from taxel.cloud.evidence import evidence, explainer
from taxel.cloud.first_guess import align_to_mesh_from_anywhere
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import Alignment, align_to_mesh
from taxel.hand.transforms import apply
from taxel.types import FloatArray

Show = Callable[[int, int], None]

DRAWS: Final = 200
"""Of the bootstrap, as a default."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A cloud at one model.

    distances: of the contact points, after alignment. alignment: how the cloud was moved to the model. evidence: ln
    marginal likelihood of what touched and what did not; None for a cloud without silent taxels.
    """

    model: str
    distances: DistanceStats
    alignment: Alignment
    evidence: float | None = None

    def to_json(self) -> dict[str, Any]:
        """As plain numbers."""
        return {
            "model": self.model,
            **asdict(self.distances),
            "evidence": self.evidence,
            "transform": self.alignment.transform.tolist(),
        }


@dataclass(frozen=True, eq=False)
class Match:
    """A cloud against several models.

    fits: best first. confidence: for each model, in which share of the bootstrap's draws it was best; None for a cloud
    of one grasp.
    """

    cloud: str
    fits: tuple[Fit, ...]
    confidence: dict[str, float] | None

    @property
    def best(self) -> str:
        """Name of the model that fits best."""
        return self.fits[0].model

    @property
    def best_by_mean(self) -> str:
        """Name of the model with the smallest mean distance: what the contact points alone say."""
        return min(self.fits, key=lambda fit: fit.distances.mean_m).model

    @property
    def margin(self) -> float:
        """The smallest mean distance to another model over that to the best, as in the thesis's Tables I-13 to I-18.

        1: a tie; below 1: the contact points alone say otherwise. NaN with one model.
        """
        others = [fit.distances.mean_m for fit in self.fits[1:]]
        return _ratio(min(others), self.fits[0].distances.mean_m) if others else float("nan")

    @property
    def lead(self) -> float:
        """By how much the evidence of the best exceeds the next, natural logarithm. NaN with one model, or without."""
        first, second = (*(fit.evidence for fit in self.fits[:2]), None)[:2]
        return float("nan") if first is None or second is None else first - second

    def to_json(self) -> dict[str, Any]:
        """As plain numbers."""
        return {
            "cloud": self.cloud,
            "best": self.best,
            "best_by_mean": self.best_by_mean,
            "margin": _finite(self.margin),
            "lead": _finite(self.lead),
            "confidence": self.confidence,
            "fits": [fit.to_json() for fit in self.fits],
        }


def match(
    cloud: ContactCloud,
    models: Mapping[str, TriangleMesh],
    *,
    placed: bool = True,
    likelihoods: Mapping[str, FloatArray] | None = None,
    draws: int = DRAWS,
    seed: int = 0,
    show: Show = lambda done, total: None,
) -> Match:
    """Match a cloud to models, by name.

    placed: cloud and models are in the same frame, to within what an object may lie aside; otherwise the cloud may lie
    and be turned in any way. likelihoods: of `likelihoods_of` this cloud, or of the whole that it is an approach of;
    None: they are worked out. draws, seed: of the bootstrap over whole grasps; each draw takes as many as there are. It
    holds the alignments, which a minimum lets it do to first order. show: told models done, and of how many.
    Raises RegistrationError for a cloud that cannot be aligned.
    """
    fits: list[Fit] = []
    parts: list[FloatArray] = []
    for done, (name, mesh) in enumerate(models.items()):
        show(done, len(models))
        align = align_to_mesh if placed else align_to_mesh_from_anywhere
        alignment = align(cloud.points, mesh, name=cloud.name)
        distance = mesh.closest(apply(alignment.transform, cloud.points)).distance
        if not len(cloud.quiet):
            told: FloatArray = -np.bincount(cloud.grasp, distance)[:, None].astype(
                np.float64
            )  # all models have as many
        elif likelihoods is None:
            told = explainer(mesh).by_grasp(cloud if placed else cloud.moved(alignment.transform))
        else:
            told = likelihoods[name]
        parts.append(told[np.unique(cloud.grasp)])
        known = float(evidence(parts[-1])[0]) if len(cloud.quiet) else None
        fits.append(Fit(name, DistanceStats.of(distance), alignment, known))
    show(len(models), len(models))
    order = np.argsort([-float(evidence(part)[0]) for part in parts], kind="stable")
    sure = _bootstrap(parts, draws, seed) if draws and len(parts[0]) > 1 else None
    confidence = None if sure is None else {fits[row].model: float(sure[row]) for row in order}
    return Match(cloud.name, tuple(fits[row] for row in order), confidence)


def likelihoods_of(
    cloud: ContactCloud, models: Mapping[str, TriangleMesh], show: Show = lambda done, total: None
) -> dict[str, FloatArray]:
    """Of each model, what each grasp of a cloud says for it, f64[G, K] (`evidence`): for many matches of its parts."""
    result = {}
    for done, (name, mesh) in enumerate(models.items()):
        show(done, len(models))
        result[name] = explainer(mesh).by_grasp(cloud)
    show(len(models), len(models))
    return result


def _bootstrap(parts: list[FloatArray], draws: int, seed: int) -> FloatArray:
    """Share of draws of whole grasps in which each model is best, f64[models]. parts: of each, f64[g, K]."""
    count = len(parts[0])
    times = np.random.default_rng(seed).multinomial(count, np.full(count, 1.0 / count), draws).astype(np.float64)
    best = np.stack([evidence(part, times) for part in parts]).argmax(axis=0)
    return np.bincount(best, minlength=len(parts)) / draws


def _ratio(second: float, first: float) -> float:
    return second / first if first > 0.0 else float("inf")


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
