"""The thesis's figures 5.6 to 5.14 from our results, as PNG files. Where a figure holds numbers, its own are pale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import PointTarget, align_to_mesh, align_to_points
from taxel.hand.transforms import apply
from taxel.thesis.matching import CLEANED, FILTERED, REAL, SIM, SPREAD, ObjectClouds, ObjectResult
from taxel.thesis.printed import OBJECTS, STAGES, rows_of
from taxel.thesis.tables import contributions
from taxel.types import FloatArray

COLOURS: Final = {REAL: "#d9772b", SIM: "#5d3a9b", FILTERED: "#c9a227", CLEANED: "#3d8f5f", SPREAD: "#1f5fa8"}
EDGE, PALE, INK = "#9aa1ad", 0.35, "#1b1d22"
VIEW: Final = (18.0, -60.0)
STEP_COLOURS: Final = ("#c9a227", "#3d8f5f", "#1f5fa8")
STEP_INKS: Final = (INK, "white", "white")
SHORT: Final = ("raw", "force\nfilter", "and SOR", "and contact\npropagation")

FIGURES: Final = {
    "5.6": "Accumulated clouds before any treatment",
    "5.7": "Clouds on their CAD models",
    "5.8": "Real on simulated clouds",
    "5.9": "The treatment, and the points that it leaves",
    "5.10": "Force filter: distances to the CAD models",
    "5.11": "The rectangular prism's clouds as the treatment goes on",
    "5.12": "Distances between real and simulated clouds, step by step",
    "5.13": "Share of each step in the fall of the mean distance",
    "5.14": "Treated clouds on all CAD models",
}


def save_figures(items: Sequence[ObjectClouds], results: Sequence[ObjectResult], out: Path) -> dict[str, Path]:
    """Draw all; files by the thesis's number. items, results: in the thesis's order of objects."""
    drawn = {
        "5.6": _accumulated(items),
        "5.7": _on_cad(items),
        "5.8": _on_sim(items),
        "5.9": _treatment(results),
        "5.10": _force(results),
        "5.11": _progress(items[0]),
        "5.12": _stages(results),
        "5.13": _shares(results),
        "5.14": _cross(results),
    }
    paths = {}
    for number, figure in drawn.items():
        paths[number] = out / f"figure_{number.replace('.', '_')}.png"
        figure.savefig(paths[number], dpi=110, facecolor="white")
    return paths


def _figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure  # here: it takes a second that other commands need not wait

    return Figure(figsize=(width, height), layout="constrained")


def _clouds(axis: Any, clouds: Mapping[str, tuple[FloatArray, str]], mesh: TriangleMesh | None, title: str) -> None:
    every = [points for points, _ in clouds.values()] + ([mesh.vertices] if mesh is not None else [])
    low, high = (1e3 * f(np.concatenate(every), axis=0) for f in (np.min, np.max))
    middle, half = 0.5 * (low + high), 0.5 * float((high - low).max())
    if mesh is not None:
        for corners in _edges(mesh):
            axis.plot(*(1e3 * corners.T), color=EDGE, linewidth=0.8)
    for label, (points, colour) in clouds.items():
        axis.scatter(*(1e3 * points.T), s=2.5, c=colour, alpha=0.5, linewidths=0, label=label)
    axis.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half))
    axis.set_zlim(middle[2] - half, middle[2] + half)
    axis.set_box_aspect((1, 1, 1), zoom=0.92)
    axis.view_init(*VIEW)
    axis.set_title(title, fontsize=10, y=0.98)
    axis.tick_params(labelsize=6)
    axis.set_xlabel("mm", fontsize=7)


SHARP_COS: Final = 0.9


def _edges(mesh: TriangleMesh) -> list[FloatArray]:
    """Edges between faces of different directions, f64[2, 3] each: of a round side only the rims."""
    owners: dict[tuple[int, int], list[int]] = {}
    for number, face in enumerate(mesh.faces.tolist()):
        for first, second in ((0, 1), (1, 2), (2, 0)):
            owners.setdefault((min(face[first], face[second]), max(face[first], face[second])), []).append(number)
    normals = mesh.normals
    sharp = [key for key, faces in owners.items() if normals[faces[0]] @ normals[faces[-1]] < SHARP_COS]
    return [mesh.vertices[list(key)] for key in sharp]


def _accumulated(items: Sequence[ObjectClouds]) -> Any:
    figure = _figure(4.0 * len(items), 7.6)
    for column, item in enumerate(items):
        for row, name in enumerate((REAL, SIM)):
            axis = figure.add_subplot(2, len(items), row * len(items) + column + 1, projection="3d")
            cloud = item.clouds[name]
            title = f"{item.thesis}, {name}: {len(cloud)} points"
            _clouds(axis, {name: (cloud.points, COLOURS[name])}, item.mesh, title)
    return figure


def _on_cad(items: Sequence[ObjectClouds]) -> Any:
    figure = _figure(4.0 * len(items), 4.1)
    for column, item in enumerate(items):
        placed = {
            name: (
                _placed(item.clouds[name], align_to_mesh(item.clouds[name].points, item.mesh).transform),
                COLOURS[name],
            )
            for name in (REAL, SIM)
        }
        axis = figure.add_subplot(1, len(items), column + 1, projection="3d")
        _clouds(axis, placed, item.mesh, f"{item.thesis} on its CAD model")
    figure.axes[0].legend(loc="upper left", fontsize=8, markerscale=3)
    return figure


def _on_sim(items: Sequence[ObjectClouds]) -> Any:
    figure = _figure(4.0 * len(items), 4.1)
    for column, item in enumerate(items):
        target = item.clouds[SIM].points
        moved = align_to_points(item.clouds[REAL].points, PointTarget(target)).transform
        axis = figure.add_subplot(1, len(items), column + 1, projection="3d")
        placed = {REAL: (_placed(item.clouds[REAL], moved), COLOURS[REAL]), SIM: (target, COLOURS[SIM])}
        _clouds(axis, placed, None, f"{item.thesis}, real on simulated")
    figure.axes[0].legend(loc="upper left", fontsize=8, markerscale=3)
    return figure


def _placed(cloud: ContactCloud, transform: FloatArray) -> FloatArray:
    return np.asarray(apply(transform, cloud.points))


def _treatment(results: Sequence[ObjectResult]) -> Any:
    figure = _figure(9.0, 3.4)
    axis = figure.add_subplot()
    steps = (REAL, FILTERED, CLEANED, SIM, SPREAD)
    words = ("real, raw", "force filter\n190 counts", "SOR\n(Table 5.4)", "simulated, raw", "contact\npropagation")
    width = 0.8 / len(results)
    for place, one in enumerate(results):
        at = np.arange(len(steps)) + (place - 0.5 * (len(results) - 1)) * width
        axis.bar(at, [one.cad[step].points for step in steps], width * 0.92, label=one.thesis, color=_shade(place))
    axis.set_xticks(range(len(steps)), words, fontsize=9)
    axis.set_ylabel("points")
    axis.axvline(2.5, color=EDGE, linewidth=0.8)
    axis.legend(fontsize=8, frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    _plain(axis)
    return figure


def _shade(place: int) -> str:
    return ("#1f5fa8", "#6f9fce", "#b9cbe2")[place % 3]


def _force(results: Sequence[ObjectResult]) -> Any:
    figure = _figure(4.0 * len(results), 3.6)
    for column, one in enumerate(results):
        axis = figure.add_subplot(1, len(results), column + 1)
        rows = rows_of("I_1_to_3_force_filter", one.thesis)
        at = [row["threshold_counts"] for row in rows]
        for key, colour in (("rms_m", "#b3313e"), ("mean_m", "#1f5fa8")):
            word = key[: -len("_m")].upper() if key == "rms_m" else "mean"
            axis.plot(
                at, [1e3 * getattr(one.force[int(t)], key) for t in at], "o-", color=colour, label=word, markersize=4
            )
            axis.plot(
                at,
                [1e3 * row[key] for row in rows],
                "s--",
                color=colour,
                alpha=PALE,
                label=f"{word}, thesis",
                markersize=4,
            )
        axis.set(title=one.thesis, xlabel="threshold, counts", ylim=(0.0, None))
        _plain(axis)
    figure.axes[0].set_ylabel("distance to CAD, mm")
    figure.axes[0].legend(fontsize=8, frameon=False)
    return figure


def _progress(item: ObjectClouds) -> Any:
    steps = ((REAL, SIM), (FILTERED, SIM), (CLEANED, SIM), (CLEANED, SPREAD))
    figure = _figure(4.0 * len(steps), 4.1)
    for column, (real, sim) in enumerate(steps):
        axis = figure.add_subplot(1, len(steps), column + 1, projection="3d")
        clouds = {name: (item.clouds[name].points, COLOURS[name]) for name in (real, sim)}
        _clouds(axis, clouds, None, STAGES[column].replace("+ ", " and ").replace("+", " and"))
        axis.legend(loc="lower left", fontsize=7, markerscale=3)
    return figure


def _stages(results: Sequence[ObjectResult]) -> Any:
    figure = _figure(4.0 * len(results), 3.6)
    for column, one in enumerate(results):
        axis = figure.add_subplot(1, len(results), column + 1)
        rows = {row["stage"]: row for row in rows_of("I_10_to_12_sim_to_real", one.thesis)}
        at = range(len(STAGES))
        for key, colour, word in (("rms_m", "#b3313e", "RMS"), ("mean_m", "#1f5fa8", "mean")):
            axis.plot(at, [1e3 * getattr(one.to_sim[s], key) for s in STAGES], "o-", color=colour, label=word)
            axis.plot(
                at, [1e3 * rows[s][key] for s in STAGES], "s--", color=colour, alpha=PALE, label=f"{word}, thesis"
            )
        axis.set(title=one.thesis, ylim=(0.0, None))
        axis.set_xticks(at, SHORT, fontsize=8)
        _plain(axis)
    figure.axes[0].set_ylabel("real to simulated, mm")
    figure.axes[0].legend(fontsize=8, frameon=False)
    return figure


def _shares(results: Sequence[ObjectResult]) -> Any:
    figure = _figure(9.0, 3.4)
    axis = figure.add_subplot()
    labels, at = [], []
    for place, one in enumerate(results):
        printed = {row["stage"]: float(row["mean_m"]) for row in rows_of("I_10_to_12_sim_to_real", one.thesis)}
        ours = contributions({stage: one.to_sim[stage].mean_m for stage in STAGES})
        for offset, (values, alpha, who) in enumerate(((ours, 1.0, "ours"), (contributions(printed), PALE, "thesis"))):
            y, left = 3 * place + offset, 0.0
            for value, colour, on_it, word in zip(values, STEP_COLOURS, STEP_INKS, STAGES[1:], strict=True):
                shown = max(value, 0.0)
                label = word.replace("+ ", " + ") if place == 0 and offset == 0 else None
                axis.barh(y, shown, left=left, color=colour, alpha=alpha, label=label)
                if shown > 4.0:
                    ink = on_it if alpha == 1.0 else INK
                    axis.text(left + 0.5 * shown, y, f"{value:.0f}", ha="center", va="center", fontsize=8, color=ink)
                left += shown
            labels.append(f"{one.thesis}, {who}")
            at.append(y)
    axis.set_yticks(at, labels, fontsize=8)
    axis.invert_yaxis()
    axis.set_xlabel("share of the fall of the mean real-to-simulated distance, %")
    axis.legend(fontsize=7, frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    _plain(axis)
    return figure


def _cross(results: Sequence[ObjectResult]) -> Any:
    figure = _figure(4.0 * len(results), 6.0)
    for column, one in enumerate(results):
        for row, side in enumerate((REAL, SIM)):
            axis = figure.add_subplot(2, len(results), row * len(results) + column + 1)
            printed = {
                r["cad_object"]: r
                for r in rows_of("I_13_to_18_cross_shape", one.thesis, "cloud_object")
                if r["cloud_source"] == side
            }
            at = np.arange(len(OBJECTS))
            ours = [1e3 * one.cross[side, word].mean_m if (side, word) in one.cross else 0.0 for word in OBJECTS]
            axis.bar(at - 0.2, ours, 0.38, color=COLOURS[side], label="ours")
            axis.bar(
                at + 0.2,
                [1e3 * printed[w]["mean_m"] for w in OBJECTS],
                0.38,
                color=COLOURS[side],
                alpha=PALE,
                label="thesis",
            )
            axis.set_xticks(at, OBJECTS, fontsize=8)
            axis.set_title(f"{one.thesis} cloud, {side}", fontsize=10)
            _plain(axis)
    figure.axes[0].set_ylabel("mean distance to CAD, mm")
    figure.axes[0].legend(fontsize=8, frameon=False)
    return figure


def _plain(axis: Any) -> None:
    axis.spines[["top", "right"]].set_visible(False)
    axis.tick_params(labelsize=8)
