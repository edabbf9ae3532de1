"""Distances of clouds to CAD models and to other clouds, computed as in the thesis (5.6.1)."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final

import numpy as np

from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats, compute_distances_to_cloud
from taxel.cloud.errors import CloudError
from taxel.cloud.filters import filter_by_force, remove_outliers
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import PointTarget, align_to_points
from taxel.cloud.sweep import (
    FORCE_THRESHOLDS,
    get_distance_stats,
    measure_after_alignment,
    sweep_force_filter,
    sweep_outlier_filter,
)
from taxel.cloud.treatment import get_outlier_filter
from taxel.hand.transforms import apply
from taxel.recording.grasp_dataset import GraspDataset
from taxel.thesis.printed import FORCE_FILTER, STAGES, get_printed_name, select_rows
from taxel.thesis.settings import PROPAGATION

REAL, SIM = "real", "sim"
FILTERED, CLEANED, SPREAD = "real, force filter", "real, force and SOR filters", "sim, contact propagation"
"""Clouds of an object: untreated, and after each step of the treatment."""


@dataclass(frozen=True, eq=False)
class ObjectClouds:
    """Contact clouds of one object, real and simulated, at all steps of the treatment, and its CAD mesh.

    name: in the dataset. printed_name: in the thesis. grasps: number of real grasps. clouds: by name of the step.
    """

    name: str
    printed_name: str
    grasps: int
    clouds: Mapping[str, ContactCloud]
    mesh: TriangleMesh


@dataclass(frozen=True)
class ObjectResult:
    """All distances of the clouds of one object.

    cad: to its own mesh, by cloud. force: real cloud above a threshold in counts. sor: force-filtered cloud after the
    statistical outlier filter (SOR), by the printed N and nSigma. neighbours: N that was used for each printed N.
    to_sim: real cloud to simulated cloud, by stage. sim_points: points of the simulated cloud, by stage. cross: by
    cloud and printed name of the mesh.
    """

    name: str
    printed_name: str
    grasps: int
    cad: dict[str, DistanceStats]
    force: dict[int, DistanceStats]
    sor: dict[tuple[int, float], DistanceStats]
    neighbours: dict[int, int]
    to_sim: dict[str, DistanceStats]
    sim_points: dict[str, int]
    cross: dict[tuple[str, str], DistanceStats] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """Convert the distances of the object to JSON values."""
        return {
            "name": self.name,
            "grasps": self.grasps,
            "cad": {key: asdict(stats) for key, stats in self.cad.items()},
            "force": {str(key): asdict(stats) for key, stats in self.force.items()},
            "sor": {f"{n} / {sigma:g}": asdict(stats) for (n, sigma), stats in self.sor.items()},
            "to_sim": {key: asdict(stats) for key, stats in self.to_sim.items()},
            "cross": {f"{cloud} on {mesh}": asdict(stats) for (cloud, mesh), stats in self.cross.items()},
        }


def accumulate_clouds(real: GraspDataset, sim: GraspDataset, name: str) -> ObjectClouds:
    """Accumulate and treat the contact clouds of an object in the real and the simulated dataset.

    name: of the object. Raises CloudError for an object without grasps.
    """
    real_cloud, sim_cloud = accumulate(real, name), accumulate(sim, name)
    for data, cloud in ((real, real_cloud), (sim, sim_cloud)):
        if not len(cloud.grasps):
            raise CloudError(str(data.path), name, "grasps of this object", "none", "use a whole campaign")
    item = real.objects[name]
    mesh = TriangleMesh(name, item.vertices, item.faces.astype(np.int64))
    propagated = accumulate(sim, name, propagation=PROPAGATION)
    return apply_treatment(name, len(real_cloud.grasps), real_cloud, sim_cloud, propagated, mesh)


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
    *,
    with_sweeps: bool = True,
) -> ObjectResult:
    """Measure all distances of the clouds of one object.

    item: the clouds. meshes: CAD models by printed name. advance: called `STEPS` times to report progress. with_sweeps:
    False leaves out distances that no finding needs.
    """
    real = item.clouds[REAL]
    cad = {name: measure_after_alignment(cloud, item.mesh) for name, cloud in item.clouds.items()}
    advance()
    thresholds = FORCE_THRESHOLDS if with_sweeps else (FORCE_FILTER, LARGEST_THRESHOLD)
    rows = sweep_force_filter(real, item.mesh, item.name, thresholds)
    force = {int(row.threshold_counts): get_distance_stats(row) for row in rows}
    advance()
    sor, neighbours = _sweep_sor(item) if with_sweeps else ({}, {})
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
        item.name, item.printed_name, item.grasps, cad, force, sor, neighbours, to_sim, sim_points, cross
    )


LARGEST_THRESHOLD: Final = 320
"""Largest threshold of the force filter sweep, counts."""

STEPS: Final = 5
"""Number of calls of `advance` by `measure`."""


def _sweep_sor(item: ObjectClouds) -> tuple[dict[tuple[int, float], DistanceStats], dict[int, int]]:
    """Measure the force-filtered real cloud after outlier filters with all settings that the thesis printed.

    Returns the distances by the printed (N, nSigma), and the N that was used for each printed N.
    """
    rows = sweep_outlier_filter(item.clouds[REAL], item.mesh, item.name)
    stats, neighbours = {}, {}
    # The rows of the sweep are in the order of the printed table.
    for row, printed in zip(rows, select_rows("I_4_to_6_sor", item.printed_name), strict=True):
        n = int(printed["n_neighbors"])
        stats[n, float(printed["n_sigma"])], neighbours[n] = get_distance_stats(row), row.n_neighbors
    return stats, neighbours


def measure_to_points(cloud: ContactCloud, target: PointTarget) -> DistanceStats:
    """Measure the distances from a cloud to the nearest points of a target after alignment by ICP."""
    aligned = apply(align_to_points(cloud.points, target, name=cloud.name).transform, cloud.points)
    return DistanceStats.from_distances(compute_distances_to_cloud(aligned, target.points, cloud.name))
