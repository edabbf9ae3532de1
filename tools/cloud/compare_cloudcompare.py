"""taxel.cloud against CloudCompare 2.11: the same distances, the same points kept, as good alignments, how much faster.

taxel grasp --source both --out out/campaign
python tools/cloud/compare_cloudcompare.py out/campaign/real.h5 out/campaign/sim.h5

CloudCompare is the Debian package `cloudcompare`; nothing is installed here. For each object the clouds are: the hand's
as they are, above 190 counts, without outliers too, and fused; the simulator's as they are, with contact propagation,
and fused. Each is aligned to its own mesh and to the other side's cloud by both programs, and measured by both in the
place that ours found. Then the sweep of Tables I-1 to I-6 for one object by both. Exit status 1: a bound is broken.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from cloudcompare import PACKAGE, CloudCompare, program
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats, distances_to_cloud, distances_to_mesh
from taxel.cloud.files import read_cloud, write_cloud, write_mesh
from taxel.cloud.filters import force_filter, sor_mask, without_outliers
from taxel.cloud.fusion import fused
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.propagation import Propagation
from taxel.cloud.registration import PointTarget, align_to_mesh, align_to_points
from taxel.cloud.sweep import THRESHOLDS, ForceRow, SorRow, force_sweep, neighbours, sor_rules, sor_sweep
from taxel.cloud.treatment import FORCE_FILTER_COUNTS, sor_of
from taxel.errors import TaxelError
from taxel.hand.transforms import apply
from taxel.recording.grasp_dataset import GraspDataset
from taxel.types import FloatArray

SAME_PERCENT = 1.0
KEPT_PERCENT = 99.0
FASTER = 10.0
SMALL_CLOUDS, SMALL_K = 5, 4
HERE_M = 1e-6
"""A point of CloudCompare's lies this near to the one that it was: single precision."""


@dataclass(frozen=True)
class Row:
    """A cloud. Differences of ours from CloudCompare's, percent; RMS after alignment: positive is worse. kept: points
    on which both outlier filters agree, percent, the worse of N = 20 and N = a quarter of the cloud.
    """

    cloud: str
    points: int
    mesh_mean: float
    mesh_rms: float
    cloud_mean: float
    cloud_rms: float
    kept: float
    icp_mesh: float
    icp_cloud: float


@dataclass(frozen=True)
class Speed:
    """Seconds for the sweep of one object. ours: from the cloud's file to the rows. rows: of the sweep. differences: of
    the rows' mean distances, percent, the median and the largest.
    """

    object: str
    rows: int
    ours_s: float
    cloudcompare_s: float
    median_difference: float
    largest_difference: float

    @property
    def faster(self) -> float:
        """How many times."""
        return self.cloudcompare_s / self.ours_s


def variants(real: GraspDataset, sim: GraspDataset, name: str) -> Iterator[tuple[str, ContactCloud, ContactCloud]]:
    """Clouds of an object: label, the cloud, the other side's."""
    hand, model = accumulate(real, name), accumulate(sim, name)
    strong = force_filter(hand, FORCE_FILTER_COUNTS)
    rule = sor_of(name)
    yield "real", hand, model
    yield "real, force filter", strong, model
    yield "real, SOR too", without_outliers(strong, rule.count(len(strong)), rule.deviations), model
    yield "real, fused", fused(hand), model
    yield "sim", model, hand
    yield "sim, propagated", accumulate(sim, name, propagation=Propagation()), hand
    yield "sim, fused", fused(model), hand


def compared(tool: CloudCompare, label: str, cloud: ContactCloud, other: ContactCloud, mesh: TriangleMesh) -> Row:
    """One cloud by both programs."""
    solid = "mesh.ply"
    write_mesh(mesh, tool.folder / solid, overwrite=True)
    raw, target = tool.save("raw", cloud.points), tool.save("target", other.points)
    at_mesh = align_to_mesh(cloud.points, mesh)
    on_mesh = apply(at_mesh.transform, cloud.points)
    at_cloud = align_to_points(cloud.points, PointTarget(other.points))
    on_cloud = apply(at_cloud.transform, cloud.points)
    mesh_own = DistanceStats.of(distances_to_mesh(on_mesh, mesh))
    mesh_its = DistanceStats.of(tool.to_mesh(tool.save("placed", on_mesh), solid))
    cloud_own = DistanceStats.of(distances_to_cloud(on_cloud, other.points))
    cloud_its = DistanceStats.of(tool.to_cloud(tool.save("placed", on_cloud), target))
    # Both alignments are judged by the same exact distances.
    its_mesh = DistanceStats.of(distances_to_mesh(tool.aligned(raw, solid)[0], mesh))
    its_cloud = DistanceStats.of(distances_to_cloud(tool.aligned(raw, target)[0], other.points))
    return Row(
        label,
        len(cloud),
        percent(mesh_own.mean_m, mesh_its.mean_m),
        percent(mesh_own.rms_m, mesh_its.rms_m),
        percent(cloud_own.mean_m, cloud_its.mean_m),
        percent(cloud_own.rms_m, cloud_its.rms_m),
        min(agreement(tool, raw, cloud.points, k, sigma) for k, sigma in ((20, 1.0), (len(cloud) // 4, 2.0))),
        percent(at_mesh.rms_m, its_mesh.rms_m),
        percent(at_cloud.rms_m, its_cloud.rms_m),
    )


def agreement(tool: CloudCompare, file: str, points: FloatArray, k: int, n_sigma: float) -> float:
    """Points of which both outlier filters say the same, percent."""
    own = sor_mask(points, k, n_sigma)
    its = cKDTree(tool.outliers_removed(file, k, n_sigma)).query(points)[0] < HERE_M
    return 100.0 * float((own == its).mean())


def definitions(tool: CloudCompare) -> dict[str, int]:
    """Which outlier filter CloudCompare's is: on how many of `SMALL_CLOUDS` it keeps the points of each definition.

    The clouds have so few points that all four definitions keep different ones.
    """
    agrees = dict.fromkeys(("itself, population", "itself, sample", "others, population", "others, sample"), 0)
    seed = clouds = 0
    while clouds < SMALL_CLOUDS:
        points = np.random.default_rng(seed).normal(0.0, 0.01, (12, 3)).round(6)
        seed += 1
        apart = np.sort(cdist(points, points), axis=1)
        keeps = []
        for last in (SMALL_K, SMALL_K + 1):
            mean = apart[:, 1:last].mean(axis=1)
            keeps += [mean <= mean.mean() + mean.std(ddof=ddof) for ddof in (0, 1)]
        if len({tuple(keep.tolist()) for keep in keeps}) < len(keeps):
            continue
        clouds += 1
        its = cKDTree(tool.outliers_removed(tool.save("small", points), SMALL_K, 1.0)).query(points)[0] < HERE_M
        for name, keep in zip(agrees, keeps, strict=True):
            agrees[name] += int((keep == its).all())
    return agrees


def percent(own: float, its: float) -> float:
    """How much more ours is."""
    return 100.0 * (own / its - 1.0) if its > 0.0 else 0.0


def timed_sweep(tool: CloudCompare, cloud: ContactCloud, mesh: TriangleMesh, name: str) -> Speed:
    """Tables I-1 to I-6 of one object, from files, by both."""
    write_mesh(mesh, tool.folder / "mesh.ply", overwrite=True)
    path = tool.folder / "sweep.ply"
    write_cloud(cloud, path, overwrite=True)
    begun = time.perf_counter()
    read = read_cloud(path)
    rows: list[ForceRow | SorRow] = [*force_sweep(read, mesh, name), *sor_sweep(read, mesh, name)]
    own = time.perf_counter() - begun
    file = tool.save("sweep", cloud.points, cloud.counts)
    left = len(force_filter(cloud, FORCE_FILTER_COUNTS))
    settings: list[tuple[float, tuple[int, float] | None]] = [(threshold, None) for threshold in THRESHOLDS]
    settings += [(FORCE_FILTER_COUNTS, (neighbours(share, left), sigma)) for share, sigma in sor_rules(name)]
    begun = time.perf_counter()
    means = [float(tool.whole_row(file, "mesh.ply", *setting)[1].mean()) for setting in settings]
    its = time.perf_counter() - begun
    apart = [abs(percent(row.mean_m, mean)) for row, mean in zip(rows, means, strict=True)]
    return Speed(name, len(rows), own, its, float(np.median(apart)), max(apart))


def broken(rows: list[Row], speed: Speed) -> list[str]:
    """What is worse than it must be, one line each."""
    found = []
    for row in rows:
        for name in ("mesh_mean", "mesh_rms", "cloud_mean", "cloud_rms"):
            if abs(getattr(row, name)) > SAME_PERCENT:
                found.append(f"{row.cloud}: {name} differs by {getattr(row, name):.3f} %")
        if row.kept < KEPT_PERCENT:
            found.append(f"{row.cloud}: the outlier filters agree on {row.kept:.2f} % of the points")
        for name in ("icp_mesh", "icp_cloud"):
            if getattr(row, name) > SAME_PERCENT:
                found.append(f"{row.cloud}: {name} is worse by {getattr(row, name):.3f} %")
    if speed.faster < FASTER:
        found.append(f"sweep: {speed.faster:.1f} times as fast, not {FASTER:g}")
    return found


def main() -> int:
    """Compare, print, and say whether all bounds hold."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("real", help="grasp dataset of the hand")
    parser.add_argument("sim", help="grasp dataset of the simulator")
    parser.add_argument("--json", action="store_true", help="print as JSON")
    options = parser.parse_args()
    found = program()
    if found is None:
        print(f"compare_cloudcompare: CloudCompare is missing: apt-get install {PACKAGE}", file=sys.stderr)
        return 2
    rows = []
    try:
        with (
            tempfile.TemporaryDirectory() as folder,
            GraspDataset(options.real) as real,
            GraspDataset(options.sim) as sim,
        ):
            tool = CloudCompare(found, Path(folder))
            for name, item in real.objects.items():
                mesh = TriangleMesh(name, item.vertices, item.faces)
                for label, cloud, other in variants(real, sim, name):
                    rows.append(compared(tool, f"{name}, {label}", cloud, other, mesh))
                    print(".", end="", file=sys.stderr, flush=True)
            kinds = definitions(tool)
            first = next(iter(real.objects))
            item = real.objects[first]
            speed = timed_sweep(tool, accumulate(real, first), TriangleMesh(first, item.vertices, item.faces), first)
            print(file=sys.stderr)
    except (TaxelError, RuntimeError, OSError) as error:
        print(f"compare_cloudcompare: {error}", file=sys.stderr)
        return 2
    bad = broken(rows, speed)
    if options.json:
        told = {"clouds": [asdict(row) for row in rows], "sweep": {**asdict(speed), "faster": speed.faster}}
        print(json.dumps({**told, "outlier_filter": kinds, "broken": bad}))
    else:
        show(rows, kinds, speed, bad)
    return 1 if bad else 0


def show(rows: list[Row], kinds: dict[str, int], speed: Speed, bad: list[str]) -> None:
    """The comparison as a Markdown table."""
    print("| cloud | points | C2M mean | C2M RMS | C2C mean | C2C RMS | SOR agrees | ICP to mesh | ICP to cloud |")
    print("|---|---|---|---|---|---|---|---|---|")
    for row in rows:
        distances = " | ".join(
            f"{value:+.4f} %" for value in (row.mesh_mean, row.mesh_rms, row.cloud_mean, row.cloud_rms)
        )
        icp = f"{row.icp_mesh:+.3f} % | {row.icp_cloud:+.3f} %"
        print(f"| {row.cloud} | {row.points} | {distances} | {row.kept:.2f} % | {icp} |")
    print()
    told = ", ".join(f"{name}: {count}" for name, count in kinds.items())
    print(
        f"Outlier filter, N counts the point itself or others only, sigma of: of {SMALL_CLOUDS} small clouds, {told}."
    )
    print(
        f"Sweep of {speed.rows} rows, {speed.object}: {speed.ours_s:.2f} s, CloudCompare {speed.cloudcompare_s:.1f} s: "
        f"{speed.faster:.1f} times as fast. Mean distances differ by {speed.median_difference:.3f} % (median), "
        f"{speed.largest_difference:.2f} % at most."
    )
    print("\n".join(bad) if bad else f"All bounds hold on {len(rows)} clouds.")


if __name__ == "__main__":
    sys.exit(main())
