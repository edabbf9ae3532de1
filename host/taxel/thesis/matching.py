"""How well a cloud lies on a CAD model or on another cloud, as the thesis measures it (5.6.1)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final

import numpy as np

from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats, distances_to_cloud, distances_to_mesh
from taxel.cloud.filters import force_filter, kept, mean_neighbour_distances
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import PointTarget, align_to_mesh, align_to_points
from taxel.hand.transforms import apply
from taxel.recording.grasp_dataset import GraspDataset
from taxel.thesis.printed import FORCE_FILTER, SOR_OF, STAGES, of_dataset, rows_of
from taxel.thesis.settings import PROPAGATION

REAL, SIM = "real", "sim"
FILTERED, CLEANED, SPREAD = "real, force filter", "real, force and SOR filters", "sim, contact propagation"
"""Clouds of an object: both sides as they are, and treated."""


@dataclass(frozen=True)
class Match:
    """points: of the cloud. After ICP to the target, metres: root of the mean square, largest, mean and standard
    deviation of the unsigned distances.
    """

    points: int
    rms_m: float
    max_m: float
    mean_m: float
    std_m: float


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
    cad: dict[str, Match]
    force: dict[int, Match]
    sor: dict[tuple[int, float], Match]
    neighbours: dict[int, int]
    to_sim: dict[str, Match]
    sim_points: dict[str, int]
    cross: dict[tuple[str, str], Match] = field(default_factory=dict)

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
    item = real.objects[name]
    mesh = TriangleMesh(name, item.vertices, item.faces.astype(np.int64))
    spread = accumulate(sim, name, propagation=PROPAGATION)
    return treated(name, of_dataset(name), len(raw.grasps), raw, model, spread, mesh)


def treated(
    name: str, word: str, grasps: int, real: ContactCloud, sim: ContactCloud, spread: ContactCloud, mesh: TriangleMesh
) -> ObjectClouds:
    """The thesis's treatment of an object's clouds. spread: the simulated one with contact propagation."""
    filtered = force_filter(real, FORCE_FILTER)
    share, sigma = neighbour_share(word), SOR_OF.get(word, (20, 2.0))[1]
    distance = mean_neighbour_distances(filtered.points, [neighbours_in(share, len(filtered))], filtered.name)[0]
    cleaned = filtered.take(kept(distance, sigma))
    clouds = {REAL: real, FILTERED: filtered, CLEANED: cleaned, SIM: sim, SPREAD: spread}
    return ObjectClouds(name, word, grasps, clouds, mesh)


def neighbour_share(word: str) -> tuple[int, float]:
    """N of Table 5.4 as `neighbours_in` takes it."""
    neighbours = SOR_OF.get(word, (20, 2.0))[0]
    return neighbours, _points_before(word)


def neighbours_in(rule: tuple[int, float], points: int) -> int:
    """N for a cloud of so many points: 20 is 20; a larger one is the share of the cloud that it was in the thesis."""
    neighbours, before = rule
    return min(points, neighbours if neighbours <= FEW else max(2, round(neighbours / before * points)))


FEW: Final = 20


def _points_before(word: str) -> float:
    rows = rows_of("I_1_to_3_force_filter", word)
    return next((float(row["points"]) for row in rows if row["threshold_counts"] == FORCE_FILTER), 1.0)


def _quiet() -> None:
    """Nothing is shown."""


def measure(
    item: ObjectClouds, meshes: Mapping[str, TriangleMesh], show: Callable[[], None] = _quiet, *, sweeps: bool = True
) -> ObjectResult:
    """Everything that the tables hold of one object. meshes: by thesis word. show: called after each part. sweeps:
    False leaves out what no finding needs.
    """
    cad = {name: to_mesh(cloud, item.mesh) for name, cloud in item.clouds.items()}
    show()
    force = {
        int(row["threshold_counts"]): to_mesh(force_filter(item.clouds[REAL], row["threshold_counts"]), item.mesh)
        for row in rows_of("I_1_to_3_force_filter", item.thesis)
        if sweeps or row["threshold_counts"] in (FORCE_FILTER, HIGHEST)
    }
    show()
    sor, neighbours = _sor_sweep(item) if sweeps else ({}, {})
    show()
    targets = {name: (PointTarget(item.clouds[name].points, name), item.clouds[name]) for name in (SIM, SPREAD)}
    steps = dict(zip(STAGES, ((REAL, SIM), (FILTERED, SIM), (CLEANED, SIM), (CLEANED, SPREAD)), strict=True))
    to_sim = {stage: to_points(item.clouds[cloud], *targets[target]) for stage, (cloud, target) in steps.items()}
    sim_points = {stage: len(item.clouds[target]) for stage, (_, target) in steps.items()}
    show()
    cross = {
        (side, word): to_mesh(item.clouds[cloud], mesh)
        for side, cloud in ((REAL, CLEANED), (SIM, SPREAD))
        for word, mesh in meshes.items()
    }
    show()
    return ObjectResult(item.name, item.thesis, item.grasps, cad, force, sor, neighbours, to_sim, sim_points, cross)


HIGHEST: Final = 320
"""Counts, of the force filter's sweep."""

PARTS: Final = 5
"""How often `measure` calls `show`."""


def _sor_sweep(item: ObjectClouds) -> tuple[dict[tuple[int, float], Match], dict[int, int]]:
    cloud = item.clouds[FILTERED]
    rows = rows_of("I_4_to_6_sor", item.thesis)
    before = _points_before(item.thesis)
    printed = sorted({int(row["n_neighbors"]) for row in rows})
    neighbours = {n: neighbours_in((n, before), len(cloud)) for n in printed}
    distance = mean_neighbour_distances(cloud.points, [neighbours[n] for n in printed], cloud.name)
    found = {}
    for row in rows:
        key = int(row["n_neighbors"]), float(row["n_sigma"])
        found[key] = to_mesh(cloud.take(kept(distance[printed.index(key[0])], key[1])), item.mesh)
    return found, neighbours


def to_mesh(cloud: ContactCloud, mesh: TriangleMesh) -> Match:
    """ICP from where the cloud is, then distances to the surface."""
    placed = apply(align_to_mesh(cloud.points, mesh, name=cloud.name).transform, cloud.points)
    return _match(DistanceStats.of(distances_to_mesh(placed, mesh, cloud.name)))


def to_points(cloud: ContactCloud, target: PointTarget, there: ContactCloud) -> Match:
    """The same for the nearest points of another cloud. target: its points, made ready."""
    placed = apply(align_to_points(cloud.points, target, name=cloud.name).transform, cloud.points)
    return _match(DistanceStats.of(distances_to_cloud(placed, there.points, cloud.name)))


def _match(stats: DistanceStats) -> Match:
    return Match(stats.points, stats.rms_m, stats.max_m, stats.mean_m, stats.std_m)
