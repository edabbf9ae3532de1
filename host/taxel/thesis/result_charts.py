"""Figures of the thesis that show numbers of points and distances between clouds as bars and lines."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM, SPREAD
from taxel.thesis.figure_style import COLOURS, EDGE, INK, PALE, new_figure, remove_frame
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.printed import OBJECTS, STAGES, select_rows
from taxel.thesis.tables import compute_contributions

STEP_COLOURS: Final = ("#c9a227", "#3d8f5f", "#1f5fa8")
STEP_INKS: Final = (INK, "white", "white")
SHORT: Final = ("raw", "force\nfilter", "and SOR", "and contact\npropagation")
REPRODUCED: Final = "reproduced"
"""Source of a bar that is not printed in the thesis."""


def draw_treatment(results: Sequence[ObjectResult]) -> Any:
    """Draw Figure 5.9 of the thesis: number of points at each step of the treatment of the clouds."""
    figure = new_figure(9.0, 3.4)
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
    axis.axvline(2.5, color=EDGE, linewidth=0.8)  # between the real and the simulated clouds
    axis.legend(fontsize=8, frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    remove_frame(axis)
    return figure


def _choose_shade(position: int) -> str:
    """Return the colour, a shade of blue, of the graph with number `position` in a figure."""
    return ("#1f5fa8", "#6f9fce", "#b9cbe2")[position % 3]


def draw_force_filter(results: Sequence[ObjectResult]) -> Any:
    """Draw Figure 5.10 of the thesis: distances to the CAD model against the threshold of the force filter."""
    figure = new_figure(4.0 * len(results), 3.6)
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
        remove_frame(axis)
    figure.axes[0].set_ylabel("distance to CAD, mm")
    figure.axes[0].legend(fontsize=8, frameon=False)
    return figure


def draw_stages(results: Sequence[ObjectResult]) -> Any:
    """Draw Figure 5.12 of the thesis: distances between real and simulated clouds at each stage of the treatment."""
    figure = new_figure(4.0 * len(results), 3.6)
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
        remove_frame(axis)
    figure.axes[0].set_ylabel("real to simulated, mm")
    figure.axes[0].legend(fontsize=8, frameon=False)
    return figure


def draw_shares(results: Sequence[ObjectResult]) -> Any:
    """Draw Figure 5.13 of the thesis: share of each treatment step in the decrease of the mean distance."""
    figure = new_figure(9.0, 3.4)
    bars = []
    for result in results:
        for source, means in _list_distances(result, "mean_m"):
            bars.append((f"{result.printed_name}, {source}", means, source))
    _draw_share_bars(figure.add_subplot(), bars, "share of the decrease of the mean real-to-simulated distance, %")
    return figure


def draw_object_shares(result: ObjectResult) -> Any:
    """Draw one of Figures I-4 to I-6 of the thesis: shares of the steps for one object, by mean and by RMS."""
    figure = new_figure(9.0, 2.6)
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
            if width > 4.0:  # a narrower bar has no space for the number
                ink = text_colour if alpha == 1.0 else INK
                axis.text(start + 0.5 * width, y, f"{value:.0f}", ha="center", va="center", fontsize=8, color=ink)
            start += width
    axis.set_yticks(at, [name for name, _, _ in bars], fontsize=8)
    axis.invert_yaxis()
    axis.set_xlabel(label)
    axis.legend(fontsize=7, frameon=False, ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    remove_frame(axis)


def draw_cross_match(results: Sequence[ObjectResult]) -> Any:
    """Draw Figure 5.14 of the thesis: mean distance of each treated cloud to all CAD models."""
    figure = new_figure(4.0 * len(results), 6.0)
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
            remove_frame(axis)
    figure.axes[0].set_ylabel("mean distance to CAD, mm")
    figure.axes[0].legend(fontsize=8, frameon=False)
    return figure
