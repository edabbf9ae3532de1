"""Identification of the shape model from which a contact cloud was recorded.

The cloud is aligned to each model (`registration`), as in Tables I-13 to I-18 of the thesis, and the distances of its
points to each model are measured. For a cloud with inactive points the best model is the one with the largest evidence
(`evidence`), which considers active and inactive taxels and an uncertain object pose in each grasp. For a cloud without
inactive points the best model is the one with the smallest mean distance.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats
from taxel.cloud.evidence import compute_evidence, get_shape_likelihood
from taxel.cloud.global_alignment import align_to_mesh_globally
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import Alignment, align_to_mesh
from taxel.hand.transforms import apply
from taxel.types import FloatArray

Progress = Callable[[int, int], None]
"""Called with the number of finished models and the number of all models."""

BOOTSTRAP_SAMPLES: Final = 200
"""Default number of bootstrap samples."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A cloud aligned to one model.

    model: name of the model. distances: statistics of the distances of the contact points after alignment. alignment:
    transform of the cloud to the model. evidence: natural logarithm of the marginal likelihood of the active and
    inactive points; None for a cloud without inactive points.
    """

    model: str
    distances: DistanceStats
    alignment: Alignment
    evidence: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the fit of one shape model to a cloud as a dictionary of JSON values."""
        return {
            "model": self.model,
            **asdict(self.distances),
            "evidence": self.evidence,
            "transform": self.alignment.transform.tolist(),
        }


@dataclass(frozen=True, eq=False)
class Match:
    """A cloud compared with several models.

    fits: best first. confidence: for each model the share of bootstrap samples in which it was the best; None for a
    cloud of one grasp.
    """

    cloud: str
    fits: tuple[Fit, ...]
    confidence: dict[str, float] | None

    @property
    def best(self) -> str:
        """Name of the shape model that matches the cloud best."""
        return self.fits[0].model

    @property
    def best_by_mean(self) -> str:
        """Name of the model with the smallest mean distance, the best model according to the contact points alone."""
        return min(self.fits, key=lambda fit: fit.distances.mean_m).model

    @property
    def margin(self) -> float:
        """Smallest mean distance of the contact points to another model, divided by their mean distance to the best
        model.

        The ratio is 1 for a tie; below 1, another model is nearer to the contact points than the best model, which is
        ranked by evidence. NaN with one model. Tables I-13 to I-18 of the thesis contain this ratio.
        """
        other_means = [fit.distances.mean_m for fit in self.fits[1:]]
        return _ratio(min(other_means), self.fits[0].distances.mean_m) if other_means else float("nan")

    @property
    def lead(self) -> float:
        """Natural log evidence of the best model minus that of the second best model.

        NaN with one model, and for a cloud without inactive points, which has no evidence.
        """
        # None is appended for a single model, which has no second best one.
        first, second = (*(fit.evidence for fit in self.fits[:2]), None)[:2]
        return float("nan") if first is None or second is None else first - second

    def to_json(self) -> dict[str, Any]:
        """Return the result of matching a cloud with shape models as a dictionary of JSON values."""
        return {
            "cloud": self.cloud,
            "best": self.best,
            "best_by_mean": self.best_by_mean,
            "margin": _finite_or_none(self.margin),
            "lead": _finite_or_none(self.lead),
            "confidence": self.confidence,
            "fits": [fit.to_json() for fit in self.fits],
        }


def match(
    cloud: ContactCloud,
    models: Mapping[str, TriangleMesh],
    *,
    in_model_frame: bool = True,
    likelihoods: Mapping[str, FloatArray] | None = None,
    bootstrap_samples: int = BOOTSTRAP_SAMPLES,
    seed: int = 0,
    progress: Progress = lambda done, total: None,
) -> Match:
    """Compare a contact cloud with shape models; rank them by evidence, or by mean distance without inactive points.

    models: meshes by name. in_model_frame: whether cloud and models are in the same frame, up to the uncertainty of the
    object pose; False: the pose of the cloud is unknown. likelihoods: result of `compute_likelihoods` for this cloud,
    or for the cloud from which it was selected; None: they are computed here. bootstrap_samples, seed: number of
    samples and seed of the bootstrap over whole grasps. Raises RegistrationError for a cloud that cannot be aligned.

    Bootstrap samples are not aligned again: each uses the alignment of the whole cloud. This alignment minimises the
    sum of squared distances, so that a small error of the alignment changes the sum only in second order.
    """
    fits: list[Fit] = []
    by_grasp: list[FloatArray] = []
    has_inactive = len(cloud.inactive_points) > 0
    for done, (name, mesh) in enumerate(models.items()):
        progress(done, len(models))
        align = align_to_mesh if in_model_frame else align_to_mesh_globally
        alignment = align(cloud.points, mesh, name=cloud.name)
        distance = mesh.find_closest(apply(alignment.transform, cloud.points)).distance
        if not has_inactive:
            # The sum of distances takes the place of the log likelihood: all models have the same number of points.
            scores: FloatArray = -np.bincount(cloud.grasp, distance)[:, None].astype(np.float64)
        elif likelihoods is None:
            aligned = cloud if in_model_frame else cloud.transform(alignment.transform)
            scores = get_shape_likelihood(mesh).compute_by_grasp(aligned)
        else:
            scores = likelihoods[name]
        by_grasp.append(scores[np.unique(cloud.grasp)])
        evidence = float(compute_evidence(by_grasp[-1])[0]) if has_inactive else None
        fits.append(Fit(name, DistanceStats.from_distances(distance), alignment, evidence))
    progress(len(models), len(models))
    order = np.argsort([-float(compute_evidence(scores)[0]) for scores in by_grasp], kind="stable")
    shares = _bootstrap(by_grasp, bootstrap_samples, seed) if bootstrap_samples and len(by_grasp[0]) > 1 else None
    confidence = None if shares is None else {fits[row].model: float(shares[row]) for row in order}
    return Match(cloud.name, tuple(fits[row] for row in order), confidence)


def compute_likelihoods(
    cloud: ContactCloud, models: Mapping[str, TriangleMesh], progress: Progress = lambda done, total: None
) -> dict[str, FloatArray]:
    """Compute the log likelihood of each grasp of a cloud for each shape model, f64[G, K], by name of the model.

    G: grasps; K: pairs of the likelihood's parameters reach and blur. The result can be passed to `match` for the cloud
    and for every part of it.
    """
    result = {}
    for done, (name, mesh) in enumerate(models.items()):
        progress(done, len(models))
        result[name] = get_shape_likelihood(mesh).compute_by_grasp(cloud)
    progress(len(models), len(models))
    return result


def _bootstrap(by_grasp: list[FloatArray], samples: int, seed: int) -> FloatArray:
    """Compute the share of bootstrap samples in which each shape model is the best, f64[models].

    by_grasp: log likelihoods of the grasps f64[g, K] for each model. Whole grasps are resampled.
    """
    count = len(by_grasp[0])
    times = np.random.default_rng(seed).multinomial(count, np.full(count, 1.0 / count), samples).astype(np.float64)
    best = np.stack([compute_evidence(scores, times) for scores in by_grasp]).argmax(axis=0)
    return np.bincount(best, minlength=len(by_grasp)) / samples


def _ratio(numerator: float, denominator: float) -> float:
    """Divide two distances; the ratio is infinite if the denominator is 0."""
    return numerator / denominator if denominator > 0.0 else float("inf")


def _finite_or_none(value: float) -> float | None:
    """Convert a number to a JSON value; None for NaN and infinity, which JSON does not have."""
    return value if np.isfinite(value) else None
