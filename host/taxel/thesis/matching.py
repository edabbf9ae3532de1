"""How well a cloud lies on a CAD model or on another cloud, as the thesis measures it (5.6.1)."""

from __future__ import annotations

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
from taxel.thesis.printed import FORCE_FILTER, STAGES, of_dataset, rows_of
from taxel.thesis.settings import PROPAGATION

REAL, SIM = "real", "sim"
FILTERED, CLEANED, SPREAD = "real, force filter", "real, force and SOR filters", "sim, contact propagation"
"""Clouds of an object: both sides as they are, and treated."""


@dataclass(frozen=True, eq=False)
class ObjectClouds:
    """name: of the dataset; thesis: the thesis's word. grasps: of the real side. clouds: by name; mesh: the object."""

    name: str
    thesis: str
    grasps: int
    clouds: Mapping[str, ContactCloud]
    mesh: TriangleMesh


@dataclass(frozen=True)
class ObjectResult:
    """All that is measured of one object.

    cad: match with its own mesh, by cloud. force: the real cloud above a threshold, counts. sor: the force-filtered
    cloud after SOR with the thesis's N and nSigma; neighbours: the N that was taken for each of the thesis's. to_sim:
    real cloud to simulated cloud by stage; sim_points: of the latter. cross: (cloud, mesh's thesis word).
    """

    name: str
    thesis: str
    grasps: int
    cad: dict[str, DistanceStats]
    force: dict[int, DistanceStats]
    sor: dict[tuple[int, float], DistanceStats]
    neighbours: dict[int, int]
    to_sim: dict[str, DistanceStats]
    sim_points: dict[str, int]
    cross: dict[tuple[str, str], DistanceStats] = field(default_factory=dict)

    def to_json(self) -> dict[str, Any]:
        """For files."""
        return {
            "name": self.name,
            "grasps": self.grasps,
            "cad": {key: asdict(one) for key, one in self.cad.items()},
            "force": {str(key): asdict(one) for key, one in self.force.items()},
            "sor": {f"{n} / {sigma:g}": asdict(one) for (n, sigma), one in self.sor.items()},
            "to_sim": {key: asdict(one) for key, one in self.to_sim.items()},
            "cross": {f"{cloud} on {mesh}": asdict(one) for (cloud, mesh), one in self.cross.items()},
        }


def clouds_of(real: GraspDataset, sim: GraspDataset, name: str) -> ObjectClouds:
    """Accumulate and treat both sides' clouds of an object. Raises CloudError of one line."""
    raw, model = accumulate(real, name), accumulate(sim, name)
    for side, cloud in ((real, raw), (sim, model)):
        if not len(cloud.grasps):
            raise CloudError(str(side.path), name, "grasps of this object", "none", "use a whole campaign")
    item = real.objects[name]
    mesh = TriangleMesh(name, item.vertices, item.faces.astype(np.int64))
    spread = accumulate(sim, name, propagation=PROPAGATION)
    return treated(name, of_dataset(name), len(raw.grasps), raw, model, spread, mesh)


def treated(
    name: str, word: str, grasps: int, real: ContactCloud, sim: ContactCloud, spread: ContactCloud, mesh: TriangleMesh
) -> ObjectClouds:
    """The thesis's treatment of an object's clouds. spread: the simulated one with contact propagation."""
    filtered, rule = filter_by_force(real, FORCE_FILTER), get_outlier_filter(name)
    cleaned = remove_outliers(filtered, min(rule.count_neighbours(len(filtered)), len(filtered)), rule.deviations)
    clouds = {REAL: real, FILTERED: filtered, CLEANED: cleaned, SIM: sim, SPREAD: spread}
    return ObjectClouds(name, word, grasps, clouds, mesh)


def _quiet() -> None:
    """Nothing is shown."""


def measure(
    item: ObjectClouds, meshes: Mapping[str, TriangleMesh], show: Callable[[], None] = _quiet, *, sweeps: bool = True
) -> ObjectResult:
    """Everything that the tables hold of one object. meshes: by thesis word. show: called after each part. sweeps:
    False leaves out what no finding needs.
    """
    real = item.clouds[REAL]
    cad = {name: measure_after_alignment(cloud, item.mesh) for name, cloud in item.clouds.items()}
    show()
    thresholds = FORCE_THRESHOLDS if sweeps else (FORCE_FILTER, HIGHEST)
    rows = sweep_force_filter(real, item.mesh, item.name, thresholds)
    force = {int(row.threshold_counts): get_distance_stats(row) for row in rows}
    show()
    sor, neighbours = _sor_sweep(item) if sweeps else ({}, {})
    show()
    targets = {name: (PointTarget(item.clouds[name].points, name), item.clouds[name]) for name in (SIM, SPREAD)}
    steps = dict(zip(STAGES, ((REAL, SIM), (FILTERED, SIM), (CLEANED, SIM), (CLEANED, SPREAD)), strict=True))
    to_sim = {stage: _to_points(item.clouds[cloud], *targets[target]) for stage, (cloud, target) in steps.items()}
    sim_points = {stage: len(item.clouds[target]) for stage, (_, target) in steps.items()}
    show()
    cross = {
        (side, word): measure_after_alignment(item.clouds[cloud], mesh)
        for side, cloud in ((REAL, CLEANED), (SIM, SPREAD))
        for word, mesh in meshes.items()
    }
    show()
    return ObjectResult(item.name, item.thesis, item.grasps, cad, force, sor, neighbours, to_sim, sim_points, cross)


HIGHEST: Final = 320
"""Counts, of the force filter's sweep."""

PARTS: Final = 5
"""How often `measure` calls `show`."""


def _sor_sweep(item: ObjectClouds) -> tuple[dict[tuple[int, float], DistanceStats], dict[int, int]]:
    """By the thesis's N and nSigma, in whose order the sweep's rows are; and the N that was taken for each of its."""
    rows = sweep_outlier_filter(item.clouds[REAL], item.mesh, item.name)
    found, neighbours = {}, {}
    for row, printed in zip(rows, rows_of("I_4_to_6_sor", item.thesis), strict=True):
        n = int(printed["n_neighbors"])
        found[n, float(printed["n_sigma"])], neighbours[n] = get_distance_stats(row), row.n_neighbors
    return found, neighbours


def _to_points(cloud: ContactCloud, target: PointTarget, there: ContactCloud) -> DistanceStats:
    """After ICP, to the nearest points of another cloud. target: its points, made ready."""
    placed = apply(align_to_points(cloud.points, target, name=cloud.name).transform, cloud.points)
    return DistanceStats.from_distances(compute_distances_to_cloud(placed, there.points, cloud.name))
