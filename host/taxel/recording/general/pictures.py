"""Pictures of version 2 datasets: mean change of each taxel in the hold phase, on a map of the sensor."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from typing import Any, Final

import numpy as np

from taxel.optional import optional_import
from taxel.output.figure import save_figure
from taxel.recording.general.dataset import GeneralDataset
from taxel.recording.general.format import AXES
from taxel.recording.general.values import HoldMeans, compute_hold_means, with_phases
from taxel.types import FloatArray

with optional_import("matplotlib", "pictures"):
    import matplotlib as mpl

MAX_CONDITIONS: Final = 6
"""Largest number of conditions (object and approach) that are drawn for each dataset."""

MAP_POINTS: Final = 80.0
"""Sum of the widths of the taxels' squares along a side of a map, typographic points; a map is about 150 points wide.
"""


def save_maps(paths: Sequence[str | PathLike[str]], out: str | PathLike[str]) -> int:
    """Draw maps of the mean change in the hold phase to the file `out`; return the number of drawn conditions.

    The picture has one row for each dataset and one map for each of the first `MAX_CONDITIONS` conditions (object and
    approach). A taxel is drawn at its position, or at its number on a square grid if positions are not known. A vector
    taxel is drawn with the length of its change. Raises DatasetError.
    """
    mpl.use("agg")
    from matplotlib import pyplot as plt

    rows = []
    for path in paths:
        with GeneralDataset(path) as data:
            means = compute_hold_means(contact for contact in map(with_phases, data) if contact is not None)
            rows.append((data, means, _find_places(data)))
    conditions = sorted({condition for _, means, _ in rows for condition in means.conditions})[:MAX_CONDITIONS]
    size = (2.4 * max(len(conditions), 1), 2.6 * len(rows))
    figure, axes = plt.subplots(len(rows), max(len(conditions), 1), figsize=size, squeeze=False, layout="constrained")
    maps = [_compute_maps(data, means, conditions) for data, means, _ in rows]
    # One scale for all datasets: a weaker dataset must look weaker.
    limit = max(float(np.nanmax(np.abs(signals), initial=0.0)) for signals in maps) or 1.0
    for line, (data, _, places), signals in zip(axes, rows, maps, strict=True):
        for axis, condition, signal in zip(line, conditions, signals, strict=False):
            _draw_map(axis, places, signal, limit)
            axis.set_title(f"{condition[0]} {condition[1]}", fontsize=7)
        unit = data.header.properties.unit or "units of the file"
        line[0].set_ylabel(f"{data.header.source}\n±{limit:.3g} {unit}", fontsize=7)
    save_figure(figure, out, dpi=130)
    plt.close(figure)
    return len(conditions)


def _compute_maps(data: GeneralDataset, means: HoldMeans, conditions: Sequence[tuple[str, str]]) -> FloatArray:
    """Return the mean change of n taxels in each of C conditions, f64[C, n], in the unit of the dataset.

    The change of a scalar taxel is signed, that of a vector taxel is a length. NaN for a condition without contacts.
    """
    signals = means.average_conditions(conditions)
    if not data.is_vector:
        return signals
    return np.asarray(np.linalg.norm(signals.reshape(len(signals), data.n, AXES), axis=2))


def _draw_map(axis: Any, places: FloatArray, signal: FloatArray, limit: float) -> None:
    """Draw the map of one condition on Matplotlib axes.

    places: f64[n, 2], places of the n taxels in the picture. signal: f64[n], their mean changes. limit: largest
    absolute change of the colour scale.
    """
    size = MAP_POINTS / max(np.sqrt(len(places)), 1.0)
    axis.scatter(*places.T, c=signal, s=size**2, marker="s", cmap="RdBu_r", vmin=-limit, vmax=limit)
    axis.set_aspect("equal")
    axis.margins(0.15)  # squares at the edge of the sensor are drawn completely
    axis.set_xticks([])
    axis.set_yticks([])


def _find_places(data: GeneralDataset) -> FloatArray:
    """Choose the places of the n taxels in the picture, f64[n, 2].

    The coordinates are those of the two axes along which the positions extend most; several sensors are side by side.
    Without positions the taxels are on a square grid, row by row.
    """
    position, sensor = data.header.places.position, data.header.places.sensor
    if position is None:
        width = int(np.ceil(np.sqrt(data.n)))
        rows, columns = np.divmod(np.arange(data.n), width)
        return np.column_stack([columns, -rows]).astype(np.float64)
    axes = np.sort(np.argsort(-np.ptp(position, axis=0), kind="stable")[:2])
    places = position[:, axes].copy()
    if sensor is not None:
        step = 1.2 * max(float(np.ptp(places[:, 0])), 1e-9)
        places[:, 0] += step * np.unique(sensor, return_inverse=True)[1]
    return np.asarray(places)
