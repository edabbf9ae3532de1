"""The thesis's tables (5.2 to 5.5, I-1 to I-18) from our results: our figure, the thesis's, and the ratio."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from taxel.cloud.distance import DistanceStats
from taxel.thesis.matching import CLEANED, FILTERED, REAL, SIM, SPREAD, ObjectResult
from taxel.thesis.printed import OBJECTS, ORIGINAL, PROPAGATED, SOR_OF, STAGES, match_of, rows_of

MATCH: Final = ("points", "rms_m", "max_m", "mean_m", "std_m")
TWO: Final = ("rms_m", "mean_m")
REMOVED: Final = "removed_percent"


@dataclass(frozen=True)
class Row:
    """key: what the row is about. ours, thesis: figures by column; None where there is none."""

    key: tuple[str, ...]
    ours: Mapping[str, float | None]
    thesis: Mapping[str, float | None]

    def ratio(self, column: str) -> float | None:
        """Ours over the thesis's."""
        ours, thesis = self.ours.get(column), self.thesis.get(column)
        return ours / thesis if ours is not None and thesis else None


@dataclass(frozen=True)
class Table:
    """number: as in the thesis. keys: names of the rows' keys. columns: figures, with their unit."""

    number: str
    title: str
    keys: tuple[str, ...]
    columns: tuple[str, ...]
    rows: tuple[Row, ...]

    @property
    def file_name(self) -> str:
        """Of its CSV."""
        return f"table_{self.number.replace('-', '_').replace('.', '_')}.csv"

    def write(self, path: Path) -> None:
        """One line a row: keys, then ours, thesis and ratio of each column."""
        with path.open("w", encoding="utf-8", newline="") as file:
            out = csv.writer(file)
            out.writerow([*self.keys, *(f"{name}_{kind}" for name in self.columns for kind in KINDS)])
            for row in self.rows:
                figures = (
                    value
                    for name in self.columns
                    for value in (row.ours.get(name), row.thesis.get(name), row.ratio(name))
                )
                out.writerow([*row.key, *("" if value is None else f"{value:.6g}" for value in figures)])


KINDS: Final = ("ours", "thesis", "ratio")


def all_tables(results: Sequence[ObjectResult]) -> list[Table]:
    """In the thesis's order. results: of the objects that the thesis has, in its order."""
    return [
        _points(results),
        _before(results),
        *(_force(one, number) for number, one in _numbered(results, 1)),
        *(_sor(one, number) for number, one in _numbered(results, 4)),
        _best_sor(results),
        *(_simulation(one, number) for number, one in _numbered(results, 7)),
        _propagation(results),
        *(_to_sim(one, number) for number, one in _numbered(results, 10)),
        _contributions(results),
        *(
            _cross(one, side, cloud, number + place)
            for number, one in zip((13, 15, 17), results, strict=False)
            for place, (side, cloud) in enumerate(((REAL, CLEANED), (SIM, SPREAD)))
        ),
    ]


def _numbered(results: Sequence[ObjectResult], first: int) -> Iterable[tuple[int, ObjectResult]]:
    return ((first + OBJECTS.index(one.thesis), one) for one in results)


def _points(results: Sequence[ObjectResult]) -> Table:
    columns = ("grasps", "real_points", "sim_points", "real_over_sim")
    rows = []
    for one in results:
        (row,) = rows_of("5_2_contact_points", PRINTED_NAMES[one.thesis])
        thesis = {name: float(row[name]) for name in columns[:3]}
        ours = dict(zip(columns, (one.grasps, one.cad[REAL].points, one.cad[SIM].points), strict=False))
        rows.append(Row((one.thesis,), _with_ratio(ours), _with_ratio(thesis)))
    return Table("5.2", "Contact points of all grasps", ("object",), columns, tuple(rows))


PRINTED_NAMES: Final = dict(zip(OBJECTS, ("Rectangular prism", "Cylinder", "Triangular prism"), strict=True))


def _with_ratio(points: Mapping[str, float]) -> dict[str, float | None]:
    return {**points, "real_over_sim": points["real_points"] / max(points["sim_points"], 1.0)}


def _before(results: Sequence[ObjectResult]) -> Table:
    rows = []
    for one in results:
        force = rows_of("I_1_to_3_force_filter", one.thesis)[0]
        sim = rows_of("I_7_to_9_simulation_cad", one.thesis)[0]
        for side, printed in ((REAL, force), (SIM, sim)):
            rows.append(
                Row((one.thesis, side), _two(one.cad[side]), {k: float(printed[k]) for k in ("rms_m", "mean_m")})
            )
    return Table("5.3", "Clouds on their CAD models before any treatment", ("object", "side"), TWO, tuple(rows))


def _two(match: DistanceStats) -> dict[str, float]:
    return {"rms_m": match.rms_m, "mean_m": match.mean_m}


def _force(one: ObjectResult, number: int) -> Table:
    rows = []
    for row in rows_of("I_1_to_3_force_filter", one.thesis):
        match = one.force[int(row["threshold_counts"])]
        thesis = {"points": row["points"], **match_of(row), REMOVED: row["filtered_out_percent"]}
        rows.append(Row((f"{row['threshold_counts']:g}",), _removing(match, one.cad[REAL].points), thesis))
    title = f"Force filter, {one.thesis}: the real cloud on its CAD model"
    return Table(f"I-{number}", title, ("threshold_counts",), (*MATCH, REMOVED), tuple(rows))


def _sor(one: ObjectResult, number: int) -> Table:
    rows = []
    for row in rows_of("I_4_to_6_sor", one.thesis):
        n, sigma = int(row["n_neighbors"]), float(row["n_sigma"])
        thesis = {"points": row["points"], **match_of(row), REMOVED: row["filtered_out_percent"]}
        key = (f"{n}", f"{one.neighbours[n]}", f"{sigma:g}")
        rows.append(Row(key, _removing(one.sor[n, sigma], one.cad[FILTERED].points), thesis))
    title = f"SOR after the force filter, {one.thesis}: the real cloud on its CAD model"
    return Table(f"I-{number}", title, ("n_thesis", "n_ours", "n_sigma"), (*MATCH, REMOVED), tuple(rows))


def _removing(match: DistanceStats, before: int) -> dict[str, float | None]:
    return {**asdict(match), REMOVED: 100.0 * (1.0 - match.points / max(before, 1))}


def _best_sor(results: Sequence[ObjectResult]) -> Table:
    rows = [
        Row(
            (one.thesis,),
            dict(zip(("n", "n_sigma"), best_sor(one), strict=True)),
            dict(zip(("n", "n_sigma"), SOR_OF[one.thesis], strict=True)),
        )
        for one in results
    ]
    title = "SOR settings with the smallest mean distance (N as the thesis counts; shares of the cloud above 20)"
    return Table("5.4", title, ("object",), ("n", "n_sigma"), tuple(rows))


def best_sor(one: ObjectResult) -> tuple[int, float]:
    """The settings of the sweep with the smallest mean distance to the CAD model; the first of several."""
    return min(one.sor, key=lambda key: one.sor[key].mean_m)


def _simulation(one: ObjectResult, number: int) -> Table:
    printed = {row["stage"]: row for row in rows_of("I_7_to_9_simulation_cad", one.thesis)}
    rows = tuple(
        Row((stage,), asdict(one.cad[cloud]), {"points": printed[stage]["points"], **match_of(printed[stage])})
        for stage, cloud in ((ORIGINAL, SIM), (PROPAGATED, SPREAD))
    )
    return Table(f"I-{number}", f"Simulated clouds on their CAD model, {one.thesis}", ("stage",), MATCH, rows)


def _propagation(results: Sequence[ObjectResult]) -> Table:
    rows = []
    for one in results:
        printed = rows_of("I_7_to_9_simulation_cad", one.thesis)
        for row, cloud in zip(printed, (SIM, SPREAD), strict=True):
            rows.append(Row((one.thesis, row["stage"]), _two(one.cad[cloud]), {key: row[key] for key in TWO}))
    title = "Simulated clouds before and after contact propagation"
    return Table("5.5", title, ("object", "stage"), TWO, tuple(rows))


def _to_sim(one: ObjectResult, number: int) -> Table:
    rows = []
    for row in rows_of("I_10_to_12_sim_to_real", one.thesis):
        match, thesis = one.to_sim[row["stage"]], match_of(row)
        ours = {**asdict(match), "sim_points": float(one.sim_points[row["stage"]])}
        rows.append(
            Row((row["stage"],), ours, {"points": row["real_points"], "sim_points": row["sim_points"], **thesis})
        )
    columns = ("points", "sim_points", *MATCH[1:])
    return Table(f"I-{number}", f"Real on simulated cloud, {one.thesis}", ("stage",), columns, tuple(rows))


def _contributions(results: Sequence[ObjectResult]) -> Table:
    rows = []
    for one in results:
        printed = {row["stage"]: float(row["mean_m"]) for row in rows_of("I_10_to_12_sim_to_real", one.thesis)}
        ours = {stage: one.to_sim[stage].mean_m for stage in STAGES}
        for stage, mine, thesis in zip(STAGES[1:], contributions(ours), contributions(printed), strict=True):
            rows.append(Row((one.thesis, stage), {"share_percent": mine}, {"share_percent": thesis}))
    title = "Share of each step in the fall of the mean distance between real and simulated cloud (Figure 5.13)"
    return Table("5.13", title, ("object", "stage"), ("share_percent",), tuple(rows))


def contributions(by_stage: Mapping[str, float]) -> list[float]:
    """Percent of the whole fall that each step after the first stage has; zeros where nothing fell."""
    values = [by_stage[stage] for stage in STAGES]
    whole = values[0] - values[-1]
    return [100.0 * (values[k] - values[k + 1]) / whole if whole > 0 else 0.0 for k in range(len(values) - 1)]


def _cross(one: ObjectResult, side: str, cloud: str, number: int) -> Table:
    rows = []
    for row in rows_of("I_13_to_18_cross_shape", one.thesis, "cloud_object"):
        if row["cloud_source"] == side and (side, row["cad_object"]) in one.cross:
            rows.append(Row((row["cad_object"],), asdict(one.cross[side, row["cad_object"]]), match_of(row)))
    title = f"The {one.thesis} object's cloud ({cloud}) on all CAD models"
    return Table(f"I-{number}", title, ("cad",), MATCH, tuple(rows))
