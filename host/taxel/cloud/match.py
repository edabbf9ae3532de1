"""Which model a contact cloud fits best.

The cloud is aligned to each model (`registration`), as the thesis does for its Tables I-13 to I-18, and the distances
of its points to each are compared. Where the cloud also tells which taxels felt nothing, they speak too: the thesis
registers "the coordinates of both the active and inactive taxels" (5.4). A model of which a silent taxel lies inside,
or nearer than TOUCH_M, is contradicted by as many millimetres as that taxel would have to be moved out. The score is

    (sum of the contact points' distances + sum of the silent taxels' excess) / number of contact points,

so without silent taxels it is the mean distance. The smallest score wins.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats
from taxel.cloud.first_guess import align_to_mesh_from_anywhere
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import Alignment, align_to_mesh
from taxel.hand.transforms import apply

Array = npt.NDArray[np.float64]

TOUCH_M: Final = 0.002
"""An object that is nearer than this to a taxel's electrode presses its layer: the layer is as thick (`layer_m` of the
packaged hands)."""

DRAWS: Final = 200
"""Of the bootstrap, as a default."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A cloud at one model.

    distances: of the contact points, after alignment. excess_m: of the silent taxels, for each contact point. score_m:
    the mean distance and the excess. alignment: how the cloud was moved to the model.
    """

    model: str
    distances: DistanceStats
    excess_m: float
    alignment: Alignment

    @property
    def score_m(self) -> float:
        """Metres; small is good."""
        return self.distances.mean_m + self.excess_m

    def to_json(self) -> dict[str, Any]:
        """As plain numbers."""
        return {
            "model": self.model,
            **asdict(self.distances),
            "excess_m": self.excess_m,
            "score_m": self.score_m,
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
        """The second best score over the best; 1: a tie. NaN with one model."""
        return _ratio(self.fits[1].score_m, self.fits[0].score_m) if len(self.fits) > 1 else float("nan")

    @property
    def mean_margin(self) -> float:
        """The smallest mean distance to another model over that to the best, as in the thesis's cross-shape tables."""
        others = [fit.distances.mean_m for fit in self.fits[1:]]
        return _ratio(min(others), self.fits[0].distances.mean_m) if others else float("nan")

    def to_json(self) -> dict[str, Any]:
        """As plain numbers."""
        return {
            "cloud": self.cloud,
            "best": self.best,
            "best_by_mean": self.best_by_mean,
            "margin": _finite(self.margin),
            "mean_margin": _finite(self.mean_margin),
            "confidence": self.confidence,
            "fits": [fit.to_json() for fit in self.fits],
        }


def match(
    cloud: ContactCloud,
    models: Mapping[str, TriangleMesh],
    *,
    placed: bool = True,
    draws: int = DRAWS,
    seed: int = 0,
    show: Callable[[int, int], None] = lambda done, total: None,
) -> Match:
    """Match a cloud to models, by name.

    placed: cloud and models are in the same frame, to within what alignment mends; otherwise the cloud may lie and be
    turned in any way. draws, seed: of the bootstrap over whole grasps; each draw takes as many as there are. It holds
    the alignments, which a minimum lets it do to first order. show: told models done, and of how many.
    Raises RegistrationError for a cloud that cannot be aligned.
    """
    fits, parts = [], []
    for done, (name, mesh) in enumerate(models.items()):
        show(done, len(models))
        align = align_to_mesh if placed else align_to_mesh_from_anywhere
        alignment = align(cloud.points, mesh, name=cloud.name)
        distance = mesh.closest(apply(alignment.transform, cloud.points)).distance
        excess = silent_excess(apply(alignment.transform, cloud.quiet), mesh)
        fits.append(Fit(name, DistanceStats.of(distance), float(excess.sum() / len(cloud)), alignment))
        parts.append(_by_grasp(cloud, distance, excess))
    show(len(models), len(models))
    order = sorted(range(len(fits)), key=lambda row: fits[row].score_m)
    confidence = _bootstrap(cloud, np.stack(parts), draws, seed) if draws and len(np.unique(cloud.grasp)) > 1 else None
    told = None if confidence is None else {fits[row].model: float(confidence[row]) for row in order}
    return Match(cloud.name, tuple(fits[row] for row in order), told)


def silent_excess(quiet: Array, mesh: TriangleMesh) -> Array:
    """How far taxels that felt nothing lie within TOUCH_M of a model or inside of it, f64[M], metres; 0 elsewhere."""
    low, high = mesh.bounds
    near = ((quiet > low - TOUCH_M) & (quiet < high + TOUCH_M)).all(axis=1)
    result = np.zeros(len(quiet))
    result[near] = np.maximum(TOUCH_M - mesh.signed_distance(quiet[near]), 0.0)
    return result


def _by_grasp(cloud: ContactCloud, distance: Array, excess: Array) -> Array:
    """Each grasp's part of the score's numerator, f64[G]."""
    count = len(cloud.grasps)
    own = np.bincount(cloud.grasp, weights=distance, minlength=count)
    return np.asarray(own + np.bincount(cloud.quiet_grasp, weights=excess, minlength=count))


def _bootstrap(cloud: ContactCloud, parts: Array, draws: int, seed: int) -> Array:
    """Share of draws in which each model is best, f64[models]. parts: f64[models, G]."""
    count = len(cloud.grasps)
    drawn = np.random.default_rng(seed).multinomial(count, np.full(count, 1.0 / count), draws)
    best = (parts @ drawn.T).argmin(axis=0)  # the number of contact points is the same for all models
    return np.bincount(best, minlength=len(parts)) / draws


def _ratio(second: float, first: float) -> float:
    return second / first if first > 0.0 else float("inf")


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
