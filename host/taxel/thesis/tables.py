"""The tables of the thesis (5.1 to 5.5, 5.13, I-1 to I-18): reproduced value, printed value, and their ratio."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from taxel.cloud.distance import DistanceStats
from taxel.output import open_whole_text
from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM, SPREAD
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.printed import (
    OBJECTS,
    ORIGINAL,
    PRINTED_SOR,
    PROPAGATED,
    STAGES,
    TITLES,
    get_distances,
    select_rows,
)

MATCH: Final = ("points", "rms_m", "max_m", "mean_m", "std_m")
RMS_AND_MEAN: Final = ("rms_m", "mean_m")
REMOVED: Final = "removed_percent"


@dataclass(frozen=True)
class Row:
    """A row of a reproduced table.

    key: entries of the key columns, which identify the row. values, printed_values: reproduced and printed values by
    name of the column; None for a missing value.
    """

    key: tuple[str, ...]
    values: Mapping[str, float | None]
    printed_values: Mapping[str, float | None]

    def ratio(self, column: str) -> float | None:
        """Return the reproduced value of a column divided by the printed value; None if one of them is missing."""
        value, printed = self.values.get(column), self.printed_values.get(column)
        return value / printed if value is not None and printed else None


@dataclass(frozen=True)
class Table:
    """A reproduced table of the thesis.

    number: number of the table in the thesis. keys: headings of the key columns. columns: names of the columns with
    values, with units.
    """

    number: str
    title: str
    keys: tuple[str, ...]
    columns: tuple[str, ...]
    rows: tuple[Row, ...]

    @property
    def file_name(self) -> str:
        """Name of the CSV file."""
        return f"table_{self.number.replace('-', '_').replace('.', '_')}.csv"

    def write(self, path: Path) -> None:
        """Write the table as CSV: row keys, then reproduced value, printed value and ratio of each column."""
        with open_whole_text(path) as file:
            out = csv.writer(file)
            out.writerow([*self.keys, *(f"{name}_{kind}" for name in self.columns for kind in CSV_KINDS)])
            for row in self.rows:
                values = (
                    value
                    for name in self.columns
                    for value in (row.values.get(name), row.printed_values.get(name), row.ratio(name))
                )
                out.writerow([*row.key, *("" if value is None else f"{value:.6g}" for value in values)])


CSV_KINDS: Final = ("ours", "thesis", "ratio")
"""Suffixes of the columns in CSV files: reproduced value, printed value, ratio."""


def build_tables(results: Sequence[ObjectResult]) -> list[Table]:
    """Build all tables of the reproduction. results: results of the objects, in the order of the thesis."""
    return [
        _build_grasps(results),
        _build_points(results),
        _build_untreated(results),
        *(_build_force(result, number) for number, result in _number_tables(results, 1)),
        *(_build_sor(result, number) for number, result in _number_tables(results, 4)),
        _build_best_sor(results),
        *(_build_simulation(result, number) for number, result in _number_tables(results, 7)),
        _build_propagation(results),
        *(_build_to_sim(result, number) for number, result in _number_tables(results, 10)),
        _build_contributions(results),
        *(
            _build_cross(result, side, cloud, number + position)
            for number, result in zip((13, 15, 17), results, strict=False)
            for position, (side, cloud) in enumerate(((REAL, CLEANED), (SIM, SPREAD)))
        ),
    ]


def _number_tables(results: Sequence[ObjectResult], first: int) -> Iterable[tuple[int, ObjectResult]]:
    """Yield (table number, result) for each object. first: number of the table of the thesis's first object."""
    return ((first + OBJECTS.index(result.printed_name), result) for result in results)


def _build_grasps(results: Sequence[ObjectResult]) -> Table:
    """Build Table 5.1 of the thesis: number of grasps (iterations) of each approach.

    The dataset's name of an approach is that of the thesis in lower case, without "face" and with "_" for each space.
    """
    rows = []
    for result in results:
        for row in select_rows("5_1_grasps", TITLES[result.printed_name]):
            name = str(row["approach"]).lower().replace(" face", "").replace(" ", "_")
            iterations = {"iterations": _count_or_none(result, name)}
            rows.append(Row((result.printed_name, str(row["approach"])), iterations, {"iterations": row["iterations"]}))
    return Table("5.1", "Grasps of the experiments", ("object", "approach"), ("iterations",), tuple(rows))


def _count_or_none(result: ObjectResult, approach: str) -> float | None:
    """Return the number of grasps of an approach; None for an approach that the dataset does not contain."""
    count = result.iterations.get(approach)
    return None if count is None else float(count)


def _build_points(results: Sequence[ObjectResult]) -> Table:
    """Build Table 5.2 of the thesis: contact points of all grasps."""
    columns = ("grasps", "real_points", "sim_points", "real_over_sim")
    rows = []
    for result in results:
        (row,) = select_rows("5_2_contact_points", TITLES[result.printed_name])
        printed = {name: float(row[name]) for name in columns[:3]}
        counts = (result.grasps, result.cad[REAL].points, result.cad[SIM].points)
        values = dict(zip(columns, counts, strict=False))
        rows.append(Row((result.printed_name,), _add_ratio(values), _add_ratio(printed)))
    return Table("5.2", "Contact points of all grasps", ("object",), columns, tuple(rows))


def _add_ratio(points: Mapping[str, float]) -> dict[str, float | None]:
    """Add the ratio of real to simulated points to the numbers of points."""
    return {**points, "real_over_sim": points["real_points"] / max(points["sim_points"], 1.0)}


def _build_untreated(results: Sequence[ObjectResult]) -> Table:
    """Build Table 5.3 of the thesis: distances of the untreated clouds to the CAD models.

    The first rows of Tables I-1 to I-3 and I-7 to I-9 contain the printed values of the untreated clouds.
    """
    rows = []
    for result in results:
        force = select_rows("I_1_to_3_force_filter", result.printed_name)[0]
        sim = select_rows("I_7_to_9_simulation_cad", result.printed_name)[0]
        for side, row in ((REAL, force), (SIM, sim)):
            printed = {key: float(row[key]) for key in RMS_AND_MEAN}
            rows.append(Row((result.printed_name, side), _rms_and_mean(result.cad[side]), printed))
    return Table(
        "5.3", "Clouds on their CAD models before any treatment", ("object", "side"), RMS_AND_MEAN, tuple(rows)
    )


def _rms_and_mean(stats: DistanceStats) -> dict[str, float]:
    """Return RMS and mean of the distances, metres, by column name."""
    return {"rms_m": stats.rms_m, "mean_m": stats.mean_m}


def _build_force(result: ObjectResult, number: int) -> Table:
    """Build one of Tables I-1 to I-3 of the thesis: effect of the force filter on the real cloud of an object."""
    rows = []
    for row in select_rows("I_1_to_3_force_filter", result.printed_name):
        stats = result.force[int(row["threshold_counts"])]
        printed = {"points": row["points"], **get_distances(row), REMOVED: row["filtered_out_percent"]}
        rows.append(Row((f"{row['threshold_counts']:g}",), _add_removed(stats, result.cad[REAL].points), printed))
    title = f"Force filter, {result.printed_name}: the real cloud on its CAD model"
    return Table(f"I-{number}", title, ("threshold_counts",), (*MATCH, REMOVED), tuple(rows))


def _build_sor(result: ObjectResult, number: int) -> Table:
    """Build one of Tables I-4 to I-6 of the thesis: effect of the outlier filter on the real cloud of an object."""
    rows = []
    for row in select_rows("I_4_to_6_sor", result.printed_name):
        n, sigma = int(row["n_neighbors"]), float(row["n_sigma"])
        printed = {"points": row["points"], **get_distances(row), REMOVED: row["filtered_out_percent"]}
        key = (f"{n}", f"{result.neighbours[n]}", f"{sigma:g}")
        rows.append(Row(key, _add_removed(result.sor[n, sigma], result.cad[FILTERED].points), printed))
    title = f"SOR after the force filter, {result.printed_name}: the real cloud on its CAD model"
    return Table(f"I-{number}", title, ("n_thesis", "n_ours", "n_sigma"), (*MATCH, REMOVED), tuple(rows))


def _add_removed(stats: DistanceStats, points_before: int) -> dict[str, float | None]:
    """Return the statistics with the share of removed points in percent. points_before: points before the filter."""
    return {**asdict(stats), REMOVED: 100.0 * (1.0 - stats.points / max(points_before, 1))}


def _build_best_sor(results: Sequence[ObjectResult]) -> Table:
    """Build Table 5.4 of the thesis: the outlier filter settings with the smallest mean distance for each object."""
    rows = [
        Row(
            (result.printed_name,),
            dict(zip(("n", "n_sigma"), find_best_sor(result), strict=True)),
            dict(zip(("n", "n_sigma"), PRINTED_SOR[result.printed_name], strict=True)),
        )
        for result in results
    ]
    title = "SOR settings with the smallest mean distance (printed values of N; above 20 they are shares of the cloud)"
    return Table("5.4", title, ("object",), ("n", "n_sigma"), tuple(rows))


def find_best_sor(result: ObjectResult) -> tuple[int, float]:
    """Return the first settings (N, nSigma) of the outlier filter with the smallest mean distance to the CAD model."""
    return min(result.sor, key=lambda key: result.sor[key].mean_m)


def _build_simulation(result: ObjectResult, number: int) -> Table:
    """Build one of Tables I-7 to I-9 of the thesis: simulated cloud before and after contact propagation."""
    printed = {row["stage"]: row for row in select_rows("I_7_to_9_simulation_cad", result.printed_name)}
    rows = tuple(
        Row((stage,), asdict(result.cad[cloud]), {"points": printed[stage]["points"], **get_distances(printed[stage])})
        for stage, cloud in ((ORIGINAL, SIM), (PROPAGATED, SPREAD))
    )
    return Table(f"I-{number}", f"Simulated clouds on their CAD model, {result.printed_name}", ("stage",), MATCH, rows)


def _build_propagation(results: Sequence[ObjectResult]) -> Table:
    """Build Table 5.5 of the thesis: distances of the simulated clouds to CAD before and after contact propagation."""
    rows = []
    for result in results:
        printed = select_rows("I_7_to_9_simulation_cad", result.printed_name)
        for row, cloud in zip(printed, (SIM, SPREAD), strict=True):
            printed_values = {key: row[key] for key in RMS_AND_MEAN}
            rows.append(Row((result.printed_name, row["stage"]), _rms_and_mean(result.cad[cloud]), printed_values))
    title = "Simulated clouds before and after contact propagation"
    return Table("5.5", title, ("object", "stage"), RMS_AND_MEAN, tuple(rows))


def _build_to_sim(result: ObjectResult, number: int) -> Table:
    """Build one of Tables I-10 to I-12 of the thesis: distances from real to simulated cloud at each treatment
    stage.
    """
    rows = []
    for row in select_rows("I_10_to_12_sim_to_real", result.printed_name):
        stats = result.to_sim[row["stage"]]
        values = {**asdict(stats), "sim_points": float(result.sim_points[row["stage"]])}
        printed = {"points": row["real_points"], "sim_points": row["sim_points"], **get_distances(row)}
        rows.append(Row((row["stage"],), values, printed))
    columns = ("points", "sim_points", *MATCH[1:])
    return Table(f"I-{number}", f"Real on simulated cloud, {result.printed_name}", ("stage",), columns, tuple(rows))


def _build_contributions(results: Sequence[ObjectResult]) -> Table:
    """Build Figure 5.13 of the thesis as a table: share of each step in the decrease of the mean distance."""
    rows = []
    for result in results:
        printed_rows = select_rows("I_10_to_12_sim_to_real", result.printed_name)
        printed_means = {row["stage"]: float(row["mean_m"]) for row in printed_rows}
        means = {stage: result.to_sim[stage].mean_m for stage in STAGES}
        shares = zip(STAGES[1:], compute_contributions(means), compute_contributions(printed_means), strict=True)
        for stage, value, printed in shares:
            rows.append(Row((result.printed_name, stage), {"share_percent": value}, {"share_percent": printed}))
    title = "Share of each step in the decrease of the mean distance between real and simulated cloud (Figure 5.13)"
    return Table("5.13", title, ("object", "stage"), ("share_percent",), tuple(rows))


def compute_contributions(by_stage: Mapping[str, float]) -> list[float]:
    """Compute the share of each treatment step in the total decrease of a distance, percent, in the order of the steps.

    by_stage: distance at each stage of the treatment (`STAGES`). All shares are 0 if the distance does not decrease.
    """
    values = [by_stage[stage] for stage in STAGES]
    total = values[0] - values[-1]
    return [100.0 * (values[k] - values[k + 1]) / total if total > 0 else 0.0 for k in range(len(values) - 1)]


def _build_cross(result: ObjectResult, side: str, cloud: str, number: int) -> Table:
    """Build one of Tables I-13 to I-18 of the thesis: distances of one cloud of an object to the CAD models of all
    objects.

    side: "real" or "sim". cloud: name of the cloud in the title. number: number of the table.
    """
    rows = []
    for row in select_rows("I_13_to_18_cross_shape", result.printed_name, "cloud_object"):
        key = (side, row["cad_object"])
        if row["cloud_source"] == side and key in result.cross:
            rows.append(Row((row["cad_object"],), asdict(result.cross[key]), get_distances(row)))
    title = f"Cloud of the {result.printed_name} object ({cloud}) on all CAD models"
    return Table(f"I-{number}", title, ("cad",), MATCH, tuple(rows))
