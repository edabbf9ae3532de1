"""Settings of the outlier filter (SOR) that are best for one object, and one setting for all objects."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from taxel.cloud.distance import DistanceStats
from taxel.cloud.sweep import FIXED_NEIGHBOURS, count_neighbours, get_sor_rules
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.printed import select_rows

PRINTED_RESOLUTION_M: Final = 1e-5
"""Resolution of the printed distances."""


@dataclass(frozen=True)
class Setting:
    """Setting of the outlier filter. neighbours: N as a number of points or a share of the cloud by name."""

    neighbours: int | str
    n_sigma: float

    @property
    def is_small_n(self) -> bool:
        """Whether N is the printed number of points, 20, and not a share of the cloud."""
        return self.neighbours == FIXED_NEIGHBOURS

    def compute_share(self, points: int) -> float:
        """Compute N in percent of a cloud of `points` points."""
        return 100.0 * count_neighbours(self.neighbours, max(points, 1)) / max(points, 1)


def get_setting_rows(result: ObjectResult) -> dict[Setting, DistanceStats]:
    """Return the rows of Tables I-4 to I-6 of an object by setting; empty without the sweep.

    The printed N are numbers of points; the same share of the cloud is another number for each object.
    """
    rules = get_sor_rules(result.printed_name)
    rows = select_rows("I_4_to_6_sor", result.printed_name)
    keys = [(int(row["n_neighbors"]), float(row["n_sigma"])) for row in rows]
    pairs = zip(rules, keys, strict=True)
    return {Setting(*rule): result.sor[key] for rule, key in pairs if key in result.sor}


def find_best_setting(result: ObjectResult) -> Setting:
    """Find the setting with the smallest mean distance to the CAD model, at the printed resolution.

    The thesis selected by mean and RMS (5.6.2): of equal means the smaller RMS is selected, then the smaller maximum.
    """
    rows = get_setting_rows(result)
    return min(rows, key=lambda setting: _round(rows[setting]))


def _round(stats: DistanceStats) -> tuple[int, int, int]:
    """Return mean, RMS and maximum in units of the printed resolution."""
    values = (stats.mean_m, stats.rms_m, stats.max_m)
    mean, rms, largest = (round(value / PRINTED_RESOLUTION_M) for value in values)
    return mean, rms, largest


def find_common_setting(results: Sequence[ObjectResult]) -> Setting | None:
    """Find the printed setting whose largest RMS over the objects, relative to the smallest of the object, is smallest.

    Only settings that the thesis prints for all objects take part. Returns None without the sweep.
    """
    tables = [get_setting_rows(result) for result in results]
    common = [setting for setting in tables[0] if all(setting in rows for rows in tables[1:])]
    if not common:
        return None
    best = [min(stats.rms_m for stats in rows.values()) for rows in tables]
    return min(common, key=lambda s: max(rows[s].rms_m / low for rows, low in zip(tables, best, strict=True)))
