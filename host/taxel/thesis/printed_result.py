"""The printed numbers of an object of the thesis in the form of measured results."""

from collections.abc import Mapping
from functools import cache
from typing import Any

from taxel.cloud.distance import DistanceStats
from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM, SPREAD
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.printed import (
    FORCE_FILTER,
    OBJECTS,
    PRINTED_SOR,
    TITLES,
    get_distances,
    select_rows,
)


@cache
def build_printed_results() -> tuple[ObjectResult, ...]:
    """Build the results that the thesis prints, for each object in the order of its appendix.

    They contain no iterations, prevalence and line shares.
    """
    return tuple(_build_printed_result(name) for name in OBJECTS)


def _build_printed_result(name: str) -> ObjectResult:
    """Build the results that the thesis prints for one object. name: printed name in the appendix."""
    force = {int(row["threshold_counts"]): _parse_stats(row) for row in select_rows("I_1_to_3_force_filter", name)}
    sor = {(int(row["n_neighbors"]), row["n_sigma"]): _parse_stats(row) for row in select_rows("I_4_to_6_sor", name)}
    sim, spread = (_parse_stats(row) for row in select_rows("I_7_to_9_simulation_cad", name))
    stages = select_rows("I_10_to_12_sim_to_real", name)
    clouds = {
        REAL: force[min(force)],
        FILTERED: force[FORCE_FILTER],
        CLEANED: sor[PRINTED_SOR[name]],
        SIM: sim,
        SPREAD: spread,
    }
    points = {REAL: clouds[CLEANED].points, SIM: clouds[SPREAD].points}
    cross = {
        (str(row["cloud_source"]), str(row["cad_object"])): _parse_stats(row, points[row["cloud_source"]])
        for row in select_rows("I_13_to_18_cross_shape", name, "cloud_object")
    }
    (count,) = select_rows("5_2_contact_points", TITLES[name])
    return ObjectResult(
        name,
        name,
        int(count["grasps"]),
        clouds,
        force,
        sor,
        {n: n for n, _ in sor},
        {str(row["stage"]): _parse_stats(row, int(row["real_points"])) for row in stages},
        {str(row["stage"]): int(row["sim_points"]) for row in stages},
        cross,
    )


def _parse_stats(row: Mapping[str, Any], points: int | None = None) -> DistanceStats:
    """Return the statistics of a printed row. points: number of points if the row has no such column."""
    return DistanceStats(int(row["points"]) if points is None else points, **get_distances(row))
