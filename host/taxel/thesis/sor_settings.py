"""Settings of the outlier filter (SOR) that are best for one object, and one setting for all objects."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from taxel.cloud.distance import DistanceStats
from taxel.cloud.sweep import FIXED_NEIGHBOURS, count_neighbours, get_sor_rules
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.printed import select_rows

PRINTED_RESOLUTION_M: Final = 1e-5
"""Resolution of the printed distances, metres."""


@dataclass(frozen=True)
class Setting:
    """Setting of the outlier filter. neighbours: N, as a number of points or as the name of a share of the cloud."""

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
    """Return the object's distances in Tables I-4 to I-6 by setting; empty for a result without these tables.

    The tables print N as a number of points; `Setting` states it as a share of the cloud, which is comparable between
    objects.
    """
    rules = get_sor_rules(result.printed_name)
    rows = select_rows("I_4_to_6_sor", result.printed_name)
    keys = [(int(row["n_neighbors"]), float(row["n_sigma"])) for row in rows]
    pairs = zip(rules, keys, strict=True)
    return {Setting(*rule): result.sor[key] for rule, key in pairs if key in result.sor}


def find_best_setting(result: ObjectResult) -> Setting:
    """Find the setting with the smallest mean distance to the CAD model, at the printed resolution.

    The thesis selected by mean and RMS (5.6.2): of settings with equal means, the one with the smaller RMS is selected,
    then the one with the smaller maximum.
    """
    rows = get_setting_rows(result)
    return min(rows, key=lambda setting: _round(rows[setting]))


def _round(stats: DistanceStats) -> tuple[int, int, int]:
    """Return mean, RMS and maximum as rounded multiples of the printed resolution."""
    values = (stats.mean_m, stats.rms_m, stats.max_m)
    mean, rms, largest = (round(value / PRINTED_RESOLUTION_M) for value in values)
    return mean, rms, largest


def find_common_setting(results: Sequence[ObjectResult]) -> Setting | None:
    """Find the best setting among those that the thesis prints for all objects; None if there is no such setting.

    The RMS of each object is divided by its smallest RMS over all settings; the setting with the smallest maximum of
    this ratio over the objects is the best.
    """
    tables = [get_setting_rows(result) for result in results]
    common = [setting for setting in tables[0] if all(setting in rows for rows in tables[1:])]
    if not common:
        return None
    best = [min(stats.rms_m for stats in rows.values()) for rows in tables]
    return min(common, key=lambda s: max(rows[s].rms_m / low for rows, low in zip(tables, best, strict=True)))
