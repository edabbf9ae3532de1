"""Tails of the distances to the CAD model: what the printed tables of the thesis imply, and where far points come from.

Printed tables: for every cloud the coefficient of variation, the maximum in standard deviations, the largest possible
number of points beyond a distance (mean and standard deviation bound it: n points of deviation d have n d^2 at most
equal to N std^2), and mean distance of the points that each filter removes (differences of the sums of two rows).
Dataset: distances of the contact points of a hand or simulator in the nominal frame, and the origin of its far points.

Example: python tools/thesis/distance_tails.py out/thesis/real.h5
"""

import argparse
from collections.abc import Mapping
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import numpy as np

from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import align_to_mesh
from taxel.hand.transforms import apply
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_tables import TaxelTable
from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM
from taxel.thesis.printed import OBJECTS, get_printed_name
from taxel.thesis.printed_result import build_printed_results
from taxel.types import FloatArray

LIMITS_M = (0.005, 0.01, 0.015, 0.02, 0.03, 0.05)
"""Distances beyond which points are counted."""

CONTACT_M = 0.005
"""Distance to the CAD model up to which an active taxel counts as a contact, for the origin of the far points."""

HALF_NORMAL_VARIATION = float(np.sqrt(np.pi / 2.0 - 1.0))
"""Coefficient of variation of unsigned distances with a normal error around 0."""


def bound_points_beyond(stats: DistanceStats, limit_m: float) -> float:
    """Return the largest number of points that can lie beyond a distance, given mean and standard deviation."""
    if limit_m >= stats.max_m:
        return 0.0
    excess = limit_m - stats.mean_m
    if excess <= 0.0:
        return float(stats.points)
    variance = stats.std_m**2
    return stats.points * variance / (variance + excess**2)  # Cantelli's inequality


def describe_removed(before: DistanceStats, after: DistanceStats) -> str:
    """Return a text with the number and the mean distance of the points that a filter removes.

    before, after: printed statistics of the distances before and after the filter.
    """
    count = before.points - after.points
    mean = (before.points * before.mean_m - after.points * after.mean_m) / max(count, 1)
    return f"{count} points ({100 * count / before.points:.1f} %), mean {1e3 * mean:.1f} mm"


def describe_signals(force: Mapping[int, DistanceStats]) -> str:
    """Return the number of points per count of signal between neighbouring thresholds, and the number above the last.

    force: table rows of the force filter by threshold in counts.
    """
    densities = [
        f"{low}-{high}: {(force[low].points - force[high].points) / (high - low):.1f}"
        for low, high in pairwise(sorted(force))
    ]
    last = max(force)
    return ", ".join([*densities, f"above {last}: {force[last].points} points"])


def print_printed() -> None:
    """Print what the printed tables of the thesis imply for far points."""
    limits = ", ".join(f"{1e3 * limit:g}" for limit in LIMITS_M)
    print(f"printed tables; half-normal error around 0: coefficient of variation {HALF_NORMAL_VARIATION:.2f}")
    print(f"cloud: mean, std, max in mm; std/mean; (max - mean)/std; largest possible number beyond {limits} mm")
    for result in build_printed_results():
        for name in (REAL, FILTERED, CLEANED, SIM):
            stats = result.cad[name]
            bounds = ", ".join(f"{bound_points_beyond(stats, limit):.0f}" for limit in LIMITS_M)
            print(
                f"{result.printed_name}, {name}: {1e3 * stats.mean_m:.2f}, {1e3 * stats.std_m:.2f}, "
                f"{1e3 * stats.max_m:.1f}; {stats.std_m / stats.mean_m:.2f}; "
                f"{(stats.max_m - stats.mean_m) / stats.std_m:.1f}; {bounds} of {stats.points}"
            )
        raw, filtered, cleaned = (result.cad[name] for name in (REAL, FILTERED, CLEANED))
        print(f"{result.printed_name}, removed by the force filter: {describe_removed(raw, filtered)}")
        print(f"{result.printed_name}, removed by SOR: {describe_removed(filtered, cleaned)}")
        print(f"{result.printed_name}, points for each count of signal: {describe_signals(result.force)}")


def print_dataset(path: Path) -> None:
    """Print the tails of the distances from a dataset's contact clouds to the CAD models, and where far points lie."""
    limits = {item.printed_name: item.cad[REAL].max_m for item in build_printed_results()}
    with closing(GraspDataset(path)) as data:
        for name in data.objects:
            printed_name = get_printed_name(name)
            if printed_name not in OBJECTS:
                continue
            item = data.objects[name]
            mesh = TriangleMesh(name, item.vertices, item.faces.astype(np.int64))
            cloud = accumulate(data, name)
            distances = mesh.find_closest(apply(align_to_mesh(cloud.points, mesh).transform, cloud.points)).distance
            stats = DistanceStats.from_distances(distances)
            beyond = ", ".join(f"{int((distances > limit).sum())}" for limit in LIMITS_M)
            print(
                f"{path.name}, {name}: {1e3 * stats.mean_m:.2f}, {1e3 * stats.std_m:.2f}, {1e3 * stats.max_m:.1f}; "
                f"{stats.std_m / stats.mean_m:.2f}; {(stats.max_m - stats.mean_m) / stats.std_m:.1f}; "
                f"{beyond} of {stats.points}"
            )
            limit = limits[printed_name]
            inactive = mesh.find_closest(cloud.inactive_points).distance
            every = np.concatenate([distances, inactive])
            far = distances > limit
            print(
                f"    beyond the largest printed distance, {1e3 * limit:.1f} mm: {int(far.sum())} points "
                f"({100 * far.mean():.2f} %); {100 * (every > limit).mean():.0f} % of all taxels lie there"
            )
            print(f"    points beyond 10 mm: {describe_origin(cloud, distances, data.taxels)}")


def describe_origin(cloud: ContactCloud, distances: FloatArray, taxels: TaxelTable) -> str:
    """Return the numbers of points beyond 10 mm: on a line of a contact, on a board with or without contact.

    A contact is a point of the same grasp and board within `CONTACT_M` of the CAD model; a line is a TX or RX line.
    distances: f64[k], distance of each point of the cloud to the CAD model, metres.
    """
    counts = {"on a line of a contact": 0, "on a board with contact": 0, "on a board without contact": 0}
    contacts: dict[tuple[int, int], list[int]] = {}
    for row in np.flatnonzero(distances <= CONTACT_M):
        contacts.setdefault((int(cloud.grasp[row]), int(taxels.sensor[cloud.taxel[row]])), []).append(
            int(cloud.taxel[row])
        )
    for row in np.flatnonzero(distances > 0.01):
        taxel = cloud.taxel[row]
        near = contacts.get((int(cloud.grasp[row]), int(taxels.sensor[taxel])), [])
        shares_line = any(taxels.tx[taxel] == taxels.tx[one] or taxels.rx[taxel] == taxels.rx[one] for one in near)
        counts[list(counts)[0 if shares_line else 1 if near else 2]] += 1
    return ", ".join(f"{count} {name}" for name, count in counts.items())


def main() -> None:
    """Print the tails of the distances in the printed tables of the thesis and in the given datasets."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("datasets", type=Path, nargs="*", help="grasp datasets")
    options = parser.parse_args()
    print_printed()
    for path in options.datasets:
        print_dataset(path)


if __name__ == "__main__":
    main()
