"""What fusion of repeats gains over piling points up: the table of docs/contact-clouds.md.

taxel grasp --source both --out out/campaign
python tools/cloud/measure_fusion.py out/campaign/real.h5 out/campaign/sim.h5

The thesis (5.6.2) piles up the points of all repeats, and proposes to average the same contact over a grasp's repeats,
so that the outlier filter (SOR) finds fewer genuine points isolated. A point is called genuine here if it lies within
the layer's thickness of the object after alignment. SOR is the thesis's for each object (Table 5.4).
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass

from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats, distances_to_cloud, distances_to_mesh
from taxel.cloud.filters import sor_mask
from taxel.cloud.fusion import fused
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import PointTarget, align_to_mesh, align_to_points
from taxel.cloud.treatment import sor_of
from taxel.errors import TaxelError
from taxel.hand.transforms import apply
from taxel.recording.grasp_dataset import GraspDataset

GENUINE_M = 0.002
"""Thickness of the layer (`layer_m` of the packaged hands)."""

WAYS = (("piled up", None), ("fused", 0.0), ("fused, half of the repeats", 0.5))


@dataclass(frozen=True)
class Row:
    """One cloud. Lengths in mm; shares in percent, of genuine points and of the others that SOR removes."""

    object: str
    way: str
    points: int
    mesh_mean: float
    mesh_rms: float
    sim_mean: float
    sim_rms: float
    genuine: float
    genuine_removed: float
    others_removed: float


def measured(name: str, way: str, cloud: ContactCloud, sim: ContactCloud, mesh: TriangleMesh) -> Row:
    """A hand's cloud against the object and the simulator's cloud, and what SOR does to it."""
    there = distances_to_mesh(apply(align_to_mesh(cloud.points, mesh).transform, cloud.points), mesh)
    to_sim = align_to_points(cloud.points, PointTarget(sim.points)).transform
    near = DistanceStats.of(distances_to_cloud(apply(to_sim, cloud.points), sim.points))
    on_mesh = DistanceStats.of(there)
    genuine = there <= GENUINE_M
    rule = sor_of(name)
    removed = ~sor_mask(cloud.points, max(2, min(rule.count(len(cloud)), len(cloud))), rule.deviations)
    lengths = (1e3 * value for value in (on_mesh.mean_m, on_mesh.rms_m, near.mean_m, near.rms_m))
    shares = (100.0 * float(part.mean()) for part in (genuine, removed[genuine], removed[~genuine]))
    return Row(name, way, len(cloud), *lengths, *shares)


def rows_of(real: GraspDataset, sim: GraspDataset) -> Iterator[Row]:
    """Of every object, each way."""
    for name, item in real.objects.items():
        mesh = TriangleMesh(name, item.vertices, item.faces)
        hand, model = accumulate(real, name), accumulate(sim, name)
        for way, share in WAYS:
            both = (hand, model) if share is None else (fused(hand, share), fused(model, share))
            yield measured(name, way, both[0], both[1], mesh)


def main() -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("real", help="grasp dataset of the hand")
    parser.add_argument("sim", help="grasp dataset of the simulator")
    parser.add_argument("--json", action="store_true", help="print as JSON")
    options = parser.parse_args()
    try:
        with GraspDataset(options.real) as real, GraspDataset(options.sim) as sim:
            rows = list(rows_of(real, sim))
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
        print(f"| {row.object.replace('_', ' ')} | {row.way} | {row.points} | {lengths} | {shares} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
