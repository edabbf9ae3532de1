"""Effect of the fusion of repeats: the table of docs/contact-clouds.md.

taxel grasp --source both --out out/campaign
python tools/cloud/measure_fusion.py out/campaign/real.h5 out/campaign/sim.h5

The thesis (5.6.2) accumulates the points of all repeats and proposes to average each contact over the repeats of a
grasp, so that the outlier filter (SOR) removes fewer genuine points. Here a point is genuine if its distance to the
object after alignment is at most the thickness of the layer. The SOR settings are those of Table 5.4.
"""

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass

from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats, compute_distances_to_cloud, compute_distances_to_mesh
from taxel.cloud.filters import find_inliers
from taxel.cloud.fusion import fuse_repeats
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import PointTarget, align_to_mesh, align_to_points
from taxel.cloud.treatment import get_outlier_filter
from taxel.errors import TaxelError
from taxel.hand.transforms import apply
from taxel.recording.grasp_dataset import GraspDataset

GENUINE_M = 0.002
"""Thickness of the layer (`layer_m` of the packaged hands)."""

VARIANTS = (("accumulated", None), ("fused", 0.0), ("fused, half of the repeats", 0.5))
"""Name, and minimum share of the repeats; None: without fusion."""


@dataclass(frozen=True)
class Row:
    """Result for one cloud.

    mesh_mean, mesh_rms: distances to the object in mm; sim_mean, sim_rms: distances to the simulated cloud in mm.
    genuine: percentage of genuine points. genuine_removed, others_removed: percentages of the genuine and of the other
    points that the outlier filter (SOR) removes.
    """

    object: str
    variant: str
    points: int
    mesh_mean: float
    mesh_rms: float
    sim_mean: float
    sim_rms: float
    genuine: float
    genuine_removed: float
    others_removed: float


def measure(name: str, variant: str, cloud: ContactCloud, sim: ContactCloud, mesh: TriangleMesh) -> Row:
    """Measure the distances of a real point cloud to its object and to the simulated cloud after alignment.

    Also measures which percentage of the points is genuine, and which percentages of the genuine and of the other
    points the outlier filter removes. A point is genuine if its distance to the mesh after alignment is at most
    `GENUINE_M`, the thickness of the layer. name, mesh: name and mesh of the object. variant: name of the way in which
    the repeats of a grasp were combined to `cloud` (`VARIANTS`).
    """
    distances = compute_distances_to_mesh(apply(align_to_mesh(cloud.points, mesh).transform, cloud.points), mesh)
    to_sim = align_to_points(cloud.points, PointTarget(sim.points)).transform
    on_sim = DistanceStats.from_distances(compute_distances_to_cloud(apply(to_sim, cloud.points), sim.points))
    on_mesh = DistanceStats.from_distances(distances)
    genuine = distances <= GENUINE_M
    settings = get_outlier_filter(name)
    neighbours = max(2, min(settings.count_neighbours(len(cloud)), len(cloud)))
    removed = ~find_inliers(cloud.points, neighbours, settings.deviations)
    lengths = (1e3 * value for value in (on_mesh.mean_m, on_mesh.rms_m, on_sim.mean_m, on_sim.rms_m))
    shares = (100.0 * float(part.mean()) for part in (genuine, removed[genuine], removed[~genuine]))
    return Row(name, variant, len(cloud), *lengths, *shares)


def measure_all(real: GraspDataset, sim: GraspDataset) -> Iterator[Row]:
    """Measure the effect of the fusion of repeats: one row for each object and variant of fusion."""
    for name, item in real.objects.items():
        mesh = TriangleMesh(name, item.vertices, item.faces)
        real_cloud, sim_cloud = accumulate(real, name), accumulate(sim, name)
        for variant, share in VARIANTS:
            clouds = (real_cloud, sim_cloud)
            if share is not None:
                clouds = (fuse_repeats(real_cloud, share), fuse_repeats(sim_cloud, share))
            yield measure(name, variant, *clouds, mesh)


def main() -> int:
    """Measure all clouds and print the table. Returns the exit status: 2 after an error, otherwise 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("real", help="grasp dataset of the hand")
    parser.add_argument("sim", help="grasp dataset of the simulator")
    parser.add_argument("--json", action="store_true", help="print as JSON")
    options = parser.parse_args()
    try:
        with GraspDataset(options.real) as real, GraspDataset(options.sim) as sim:
            rows = list(measure_all(real, sim))
    except (TaxelError, OSError) as error:
        print(f"measure_fusion: {error}", file=sys.stderr)
        return 2
    if options.json:
        print(json.dumps([asdict(row) for row in rows]))
        return 0
    heading = ("object", "repeats", "points", "to CAD: mean", "RMS", "to simulation: mean", "RMS")
    print(f"| {' | '.join((*heading, 'genuine', 'SOR removes of them', 'of the others'))} |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for row in rows:
        lengths = " | ".join(f"{v:.2f} mm" for v in (row.mesh_mean, row.mesh_rms, row.sim_mean, row.sim_rms))
        shares = " | ".join(f"{v:.1f} %" for v in (row.genuine, row.genuine_removed, row.others_removed))
        print(f"| {row.object.replace('_', ' ')} | {row.variant} | {row.points} | {lengths} | {shares} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
