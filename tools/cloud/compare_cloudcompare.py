"""Comparison of taxel.cloud with CloudCompare 2.11: distances, outlier filter, alignment, speed.

taxel grasp --source both --out out/campaign
python tools/cloud/compare_cloudcompare.py out/campaign/real.h5 out/campaign/sim.h5

CloudCompare is the Debian package `cloudcompare`; this program does not install it. The clouds of each object are: real
unfiltered, real above 190 counts, real without outliers, real fused, simulated, simulated with contact propagation,
simulated fused. Both programs align each cloud to the mesh of its object and to the cloud of the other dataset. Both
measure distances in the pose that taxel.cloud computed. Then both compute the sweep of Tables I-1 to I-6 for one
object. Exit status 1: a bound is exceeded.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from cloudcompare import PACKAGE, CloudCompare, find_program
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats, compute_distances_to_cloud, compute_distances_to_mesh
from taxel.cloud.files import read_cloud, write_cloud, write_mesh
from taxel.cloud.filters import filter_by_force, find_inliers, remove_outliers
from taxel.cloud.fusion import fuse_repeats
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.propagation import Propagation
from taxel.cloud.registration import PointTarget, align_to_mesh, align_to_points
from taxel.cloud.sweep import (
    FORCE_THRESHOLDS,
    ForceRow,
    SorRow,
    count_neighbours,
    get_sor_rules,
    sweep_force_filter,
    sweep_outlier_filter,
)
from taxel.cloud.treatment import FORCE_FILTER_COUNTS, get_outlier_filter
from taxel.errors import TaxelError
from taxel.hand.transforms import apply
from taxel.recording.grasp_dataset import GraspDataset
from taxel.types import FloatArray

MAX_DIFFERENCE_PERCENT = 1.0
MIN_AGREEMENT_PERCENT = 99.0
MIN_SPEED_RATIO = 10.0
"""Bounds of the comparison."""

SMALL_CLOUDS, SMALL_K = 5, 4
SAME_POINT_M = 1e-6
"""Largest distance between a point and its copy in a file of CloudCompare, which uses single precision."""


@dataclass(frozen=True)
class Row:
    """Comparison of one cloud: differences of taxel.cloud from CloudCompare, percent.

    mesh_mean to cloud_rms: distances. agreement: points for which both outlier filters decide equally, percent, the
    smaller value of N = 20 and N = a quarter of the cloud. icp_mesh, icp_cloud: RMS after alignment; a positive value
    means that taxel.cloud has the larger RMS.
    """

    cloud: str
    points: int
    mesh_mean: float
    mesh_rms: float
    cloud_mean: float
    cloud_rms: float
    agreement: float
    icp_mesh: float
    icp_cloud: float


@dataclass(frozen=True)
class Speed:
    """Times for the sweep of one object.

    rows: number of rows. taxel_s: from the file of the cloud to the rows. median_difference, largest_difference: of the
    mean distances of the rows, percent.
    """

    object: str
    rows: int
    taxel_s: float
    cloudcompare_s: float
    median_difference: float
    largest_difference: float

    @property
    def ratio(self) -> float:
        """Time of CloudCompare divided by the time of taxel.cloud."""
        return self.cloudcompare_s / self.taxel_s


def build_variants(
    real: GraspDataset, sim: GraspDataset, name: str
) -> Iterator[tuple[str, ContactCloud, ContactCloud]]:
    """Build the clouds of one object for the comparison with CloudCompare.

    real, sim: measured and simulated grasp dataset. name: name of the object. Yields (label, cloud, unfiltered cloud of
    the other dataset).
    """
    real_cloud, sim_cloud = accumulate(real, name), accumulate(sim, name)
    filtered = filter_by_force(real_cloud, FORCE_FILTER_COUNTS)
    settings = get_outlier_filter(name)
    clean = remove_outliers(filtered, settings.count_neighbours(len(filtered)), settings.deviations)
    yield "real", real_cloud, sim_cloud
    yield "real, force filter", filtered, sim_cloud
    yield "real, force filter and SOR", clean, sim_cloud
    yield "real, fused", fuse_repeats(real_cloud), sim_cloud
    yield "sim", sim_cloud, real_cloud
    yield "sim, propagated", accumulate(sim, name, propagation=Propagation()), real_cloud
    yield "sim, fused", fuse_repeats(sim_cloud), real_cloud


def compare_cloud(tool: CloudCompare, label: str, cloud: ContactCloud, other: ContactCloud, mesh: TriangleMesh) -> Row:
    """Compare taxel.cloud with CloudCompare on one cloud, by three results of both programs.

    The results are mean and RMS of the distances to the mesh and to the other cloud, the points that the outlier filter
    keeps, and the RMS after alignment (ICP) to the mesh and to the other cloud. label: name of the row. other: cloud of
    the other dataset (real or simulated). mesh: mesh of the object.
    """
    mesh_file = "mesh.ply"
    write_mesh(mesh, tool.folder / mesh_file, overwrite=True)
    cloud_file, target_file = tool.save("raw", cloud.points), tool.save("target", other.points)
    at_mesh = align_to_mesh(cloud.points, mesh)
    on_mesh = apply(at_mesh.transform, cloud.points)
    at_cloud = align_to_points(cloud.points, PointTarget(other.points))
    on_cloud = apply(at_cloud.transform, cloud.points)
    mesh_stats = DistanceStats.from_distances(compute_distances_to_mesh(on_mesh, mesh))
    mesh_stats_cc = DistanceStats.from_distances(tool.measure_to_mesh(tool.save("aligned", on_mesh), mesh_file))
    cloud_stats = DistanceStats.from_distances(compute_distances_to_cloud(on_cloud, other.points))
    cloud_stats_cc = DistanceStats.from_distances(tool.measure_to_cloud(tool.save("aligned", on_cloud), target_file))
    # The alignments of both programs are compared by the same exact distances.
    on_mesh_cc = tool.align(cloud_file, mesh_file)[0]
    on_cloud_cc = tool.align(cloud_file, target_file)[0]
    aligned_mesh_cc = DistanceStats.from_distances(compute_distances_to_mesh(on_mesh_cc, mesh))
    aligned_cloud_cc = DistanceStats.from_distances(compute_distances_to_cloud(on_cloud_cc, other.points))
    return Row(
        cloud=label,
        points=len(cloud),
        mesh_mean=compute_excess_percent(mesh_stats.mean_m, mesh_stats_cc.mean_m),
        mesh_rms=compute_excess_percent(mesh_stats.rms_m, mesh_stats_cc.rms_m),
        cloud_mean=compute_excess_percent(cloud_stats.mean_m, cloud_stats_cc.mean_m),
        cloud_rms=compute_excess_percent(cloud_stats.rms_m, cloud_stats_cc.rms_m),
        agreement=min(
            measure_filter_agreement(tool, cloud_file, cloud.points, k, sigma)
            for k, sigma in ((20, 1.0), (len(cloud) // 4, 2.0))
        ),
        icp_mesh=compute_excess_percent(at_mesh.rms_m, aligned_mesh_cc.rms_m),
        icp_cloud=compute_excess_percent(at_cloud.rms_m, aligned_cloud_cc.rms_m),
    )


def measure_filter_agreement(tool: CloudCompare, file: str, points: FloatArray, k: int, n_sigma: float) -> float:
    """Measure the percentage of points for which both outlier filters decide equally.

    file, points: the same cloud, as file of CloudCompare and f64[n, 3]. k: number of neighbours. n_sigma: limit in
    standard deviations.
    """
    is_inlier = find_inliers(points, k, n_sigma)
    is_inlier_cc = cKDTree(tool.remove_outliers(file, k, n_sigma)).query(points)[0] < SAME_POINT_M
    return 100.0 * float((is_inlier == is_inlier_cc).mean())


def compare_filter_definitions(tool: CloudCompare) -> dict[str, int]:
    """Find the definition of CloudCompare's outlier filter: which of four possible definitions it follows.

    The definitions differ in whether a point is its own neighbour, and in the formula of the standard deviation.
    Returns for each definition the number of small clouds (of `SMALL_CLOUDS`) from which both keep the same points.
    Each cloud has 12 points, from which the four definitions keep different points.
    """
    agreements = dict.fromkeys(("itself, population", "itself, sample", "others, population", "others, sample"), 0)
    seed = clouds = 0
    while clouds < SMALL_CLOUDS:
        points = np.random.default_rng(seed).normal(0.0, 0.01, (12, 3)).round(6)
        seed += 1
        distances = np.sort(cdist(points, points), axis=1)
        keeps = []
        # With the point itself as a neighbour, and without. In the first case its distance 0 (column 0) is omitted: it
        # would reduce all means by the same factor, which does not change the selected points.
        for last in (SMALL_K, SMALL_K + 1):
            mean = distances[:, 1:last].mean(axis=1)
            keeps += [mean <= mean.mean() + mean.std(ddof=ddof) for ddof in (0, 1)]
        if len({tuple(keep.tolist()) for keep in keeps}) < len(keeps):
            continue
        clouds += 1
        kept = tool.remove_outliers(tool.save("small", points), SMALL_K, 1.0)
        keep_cc = cKDTree(kept).query(points)[0] < SAME_POINT_M
        for name, keep in zip(agreements, keeps, strict=True):
            agreements[name] += int((keep == keep_cc).all())
    return agreements


def compute_excess_percent(value: float, reference: float) -> float:
    """Compute by how many percent a value exceeds a reference; 0 for a reference of 0."""
    return 100.0 * (value / reference - 1.0) if reference > 0.0 else 0.0


def measure_sweep_time(tool: CloudCompare, cloud: ContactCloud, mesh: TriangleMesh, name: str) -> Speed:
    """Measure how long taxel.cloud and CloudCompare take for the filter tables of one object, starting from files.

    These are Tables I-1 to I-6 of the thesis: force filters with several thresholds, then outlier filters.
    """
    write_mesh(mesh, tool.folder / "mesh.ply", overwrite=True)
    path = tool.folder / "sweep.ply"
    write_cloud(cloud, path, overwrite=True)
    started = time.perf_counter()
    read = read_cloud(path)
    rows: list[ForceRow | SorRow] = [*sweep_force_filter(read, mesh, name), *sweep_outlier_filter(read, mesh, name)]
    taxel_s = time.perf_counter() - started
    file = tool.save("sweep", cloud.points, cloud.counts)
    filtered = len(filter_by_force(cloud, FORCE_FILTER_COUNTS))
    settings: list[tuple[float, tuple[int, float] | None]] = [(threshold, None) for threshold in FORCE_THRESHOLDS]
    settings += [
        (FORCE_FILTER_COUNTS, (count_neighbours(share, filtered), sigma)) for share, sigma in get_sor_rules(name)
    ]
    started = time.perf_counter()
    means = [float(tool.compute_sweep_row(file, "mesh.ply", *setting)[1].mean()) for setting in settings]
    cloudcompare_s = time.perf_counter() - started
    differences = [abs(compute_excess_percent(row.mean_m, mean)) for row, mean in zip(rows, means, strict=True)]
    return Speed(name, len(rows), taxel_s, cloudcompare_s, float(np.median(differences)), max(differences))


def list_violations(rows: list[Row], speed: Speed) -> list[str]:
    """List the exceeded bounds of the comparison, one line each.

    The distances of both programs must agree. The RMS after an alignment (ICP) by taxel.cloud may be smaller than that
    of CloudCompare, but not larger.
    """
    violations = []
    for row in rows:
        for name in ("mesh_mean", "mesh_rms", "cloud_mean", "cloud_rms"):
            if abs(getattr(row, name)) > MAX_DIFFERENCE_PERCENT:
                violations.append(f"{row.cloud}: {name} differs by {getattr(row, name):.3f} %")
        if row.agreement < MIN_AGREEMENT_PERCENT:
            violations.append(f"{row.cloud}: the outlier filters agree on {row.agreement:.2f} % of the points")
        for name in ("icp_mesh", "icp_cloud"):
            if getattr(row, name) > MAX_DIFFERENCE_PERCENT:
                violations.append(f"{row.cloud}: {name} is larger by {getattr(row, name):.3f} %")
    if speed.ratio < MIN_SPEED_RATIO:
        violations.append(f"sweep: {speed.ratio:.1f} times as fast, expected {MIN_SPEED_RATIO:g}")
    return violations


def main() -> int:
    """Compare both programs and print the result.

    Returns the exit status: 0 if all bounds hold, 1 if one is exceeded, 2 after an error or without CloudCompare.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("real", help="grasp dataset of the hand")
    parser.add_argument("sim", help="grasp dataset of the simulator")
    parser.add_argument("--json", action="store_true", help="print as JSON")
    options = parser.parse_args()
    program = find_program()
    if program is None:
        print(f"compare_cloudcompare: CloudCompare is missing: apt-get install {PACKAGE}", file=sys.stderr)
        return 2
    rows = []
    try:
        with (
            tempfile.TemporaryDirectory() as folder,
            GraspDataset(options.real) as real,
            GraspDataset(options.sim) as sim,
        ):
            tool = CloudCompare(program, Path(folder))
            for name, item in real.objects.items():
                mesh = TriangleMesh(name, item.vertices, item.faces)
                for label, cloud, other in build_variants(real, sim, name):
                    rows.append(compare_cloud(tool, f"{name}, {label}", cloud, other, mesh))
                    print(".", end="", file=sys.stderr, flush=True)
            definitions = compare_filter_definitions(tool)
            first = next(iter(real.objects))
            item = real.objects[first]
            speed = measure_sweep_time(
                tool, accumulate(real, first), TriangleMesh(first, item.vertices, item.faces), first
            )
            print(file=sys.stderr)
    except (TaxelError, RuntimeError, OSError) as error:
        print(f"compare_cloudcompare: {error}", file=sys.stderr)
        return 2
    violations = list_violations(rows, speed)
    if options.json:
        result = {"clouds": [asdict(row) for row in rows], "sweep": {**asdict(speed), "faster": speed.ratio}}
        print(json.dumps({**result, "outlier_filter": definitions, "broken": violations}))
    else:
        print_tables(rows, definitions, speed, violations)
    return 1 if violations else 0


def print_tables(rows: list[Row], definitions: dict[str, int], speed: Speed, violations: list[str]) -> None:
    """Print the comparison as a Markdown table."""
    print("| cloud | points | C2M mean | C2M RMS | C2C mean | C2C RMS | SOR agrees | ICP to mesh | ICP to cloud |")
    print("|---|---|---|---|---|---|---|---|---|")
    for row in rows:
        distances = " | ".join(
            f"{value:+.4f} %" for value in (row.mesh_mean, row.mesh_rms, row.cloud_mean, row.cloud_rms)
        )
        icp = f"{row.icp_mesh:+.3f} % | {row.icp_cloud:+.3f} %"
        print(f"| {row.cloud} | {row.points} | {distances} | {row.agreement:.2f} % | {icp} |")
    print()
    agreements = ", ".join(f"{name}: {count}" for name, count in definitions.items())
    print(f"Definitions of the outlier filter, agreements of {SMALL_CLOUDS} clouds: {agreements}.")
    times = f"{speed.taxel_s:.2f} s; CloudCompare: {speed.cloudcompare_s:.1f} s, {speed.ratio:.1f} times as fast"
    print(f"Sweep of {speed.rows} rows ({speed.object}): {times}.")
    print(
        f"Mean distances differ by {speed.median_difference:.3f} % (median), {speed.largest_difference:.2f} % at most."
    )
    print("\n".join(violations) if violations else f"All bounds hold on {len(rows)} clouds.")


if __name__ == "__main__":
    sys.exit(main())
