"""Distances of clouds to CAD models and to other clouds, computed as in the thesis (5.6.1)."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.contacts import select_used_taxels
from taxel.cloud.distance import DistanceStats, compute_distances_to_cloud
from taxel.cloud.errors import CloudError
from taxel.cloud.filters import filter_by_force, remove_outliers
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import PointTarget, align_to_points
from taxel.cloud.sweep import (
    get_distance_stats,
    measure_after_alignment,
    sweep_force_filter,
    sweep_outlier_filter,
)
from taxel.cloud.treatment import get_outlier_filter
from taxel.hand.transforms import apply
from taxel.recording.grasp_dataset import GraspDataset
from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM, SPREAD
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.prevalence import LineShares, compute_line_shares, compute_prevalence
from taxel.thesis.printed import FORCE_FILTER, STAGES, get_printed_name, select_rows
from taxel.thesis.settings import PROPAGATION


@dataclass(frozen=True, eq=False)
class ObjectClouds:
    """Contact clouds of one object, real and simulated, at all steps of the treatment, and its CAD mesh.

    name, printed_name: name of the object in the dataset and in the thesis. grasps: number of real grasps. clouds:
    clouds by the names in `cloud_names`. line_shares: how often the points that the outlier filter removes share
    electrode lines with contacts; None: unknown.
    """

    name: str
    printed_name: str
    grasps: int
    clouds: Mapping[str, ContactCloud]
    mesh: TriangleMesh
    line_shares: LineShares | None = None


def accumulate_clouds(real: GraspDataset, sim: GraspDataset, name: str) -> ObjectClouds:
    """Return the contact clouds of an object at all steps of the treatment, from the real and the simulated dataset.

    The real cloud is filtered by force and by an outlier filter. The simulated cloud is accumulated twice, without and
    with contact propagation. The result also states how often the points that the outlier filter removes share
    electrode lines with contacts. name: name of the object. Raises CloudError for an object without grasps.
    """
    real_cloud, sim_cloud = accumulate(real, name), accumulate(sim, name)
    for data, cloud in ((real, real_cloud), (sim, sim_cloud)):
        if not len(cloud.grasps):
            raise CloudError(str(data.path), name, "grasps of this object", "none", "use a whole campaign")
    item = real.objects[name]
    mesh = TriangleMesh(name, item.vertices, item.faces.astype(np.int64))
    propagated = accumulate(sim, name, propagation=PROPAGATION)
    clouds = apply_treatment(name, len(real_cloud.grasps), real_cloud, sim_cloud, propagated, mesh)
    shares = compute_line_shares(clouds.clouds[FILTERED], clouds.clouds[CLEANED], real.taxels, select_used_taxels(real))
    return replace(clouds, line_shares=shares)


def apply_treatment(
    name: str, grasps: int, real: ContactCloud, sim: ContactCloud, propagated: ContactCloud, mesh: TriangleMesh
) -> ObjectClouds:
    """Apply the treatment of the thesis (force filter, outlier filter) to the real cloud of an object.

    grasps: number of real grasps. propagated: simulated cloud with contact propagation. Returns the clouds of the
    object at all steps.
    """
    filtered, settings = filter_by_force(real, FORCE_FILTER), get_outlier_filter(name)
    neighbours = min(settings.count_neighbours(len(filtered)), len(filtered))
    cleaned = remove_outliers(filtered, neighbours, settings.deviations)
    clouds = {REAL: real, FILTERED: filtered, CLEANED: cleaned, SIM: sim, SPREAD: propagated}
    return ObjectClouds(name, get_printed_name(name), grasps, clouds, mesh)


def _no_advance() -> None:
    """Report no progress."""


def measure(
    item: ObjectClouds,
    meshes: Mapping[str, TriangleMesh],
    advance: Callable[[], None] = _no_advance,
) -> ObjectResult:
    """Measure all distances of the clouds of one object: to its CAD model, to the simulated cloud, to all CAD models.

    item: the clouds. meshes: CAD models of all objects by printed name. advance: called `STEPS` times to report
    progress.
    """
    real = item.clouds[REAL]
    cad = {name: measure_after_alignment(cloud, item.mesh) for name, cloud in item.clouds.items()}
    advance()
    rows = sweep_force_filter(real, item.mesh, item.name)
    force = {int(row.threshold_counts): get_distance_stats(row) for row in rows}
    advance()
    sor, neighbours = _sweep_sor(item)
    advance()
    targets = {name: PointTarget(item.clouds[name].points, name) for name in (SIM, SPREAD)}
    steps = dict(zip(STAGES, ((REAL, SIM), (FILTERED, SIM), (CLEANED, SIM), (CLEANED, SPREAD)), strict=True))
    to_sim = {stage: measure_to_points(item.clouds[cloud], targets[target]) for stage, (cloud, target) in steps.items()}
    sim_points = {stage: len(item.clouds[target]) for stage, (_, target) in steps.items()}
    advance()
    cross = {
        (side, name): measure_after_alignment(item.clouds[cloud], mesh)
        for side, cloud in ((REAL, CLEANED), (SIM, SPREAD))
        for name, mesh in meshes.items()
    }
    advance()
    return ObjectResult(
        item.name,
        item.printed_name,
        item.grasps,
        cad,
        force,
        sor,
        neighbours,
        to_sim,
        sim_points,
        cross,
        iterations=_count_iterations(real),
        prevalence=compute_prevalence(item.clouds),
        line_shares=item.line_shares,
    )


def _count_iterations(cloud: ContactCloud) -> dict[str, int]:
    """Count the grasps of each approach of a cloud, by name of the approach."""
    counts = np.bincount(cloud.grasp_approach, minlength=len(cloud.approaches))
    return {name: int(count) for name, count in zip(cloud.approaches, counts, strict=True)}


STEPS: Final = 5
"""Number of calls of `advance` by `measure`."""


def _sweep_sor(item: ObjectClouds) -> tuple[dict[tuple[int, float], DistanceStats], dict[int, int]]:
    """Measure the distances to the CAD model for all outlier filter settings that the thesis printed.

    The outlier filter is applied to the force-filtered real cloud. Returns the distances by the printed (N, nSigma),
    and the N that was used for each printed N: a printed N above 20 is a share of the cloud.
    """
    rows = sweep_outlier_filter(item.clouds[REAL], item.mesh, item.name)
    stats, neighbours = {}, {}
    # The rows of the sweep are in the order of the printed table.
    for row, printed in zip(rows, select_rows("I_4_to_6_sor", item.printed_name), strict=True):
        n = int(printed["n_neighbors"])
        stats[n, float(printed["n_sigma"])], neighbours[n] = get_distance_stats(row), row.n_neighbors
    return stats, neighbours


def measure_to_points(cloud: ContactCloud, target: PointTarget) -> DistanceStats:
    """Align a cloud to a target by iterative closest points (ICP); return the distances to the nearest target
    points.
    """
    aligned = apply(align_to_points(cloud.points, target, name=cloud.name).transform, cloud.points)
    return DistanceStats.from_distances(compute_distances_to_cloud(aligned, target.points, cloud.name))
