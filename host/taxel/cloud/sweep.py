"""Parameter sweeps of the thesis: distances to the CAD model against the settings of the two filters.

Force filter: Tables I-1 to I-3. Statistical outlier removal (SOR) after the force filter: Tables I-4 to I-6. As in the
thesis, the filtered cloud of every row is aligned separately, starting in the frame of the object.
"""

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple, dataclass, fields
from typing import Final

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats, compute_distances_to_mesh
from taxel.cloud.filters import compute_mean_neighbour_distances, filter_by_force, select_inliers
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import align_to_mesh
from taxel.cloud.treatment import FORCE_FILTER_COUNTS
from taxel.hand.transforms import apply

Progress = Callable[[int, int], None]
"""Called with the number of finished rows and the number of all rows."""

FORCE_THRESHOLDS: Final = (150.0, 160.0, 170.0, 180.0, 190.0, 200.0, 210.0, 230.0, 260.0, 290.0, 320.0)
"""Thresholds of the force filter in Tables I-1 to I-3, counts."""

FIXED_NEIGHBOURS: Final = 20
"""The only number of neighbours N in Tables I-4 to I-6 that does not depend on the size of the cloud."""

ALL_BUT_ONE, HALF, QUARTER = "all but one", "half", "quarter"
"""The other numbers of neighbours N in Tables I-4 to I-6, as shares of the cloud. For the cylinder they are 2759, 1380
and 690 of 2760 points, and correspondingly for the triangular prism. For the rectangular prism they are shares of 2806
points although its cloud has 3069, and Table I-6 prints 143 instead of 1433."""

Rule = tuple[int | str, float]
"""Settings of the outlier filter: N (a number of points or a share of the cloud) and nSigma."""

SOR_RULES: Final[dict[str, tuple[Rule, ...]]] = {
    "rectang": (
        *((FIXED_NEIGHBOURS, sigma) for sigma in (1.0, 2.0, 3.0, 4.0)),
        *((ALL_BUT_ONE, sigma) for sigma in (1.0, 2.0)),
        *((QUARTER, sigma) for sigma in (1.0, 2.0, 3.0, 4.0)),
        *((HALF, sigma) for sigma in (1.0, 2.0, 3.0)),
    ),
    "cylind": (
        *((FIXED_NEIGHBOURS, sigma) for sigma in (1.0, 2.0, 3.0, 4.0)),
        *((ALL_BUT_ONE, sigma) for sigma in (1.0, 2.0)),
        *((QUARTER, sigma) for sigma in (1.0, 2.0, 3.0)),
        *((HALF, sigma) for sigma in (1.0, 2.0)),
    ),
    "triang": (
        *((FIXED_NEIGHBOURS, sigma) for sigma in (1.0, 2.0, 3.0, 4.0)),
        *((ALL_BUT_ONE, sigma) for sigma in (1.0, 2.0)),
        *((QUARTER, sigma) for sigma in (1.0, 2.0, 3.0)),
        *((HALF, sigma) for sigma in (1.0, 2.0, 3.0)),
    ),
}
"""Rules in the order of Tables I-4 to I-6, by the first letters of the object's name.

Other objects use the rules of the first entry.
"""


@dataclass(frozen=True)
class ForceRow:
    """Distances to the model with one threshold of the force filter, a row of Tables I-1 to I-3 of the thesis.

    Lengths in metres, after alignment to the model.
    """

    object: str
    threshold_counts: float
    points: int
    rms_m: float
    max_m: float
    mean_m: float
    std_m: float
    filtered_out_percent: float


@dataclass(frozen=True)
class SorRow:
    """Distances to the model with one setting of the outlier filter, a row of Tables I-4 to I-6 of the thesis.

    Lengths in metres, after alignment to the model. n_neighbors: number of points N of the filter for this cloud.
    """

    object: str
    n_neighbors: int
    n_sigma: float
    points: int
    rms_m: float
    max_m: float
    mean_m: float
    std_m: float
    filtered_out_percent: float


def sweep_force_filter(
    cloud: ContactCloud,
    mesh: TriangleMesh,
    object_name: str,
    thresholds: Sequence[float] = FORCE_THRESHOLDS,
    progress: Progress = lambda done, total: None,
) -> list[ForceRow]:
    """Measure the distances of a cloud to a mesh for several thresholds of the force filter, one row for each.

    thresholds: counts. progress: called with the number of finished rows and the total. Raises RegistrationError for a
    threshold that leaves too few points.
    """
    rows = []
    for done, threshold in enumerate(thresholds):
        progress(done, len(thresholds))
        stats = measure_after_alignment(filter_by_force(cloud, threshold), mesh)
        removed = _percent_removed(stats.points, len(cloud))
        rows.append(ForceRow(object_name, threshold, *_table_columns(stats), removed))
    progress(len(thresholds), len(thresholds))
    return rows


def sweep_outlier_filter(
    cloud: ContactCloud,
    mesh: TriangleMesh,
    object_name: str,
    threshold: float = FORCE_FILTER_COUNTS,
    progress: Progress = lambda done, total: None,
) -> list[SorRow]:
    """Measure the distances of a cloud to a mesh for several settings of the outlier filter, one row for each.

    A setting is a number of neighbours N and a limit nSigma; the settings are those of the thesis for the object
    (`get_sor_rules`). threshold: counts of the force filter that is applied first. Raises CloudError if the cloud has
    fewer points after the force filter than the outlier filter has neighbours (N), and RegistrationError for a setting
    that leaves too few points.
    """
    filtered = filter_by_force(cloud, threshold)
    rules = get_sor_rules(object_name)
    counts = [count_neighbours(share, len(filtered)) for share, _ in rules]
    distinct = sorted(set(counts))
    means = compute_mean_neighbour_distances(filtered.points, distinct, filtered.name)
    rows = []
    for done, (count, (_, sigma)) in enumerate(zip(counts, rules, strict=True)):
        progress(done, len(rules))
        inliers = select_inliers(means[distinct.index(count)], sigma)
        stats = measure_after_alignment(filtered.select(inliers), mesh)
        removed = _percent_removed(stats.points, len(filtered))
        rows.append(SorRow(object_name, count, sigma, *_table_columns(stats), removed))
    progress(len(rules), len(rules))
    return rows


def get_sor_rules(object_name: str) -> tuple[Rule, ...]:
    """Return the settings of statistical outlier removal (SOR) that the thesis lists for an object.

    For an object that is not in the thesis, the settings of the rectangular prism are returned.
    """
    first = next(iter(SOR_RULES.values()))
    return next((rules for start, rules in SOR_RULES.items() if object_name.lower().startswith(start)), first)


def count_neighbours(share: int | str, points: int) -> int:
    """Return the number of neighbours N that the outlier filter uses for a cloud of `points` points.

    share: this number, or a share of the cloud: `ALL_BUT_ONE`, `HALF` or `QUARTER`.
    """
    if isinstance(share, int):
        return share
    return {ALL_BUT_ONE: points - 1, HALF: round(points / 2), QUARTER: round(points / 4)}[share]


def get_distance_stats(row: ForceRow | SorRow) -> DistanceStats:
    """Return the distance statistics of a row of a parameter sweep."""
    return DistanceStats(row.points, row.mean_m, row.std_m, row.max_m, row.rms_m)


def format_csv(rows: Sequence[ForceRow] | Sequence[SorRow]) -> str:
    """Format the rows of a parameter sweep as CSV with a heading; columns as in the tables of the thesis."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(item.name for item in fields(rows[0]))
    for row in rows:
        writer.writerow(f"{value:.9g}" if isinstance(value, float) else value for value in astuple(row))
    return out.getvalue()


def convert_to_json(rows: Sequence[ForceRow] | Sequence[SorRow]) -> list[dict[str, object]]:
    """Convert the rows of a parameter sweep to dictionaries of JSON values."""
    return [asdict(row) for row in rows]


def measure_after_alignment(cloud: ContactCloud, mesh: TriangleMesh) -> DistanceStats:
    """Align a cloud to a mesh from its current pose and compute the statistics of the remaining distances.

    Raises RegistrationError if the alignment fails.
    """
    aligned = apply(align_to_mesh(cloud.points, mesh, name=cloud.name).transform, cloud.points)
    return DistanceStats.from_distances(compute_distances_to_mesh(aligned, mesh, cloud.name))


def _table_columns(stats: DistanceStats) -> tuple[int, float, float, float, float]:
    """Return the distance statistics in the order of the columns of the thesis's tables."""
    return stats.points, stats.rms_m, stats.max_m, stats.mean_m, stats.std_m


def _percent_removed(points: int, before: int) -> float:
    """Compute the percentage of points that a filter removed. points: after the filter. before: before the filter."""
    return 100.0 * (1.0 - points / before)
