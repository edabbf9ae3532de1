"""The thesis's sweeps: how the match with the CAD model changes with the force filter, and with the outlier filter.

Force filter: Tables I-1 to I-3. Statistical outlier removal (SOR) of what the force filter left: Tables I-4 to I-6.
Every row is aligned anew, from the object's frame, as in the thesis.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple, dataclass, fields
from typing import Final

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats, distances_to_mesh
from taxel.cloud.filters import force_filter, kept, mean_neighbour_distances
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import align_to_mesh
from taxel.cloud.treatment import FORCE_FILTER_COUNTS
from taxel.hand.transforms import apply

Show = Callable[[int, int], None]

THRESHOLDS: Final = (150.0, 160.0, 170.0, 180.0, 190.0, 200.0, 210.0, 230.0, 260.0, 290.0, 320.0)
"""Counts, of Tables I-1 to I-3."""

FEW: Final = 20
"""The N of Tables I-4 to I-6 that is a number of points."""

ALL_BUT_ONE, HALF, QUARTER = "all but one", "half", "quarter"
"""The others are shares of the cloud: 2759, 1380 and 690 of the cylinder's 2760 points, and likewise for the triangular
prism; the rectangular prism's are of 2806 (it has 3069), and Table I-6 prints 143 for 1433."""

Rule = tuple[int | str, float]

SOR_RULES: Final[dict[str, tuple[Rule, ...]]] = {
    "rectang": (
        *((FEW, sigma) for sigma in (1.0, 2.0, 3.0, 4.0)),
        *((ALL_BUT_ONE, sigma) for sigma in (1.0, 2.0)),
        *((QUARTER, sigma) for sigma in (1.0, 2.0, 3.0, 4.0)),
        *((HALF, sigma) for sigma in (1.0, 2.0, 3.0)),
    ),
    "cylind": (
        *((FEW, sigma) for sigma in (1.0, 2.0, 3.0, 4.0)),
        *((ALL_BUT_ONE, sigma) for sigma in (1.0, 2.0)),
        *((QUARTER, sigma) for sigma in (1.0, 2.0, 3.0)),
        *((HALF, sigma) for sigma in (1.0, 2.0)),
    ),
    "triang": (
        *((FEW, sigma) for sigma in (1.0, 2.0, 3.0, 4.0)),
        *((ALL_BUT_ONE, sigma) for sigma in (1.0, 2.0)),
        *((QUARTER, sigma) for sigma in (1.0, 2.0, 3.0)),
        *((HALF, sigma) for sigma in (1.0, 2.0, 3.0)),
    ),
}
"""N and nSigma in the order of Tables I-4 to I-6, by the beginning of an object's name; others as the first."""


@dataclass(frozen=True)
class ForceRow:
    """A row of Tables I-1 to I-3; lengths in metres, after alignment to the model."""

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
    """A row of Tables I-4 to I-6; n_neighbors: the N that was taken, of this cloud."""

    object: str
    n_neighbors: int
    n_sigma: float
    points: int
    rms_m: float
    max_m: float
    mean_m: float
    std_m: float
    filtered_out_percent: float


def force_sweep(
    cloud: ContactCloud,
    mesh: TriangleMesh,
    object_name: str,
    thresholds: Sequence[float] = THRESHOLDS,
    show: Show = lambda done, total: None,
) -> list[ForceRow]:
    """One row for each threshold, counts. Raises RegistrationError where a threshold leaves no cloud to align."""
    rows = []
    for done, threshold in enumerate(thresholds):
        show(done, len(thresholds))
        found = matched(force_filter(cloud, threshold), mesh)
        rows.append(ForceRow(object_name, threshold, *_told(found), _percent(found.points, len(cloud))))
    show(len(thresholds), len(thresholds))
    return rows


def sor_sweep(
    cloud: ContactCloud,
    mesh: TriangleMesh,
    object_name: str,
    threshold: float = FORCE_FILTER_COUNTS,
    show: Show = lambda done, total: None,
) -> list[SorRow]:
    """One row for each rule of the object, on the cloud that the force filter leaves. Raises CloudError if that has
    fewer points than an N, RegistrationError if a rule leaves no cloud to align.
    """
    filtered = force_filter(cloud, threshold)
    rules = sor_rules(object_name)
    counts = [neighbours(share, len(filtered)) for share, _ in rules]
    wanted = sorted(set(counts))
    means = mean_neighbour_distances(filtered.points, wanted, filtered.name)
    rows = []
    for done, (count, (_, sigma)) in enumerate(zip(counts, rules, strict=True)):
        show(done, len(rules))
        found = matched(filtered.take(kept(means[wanted.index(count)], sigma)), mesh)
        rows.append(SorRow(object_name, count, sigma, *_told(found), _percent(found.points, len(filtered))))
    show(len(rules), len(rules))
    return rows


def sor_rules(object_name: str) -> tuple[Rule, ...]:
    """The rules of an object's table."""
    first = next(iter(SOR_RULES.values()))
    return next((rules for start, rules in SOR_RULES.items() if object_name.lower().startswith(start)), first)


def neighbours(share: int | str, points: int) -> int:
    """N in a cloud of so many points."""
    if isinstance(share, int):
        return share
    return {ALL_BUT_ONE: points - 1, HALF: round(points / 2), QUARTER: round(points / 4)}[share]


def stats_of(row: ForceRow | SorRow) -> DistanceStats:
    """The distances of a row."""
    return DistanceStats(row.points, row.mean_m, row.std_m, row.max_m, row.rms_m)


def to_csv(rows: Sequence[ForceRow] | Sequence[SorRow]) -> str:
    """The rows as CSV with a heading; columns as in the thesis's tables."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(item.name for item in fields(rows[0]))
    for row in rows:
        writer.writerow(f"{value:.9g}" if isinstance(value, float) else value for value in astuple(row))
    return out.getvalue()


def as_json(rows: Sequence[ForceRow] | Sequence[SorRow]) -> list[dict[str, object]]:
    """The rows as plain values."""
    return [asdict(row) for row in rows]


def matched(cloud: ContactCloud, mesh: TriangleMesh) -> DistanceStats:
    """Distances to a model after alignment from where the cloud is. Raises RegistrationError where that fails."""
    placed = apply(align_to_mesh(cloud.points, mesh, name=cloud.name).transform, cloud.points)
    return DistanceStats.of(distances_to_mesh(placed, mesh, cloud.name))


def _told(stats: DistanceStats) -> tuple[int, float, float, float, float]:
    """In the order of the thesis's columns."""
    return stats.points, stats.rms_m, stats.max_m, stats.mean_m, stats.std_m


def _percent(points: int, before: int) -> float:
    return 100.0 * (1.0 - points / before)
