"""Figures 5.3, 5.6 to 5.14 and I-2 to I-6 of the thesis from the reproduced results, as PNG files.

Numbers that the thesis prints are shown in pale colours. Figure I-1 of the thesis is the same as Figure 5.11.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.registration import PointTarget, align_to_mesh, align_to_points
from taxel.hand.transforms import apply
from taxel.output.figure import save_figure
from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM, SPREAD
from taxel.thesis.matching import ObjectClouds
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.printed import OBJECTS, STAGES, select_rows
from taxel.thesis.tables import compute_contributions
from taxel.types import FloatArray

COLOURS: Final = {REAL: "#d9772b", SIM: "#5d3a9b", FILTERED: "#c9a227", CLEANED: "#3d8f5f", SPREAD: "#1f5fa8"}
EDGE, PALE, INK, INACTIVE = "#9aa1ad", 0.35, "#1b1d22", "#8a92a0"
VIEW: Final = (18.0, -60.0)
STEP_COLOURS: Final = ("#c9a227", "#3d8f5f", "#1f5fa8")
STEP_INKS: Final = (INK, "white", "white")
SHORT: Final = ("raw", "force\nfilter", "and SOR", "and contact\npropagation")

FIGURES: Final = {
    "5.3": "Contact clouds of one grasp of the cylinder, active and inactive taxels",
    "5.6": "Accumulated clouds before any treatment",
    "5.7": "Clouds on their CAD models",
    "5.8": "Real on simulated clouds",
    "5.9": "Number of points at each step of the treatment",
    "5.10": "Force filter: distances to the CAD models",
    "5.11": "Clouds of the rectangular prism at each stage of the treatment",
    "5.12": "Distances between real and simulated clouds, step by step",
    "5.13": "Share of each step in the decrease of the mean distance",
    "5.14": "Treated clouds on all CAD models",
    "I-2": "Clouds of the cylinder at each stage of the treatment",
    "I-3": "Clouds of the triangular prism at each stage of the treatment",
    "I-4": "Share of each step in the decrease of mean and RMS, rectangular prism",
    "I-5": "Share of each step in the decrease of mean and RMS, cylinder",
    "I-6": "Share of each step in the decrease of mean and RMS, triangular prism",
}


def save_figures(items: Sequence[ObjectClouds], results: Sequence[ObjectResult], out: Path) -> dict[str, Path]:
    """Draw all figures of the reproduction to the folder `out`; return their files by figure number.

    items, results: clouds and distances of each object, in the order of the thesis.
    """
    by_name = {item.printed_name: item for item in items}
    figures = {
        "5.3": _draw_grasp(by_name["cylindrical"]),
        "5.6": _draw_accumulated(items),
        "5.7": _draw_on_cad(items),
        "5.8": _draw_on_sim(items),
        "5.9": _draw_treatment(results),
        "5.10": _draw_force_filter(results),
        "5.11": _draw_progress(items[0]),
        "5.12": _draw_stages(results),
        "5.13": _draw_shares(results),
        "5.14": _draw_cross_match(results),
        "I-2": _draw_progress(by_name["cylindrical"]),
        "I-3": _draw_progress(by_name["triangular"]),
        **{f"I-{number}": _draw_object_shares(result) for number, result in enumerate(results, 4)},
    }
    for number, figure in figures.items():
        save_figure(figure, out / _name_file(number), dpi=110, facecolor="white")
    return find_figures(out)


def find_figures(folder: Path) -> dict[str, Path]:
    """Return the existing figure files in a folder by figure number, in the order of the thesis."""
    return {number: path for number in FIGURES if (path := folder / _name_file(number)).exists()}


def _name_file(number: str) -> str:
    """Return the file name of a figure."""
    return f"figure_{number.replace('.', '_').replace('-', '_')}.png"


def _new_figure(width: float, height: float) -> Any:
    """Create an empty matplotlib figure. width, height: inches."""
    from matplotlib.figure import Figure  # the import takes a second, which other commands need not wait for

    return Figure(figsize=(width, height), layout="constrained")


def _draw_clouds(
    axis: Any,
    clouds: Mapping[str, tuple[FloatArray, str]],
    mesh: TriangleMesh | None,
    title: str,
    size: float = 2.5,
) -> None:
    """Draw clouds, and the sharp edges of a mesh, on a 3-D axis in millimetres.

    clouds: points f64[n, 3] (metres) and colour by label. mesh: mesh of the object; None: no mesh. size: area of a
    point in square points.
    """
    all_points = [points for points, _ in clouds.values()] + ([mesh.vertices] if mesh is not None else [])
    low, high = (1e3 * f(np.concatenate(all_points), axis=0) for f in (np.min, np.max))
    centre, half = 0.5 * (low + high), 0.5 * float((high - low).max())
    if mesh is not None:
        for corners in _find_sharp_edges(mesh):
            axis.plot(*(1e3 * corners.T), color=EDGE, linewidth=0.8)
    for label, (points, colour) in clouds.items():
        axis.scatter(*(1e3 * points.T), s=size, c=colour, alpha=0.5, linewidths=0, label=label)
    axis.set(xlim=(centre[0] - half, centre[0] + half), ylim=(centre[1] - half, centre[1] + half))
    axis.set_zlim(centre[2] - half, centre[2] + half)
    axis.set_box_aspect((1, 1, 1), zoom=0.92)
    axis.view_init(*VIEW)
    axis.set_title(title, fontsize=10, y=0.98)
    axis.tick_params(labelsize=6)
    axis.set_xlabel("mm", fontsize=7)


SHARP_COS: Final = 0.9
"""Cosine of the angle between face normals below which an edge is drawn."""


def _find_sharp_edges(mesh: TriangleMesh) -> list[FloatArray]:
    """Find the edges between mesh faces of different directions, each as its two end points f64[2, 3].

    A round side has no sharp edges except its rims.
    """
    owners: dict[tuple[int, int], list[int]] = {}
    for number, face in enumerate(mesh.faces.tolist()):
        for first, second in ((0, 1), (1, 2), (2, 0)):
            owners.setdefault((min(face[first], face[second]), max(face[first], face[second])), []).append(number)
    normals = mesh.normals
    sharp = [key for key, faces in owners.items() if normals[faces[0]] @ normals[faces[-1]] < SHARP_COS]
    return [mesh.vertices[list(key)] for key in sharp]


def _draw_grasp(item: ObjectClouds) -> Any:
    """Draw Figure 5.3 of the thesis: active and inactive taxels of one grasp, real and simulated.

    The grasp is selected for many active taxels on both sides: the smaller of its two numbers of active taxels, real
    and simulated, is the largest of all grasps.
    """
    real, sim = item.clouds[REAL], item.clouds[SIM]
    active = [np.bincount(cloud.grasp, minlength=len(cloud.grasps)) for cloud in (real, sim)]
    counts = [dict(zip(cloud.grasps, values, strict=True)) for cloud, values in zip((real, sim), active, strict=True)]
    grasp = max(real.grasps, key=lambda name: min(counts[0][name], counts[1].get(name, -1)))
    figure = _new_figure(9.0, 4.6)
    for column, (name, cloud) in enumerate(((REAL, real), (SIM, sim))):
        row = cloud.grasps.index(grasp) if grasp in cloud.grasps else 0
        inactive = cloud.inactive_points[cloud.inactive_grasp == row]
        points = cloud.points[cloud.grasp == row]
        clouds = {"inactive": (inactive, INACTIVE), "active": (points, COLOURS[name])}
        axis = figure.add_subplot(1, 2, column + 1, projection="3d")
        title = f"{name}: {len(points)} of {len(points) + len(inactive)} taxels active"
        _draw_clouds(axis, clouds, item.mesh, title, size=7.0)
        axis.legend(loc="lower left", fontsize=8, markerscale=2)
    return figure


def _draw_accumulated(items: Sequence[ObjectClouds]) -> Any:
    """Draw Figure 5.6 of the thesis: untreated real and simulated cloud of each object, in separate plots."""
    figure = _new_figure(4.0 * len(items), 7.6)
    for column, item in enumerate(items):
        for row, name in enumerate((REAL, SIM)):
            axis = figure.add_subplot(2, len(items), row * len(items) + column + 1, projection="3d")
            cloud = item.clouds[name]
            title = f"{item.printed_name}, {name}: {len(cloud)} points"
            _draw_clouds(axis, {name: (cloud.points, COLOURS[name])}, item.mesh, title)
    return figure


def _draw_on_cad(items: Sequence[ObjectClouds]) -> Any:
    """Draw Figure 5.7 of the thesis: real and simulated cloud of each object, each aligned to the object's CAD
    model.
    """
    figure = _new_figure(4.0 * len(items), 4.1)
    for column, item in enumerate(items):
        aligned = {
            name: (
                _transform(item.clouds[name], align_to_mesh(item.clouds[name].points, item.mesh).transform),
                COLOURS[name],
            )
            for name in (REAL, SIM)
        }
        axis = figure.add_subplot(1, len(items), column + 1, projection="3d")
        _draw_clouds(axis, aligned, item.mesh, f"{item.printed_name} on its CAD model")
    figure.axes[0].legend(loc="upper left", fontsize=8, markerscale=3)
    return figure


def _draw_on_sim(items: Sequence[ObjectClouds]) -> Any:
    """Draw Figure 5.8 of the thesis: the real cloud of each object after alignment to the simulated cloud, and the
    latter.
    """
    figure = _new_figure(4.0 * len(items), 4.1)
    for column, item in enumerate(items):
        target = item.clouds[SIM].points
        transform = align_to_points(item.clouds[REAL].points, PointTarget(target)).transform
        axis = figure.add_subplot(1, len(items), column + 1, projection="3d")
        aligned = {REAL: (_transform(item.clouds[REAL], transform), COLOURS[REAL]), SIM: (target, COLOURS[SIM])}
        _draw_clouds(axis, aligned, None, f"{item.printed_name}, real on simulated")
    figure.axes[0].legend(loc="upper left", fontsize=8, markerscale=3)
    return figure


def _transform(cloud: ContactCloud, transform: FloatArray) -> FloatArray:
    """Return the points of a cloud after a rigid transform f64[4, 4], f64[n, 3]."""
    return np.asarray(apply(transform, cloud.points))


def _draw_treatment(results: Sequence[ObjectResult]) -> Any:
    """Draw Figure 5.9 of the thesis: number of points at each step of the treatment of the clouds."""
    figure = _new_figure(9.0, 3.4)
    axis = figure.add_subplot()
    steps = (REAL, FILTERED, CLEANED, SIM, SPREAD)
    labels = ("real, raw", "force filter\n190 counts", "SOR\n(Table 5.4)", "simulated, raw", "contact\npropagation")
    width = 0.8 / len(results)
    for position, result in enumerate(results):
        at = np.arange(len(steps)) + (position - 0.5 * (len(results) - 1)) * width
        axis.bar(
            at,
            [result.cad[step].points for step in steps],
            width * 0.92,
            label=result.printed_name,
            color=_choose_shade(position),
        )
    axis.set_xticks(range(len(steps)), labels, fontsize=9)
    axis.set_ylabel("points")
    axis.axvline(2.5, color=EDGE, linewidth=0.8)
    axis.legend(fontsize=8, frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    _remove_frame(axis)
    return figure


def _choose_shade(position: int) -> str:
    """Return the colour, a shade of blue, of the graph with number `position` in a figure."""
    return ("#1f5fa8", "#6f9fce", "#b9cbe2")[position % 3]


def _draw_force_filter(results: Sequence[ObjectResult]) -> Any:
    """Draw Figure 5.10 of the thesis: distances to the CAD model against the threshold of the force filter."""
    figure = _new_figure(4.0 * len(results), 3.6)
    for column, result in enumerate(results):
        axis = figure.add_subplot(1, len(results), column + 1)
        rows = select_rows("I_1_to_3_force_filter", result.printed_name)
        at = [row["threshold_counts"] for row in rows]
        for key, colour in (("rms_m", "#b3313e"), ("mean_m", "#1f5fa8")):
            name = "RMS" if key == "rms_m" else "mean"
            axis.plot(
                at, [1e3 * getattr(result.force[int(t)], key) for t in at], "o-", color=colour, label=name, markersize=4
            )
            axis.plot(
                at,
                [1e3 * row[key] for row in rows],
                "s--",
                color=colour,
                alpha=PALE,
                label=f"{name}, thesis",
                markersize=4,
            )
        axis.set(title=result.printed_name, xlabel="threshold, counts", ylim=(0.0, None))
        _remove_frame(axis)
    figure.axes[0].set_ylabel("distance to CAD, mm")
    figure.axes[0].legend(fontsize=8, frameon=False)
    return figure


def _draw_progress(item: ObjectClouds) -> Any:
    """Draw Figure 5.11, I-2 or I-3 of the thesis: real and simulated cloud of one object at each treatment stage."""
    steps = ((REAL, SIM), (FILTERED, SIM), (CLEANED, SIM), (CLEANED, SPREAD))
    figure = _new_figure(4.0 * len(steps), 4.1)
    for column, (real, sim) in enumerate(steps):
        axis = figure.add_subplot(1, len(steps), column + 1, projection="3d")
        clouds = {name: (item.clouds[name].points, COLOURS[name]) for name in (real, sim)}
        _draw_clouds(axis, clouds, None, STAGES[column].replace("+ ", " and ").replace("+", " and"))
        axis.legend(loc="lower left", fontsize=7, markerscale=3)
    return figure


def _draw_stages(results: Sequence[ObjectResult]) -> Any:
    """Draw Figure 5.12 of the thesis: distances between real and simulated clouds at each stage of the treatment."""
    figure = _new_figure(4.0 * len(results), 3.6)
    for column, result in enumerate(results):
        axis = figure.add_subplot(1, len(results), column + 1)
        rows = {row["stage"]: row for row in select_rows("I_10_to_12_sim_to_real", result.printed_name)}
        at = range(len(STAGES))
        for key, colour, name in (("rms_m", "#b3313e", "RMS"), ("mean_m", "#1f5fa8", "mean")):
            axis.plot(at, [1e3 * getattr(result.to_sim[s], key) for s in STAGES], "o-", color=colour, label=name)
            axis.plot(
                at, [1e3 * rows[s][key] for s in STAGES], "s--", color=colour, alpha=PALE, label=f"{name}, thesis"
            )
        axis.set(title=result.printed_name, ylim=(0.0, None))
        axis.set_xticks(at, SHORT, fontsize=8)
        _remove_frame(axis)
    figure.axes[0].set_ylabel("real to simulated, mm")
    figure.axes[0].legend(fontsize=8, frameon=False)
    return figure


def _draw_shares(results: Sequence[ObjectResult]) -> Any:
    """Draw Figure 5.13 of the thesis: share of each treatment step in the decrease of the mean distance."""
    figure = _new_figure(9.0, 3.4)
    bars = []
    for result in results:
        for source, means in _list_distances(result, "mean_m"):
            bars.append((f"{result.printed_name}, {source}", means, source))
    _draw_share_bars(figure.add_subplot(), bars, "share of the decrease of the mean real-to-simulated distance, %")
    return figure


def _draw_object_shares(result: ObjectResult) -> Any:
    """Draw one of Figures I-4 to I-6 of the thesis: shares of the steps for one object, by mean and by RMS."""
    figure = _new_figure(9.0, 2.6)
    bars = [
        (f"{name}, {source}", distances, source)
        for key, name in (("mean_m", "mean"), ("rms_m", "RMS"))
        for source, distances in _list_distances(result, key)
    ]
    label = f"{result.printed_name}: share of the decrease of the real-to-simulated distance, %"
    _draw_share_bars(figure.add_subplot(), bars, label)
    return figure


def _list_distances(result: ObjectResult, key: str) -> list[tuple[str, dict[str, float]]]:
    """Return the real-to-simulated distances of an object by stage, metres: reproduced, then printed in the thesis.

    Each list element is a pair of the source's name and the distances. key: statistic of the distance, such as
    "mean_m".
    """
    printed = {row["stage"]: float(row[key]) for row in select_rows("I_10_to_12_sim_to_real", result.printed_name)}
    return [(REPRODUCED, {stage: getattr(result.to_sim[stage], key) for stage in STAGES}), ("thesis", printed)]


def _draw_share_bars(axis: Any, bars: Sequence[tuple[str, Mapping[str, float], str]], label: str) -> None:
    """Draw a stacked horizontal bar for each entry of `bars`: the share of each step in the decrease of the distance.

    bars: label, distances by stage, and source (reproduced or thesis) of each bar. Pairs of bars (reproduced and
    printed) are separated by a gap. A step that increases the distance is not drawn. label: label of the axis.
    """
    at = [k + k // 2 for k in range(len(bars))]
    for number, (y, (_, distances, source)) in enumerate(zip(at, bars, strict=True)):
        start, alpha = 0.0, 1.0 if source == REPRODUCED else PALE
        shares = compute_contributions(distances)
        for value, colour, text_colour, stage in zip(shares, STEP_COLOURS, STEP_INKS, STAGES[1:], strict=True):
            width = max(value, 0.0)
            name = stage.replace("+ ", " + ") if number == 0 else None
            axis.barh(y, width, left=start, color=colour, alpha=alpha, label=name)
            if width > 4.0:
                ink = text_colour if alpha == 1.0 else INK
                axis.text(start + 0.5 * width, y, f"{value:.0f}", ha="center", va="center", fontsize=8, color=ink)
            start += width
    axis.set_yticks(at, [name for name, _, _ in bars], fontsize=8)
    axis.invert_yaxis()
    axis.set_xlabel(label)
    axis.legend(fontsize=7, frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    _remove_frame(axis)


REPRODUCED: Final = "reproduced"
"""Source of a bar that is not printed in the thesis."""


def _draw_cross_match(results: Sequence[ObjectResult]) -> Any:
    """Draw Figure 5.14 of the thesis: mean distance of each treated cloud to all CAD models."""
    figure = _new_figure(4.0 * len(results), 6.0)
    for column, result in enumerate(results):
        for row, side in enumerate((REAL, SIM)):
            axis = figure.add_subplot(2, len(results), row * len(results) + column + 1)
            printed = {
                r["cad_object"]: r
                for r in select_rows("I_13_to_18_cross_shape", result.printed_name, "cloud_object")
                if r["cloud_source"] == side
            }
            at = np.arange(len(OBJECTS))
            values = [
                1e3 * result.cross[side, word].mean_m if (side, word) in result.cross else 0.0 for word in OBJECTS
            ]
            axis.bar(at - 0.2, values, 0.38, color=COLOURS[side], label="reproduced")
            axis.bar(
                at + 0.2,
                [1e3 * printed[w]["mean_m"] for w in OBJECTS],
                0.38,
                color=COLOURS[side],
                alpha=PALE,
                label="thesis",
            )
            axis.set_xticks(at, OBJECTS, fontsize=8)
            axis.set_title(f"{result.printed_name} cloud, {side}", fontsize=10)
            _remove_frame(axis)
    figure.axes[0].set_ylabel("mean distance to CAD, mm")
    figure.axes[0].legend(fontsize=8, frameon=False)
    return figure


def _remove_frame(axis: Any) -> None:
    """Remove the upper and right border of a matplotlib axis, and reduce the size of its tick labels."""
    axis.spines[["top", "right"]].set_visible(False)
    axis.tick_params(labelsize=8)
