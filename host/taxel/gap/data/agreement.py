"""Checks that two datasets of any sensor mean the same: unit, direction, size of the values, order of the taxels."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment

from taxel.gap.errors import GapInputError
from taxel.hand.errors import format_path, format_value
from taxel.recording.general.dataset import GeneralDataset
from taxel.recording.general.format import Direction
from taxel.recording.general.values import HoldMeans
from taxel.types import FloatArray

LARGEST_RATIO: Final = 2.0
"""Ratio of the signals of two files without a declared unit from which the units may differ. It is unusual that the
sensitivity of all taxels is wrong by a factor of two; a declared unit removes the doubt."""

LEAST_CONDITIONS: Final = 3
"""Conditions that are needed to recognise a taxel by its signals."""

LEAST_SHARE: Final = 0.05
"""Share of the largest singular value of the signals from which a pattern of signals counts as one of its own."""

OFFSET_SHARE: Final = 0.05
"""Share of a strong signal from which a different rest value is stated; smaller ones are usual between mountings."""

POOR_SHARE: Final = 0.5
BETTER_SHARE: Final = 0.25
"""The order of taxels is wrong if it leaves more than `POOR_SHARE` of the squared signals unexplained, and if another
order leaves less than `BETTER_SHARE` of that. Effects of a skin change signals, but do not exchange taxels."""

LEAST_POWER: Final = 0.01
"""Share of the largest squared signal below which a taxel is hardly touched, so that its place is not certain."""

MAX_ORDER_TAXELS: Final = 4096
"""Taxels up to which the order is checked; the effort grows with the third power."""


def check_agreement(
    real: GeneralDataset,
    sim: GeneralDataset,
    means: HoldMeans,
    other: HoldMeans,
    directions: tuple[Direction, Direction],
) -> list[str]:
    """Check that two datasets agree; return sentences for the report. Raises GapInputError with one line."""
    paths = format_path(str(real.path)), format_path(str(sim.path))
    _check_shapes(real, sim, paths)
    _check_declarations(real, sim, paths, directions)
    conditions = sorted(set(means.conditions) & set(other.conditions))
    if not conditions:
        return []  # the reader of the pair states which conditions are missing
    signals = means.average_conditions(conditions), other.average_conditions(conditions)
    _check_ratio(real, sim, paths, signals)
    return [*_describe_offset(real, means, other), *_check_order(paths, *signals)]


def _describe_offset(real: GeneralDataset, means: HoldMeans, other: HoldMeans) -> list[str]:
    """A sentence on different rest values, if they differ by more than `OFFSET_SHARE` of a strong signal."""
    offset = float(np.median(np.nanmean(means.rest, axis=0) - np.nanmean(other.rest, axis=0)))
    strong = float(np.nanmax(np.abs(other.change), initial=0.0))
    if abs(offset) <= OFFSET_SHARE * strong:
        return []
    unit = real.header.properties.unit or "units of the files"
    reason = "signals are changes from the rest value, so that an offset is no cause of a gap"
    return [f"the rest values differ by {offset:.3g} {unit} (median over the taxels): {reason}"]


def _check_shapes(real: GeneralDataset, sim: GeneralDataset, paths: tuple[str, str]) -> None:
    remedy = "give two datasets of the same sensor, with the same taxels in the same order"
    shapes = [f"{data.n} taxels{' of 3 components' if data.is_vector else ''}" for data in (real, sim)]
    if shapes[0] != shapes[1]:
        raise GapInputError(f"{paths[1]}: /grasps/*/values", f"{shapes[0]} as in {paths[0]}", shapes[1], remedy)
    for name in ("sensor", "tx", "rx", "position"):
        own, other = (getattr(data.header.places, name) for data in (real, sim))
        if own is None or other is None:
            continue
        tolerance = 1e-5 if name == "position" else 0
        wrong = np.flatnonzero(np.abs(own - other).reshape(len(own), -1).max(axis=1) > tolerance)
        if len(wrong):
            where = f"{paths[1]}: /taxels/{name}[{wrong[0]}]"
            found = f"{other[wrong[0]].tolist()}"
            raise GapInputError(where, f"{own[wrong[0]].tolist()} as in {paths[0]}", found, remedy)


def _check_declarations(
    real: GeneralDataset, sim: GeneralDataset, paths: tuple[str, str], directions: tuple[Direction, Direction]
) -> None:
    units = real.header.properties.unit, sim.header.properties.unit
    if None not in units and units[0] != units[1]:
        expected, found = f"{format_value(units[0])} as in {paths[0]}", format_value(units[1])
        raise GapInputError(f"{paths[1]}: unit", expected, found, "convert the values of one file")
    if Direction.SIGNED not in directions and directions[0] != directions[1]:
        expected = f"values that contact {directions[0].value}, as in {paths[0]}"
        found = f"values that contact {directions[1].value}"
        remedy = "reverse the sign of one file, or write signal instead of raw values in both"
        raise GapInputError(f"{paths[1]}: contact", expected, found, remedy)
    names = [data.header.source for data in (real, sim)]
    if names == ["sim", "real"]:
        raise GapInputError(f"{paths[0]}: source", "the real dataset first", "the simulated one", "exchange the files")


def _check_ratio(
    real: GeneralDataset, sim: GeneralDataset, paths: tuple[str, str], signals: tuple[FloatArray, FloatArray]
) -> None:
    """Reject files whose signals have another size, unless both declare their unit."""
    own, other = (float(np.nanmedian(np.sqrt(np.nanmean(signal**2, axis=1)))) for signal in signals)
    if own <= 0.0 or other <= 0.0:
        return
    ratio = own / other
    declared = real.header.properties.unit is not None and sim.header.properties.unit is not None
    if not declared and not 1.0 / LARGEST_RATIO < ratio < LARGEST_RATIO:
        expected = f"signals as large as in {paths[1]}, or the attribute unit in both files"
        found = f"{ratio:.3g} times as large ones without a declared unit"
        remedy = "convert the values to one unit, and declare the unit in both files"
        raise GapInputError(f"{paths[0]}: /grasps/*/values", expected, found, remedy)
    power = float(np.nansum(signals[0] ** 2) * np.nansum(signals[1] ** 2))
    cosine = float(np.nansum(signals[0] * signals[1])) / max(power**0.5, 1e-300)
    if cosine < -POOR_SHARE:
        remedy = "reverse the sign of one file"
        raise GapInputError(
            f"{paths[1]}: /grasps/*/values", "signals of the same sign", "signals of opposite sign", remedy
        )


def _check_order(paths: tuple[str, str], real: FloatArray, sim: FloatArray) -> list[str]:
    """Reject an order of taxels that another order clearly surpasses. real, sim: f64[C, m], mean changes."""
    count, taxels = real.shape
    singular = np.linalg.svd(np.nan_to_num(sim), compute_uv=False)
    excited = int((singular > LEAST_SHARE * singular[0]).sum())
    if count < LEAST_CONDITIONS or excited < LEAST_CONDITIONS or taxels > MAX_ORDER_TAXELS:
        return ["the contacts do not determine the order of the taxels: an exchange of taxels would not be noticed"]
    x, y = np.nan_to_num(real).T, np.nan_to_num(sim).T
    y = y * (np.linalg.norm(x) / max(float(np.linalg.norm(y)), 1e-300))
    cost = np.maximum((x**2).sum(axis=1)[:, None] + (y**2).sum(axis=1) - 2.0 * x @ y.T, 0.0)
    rows, best = linear_sum_assignment(cost)
    moved = np.flatnonzero(best != rows)
    own, other = cost[moved, moved], cost[moved, best[moved]]
    power = (x[moved] ** 2).sum(axis=1) + (y[moved] ** 2).sum(axis=1)
    clear = (own > POOR_SHARE * power) & (other < BETTER_SHARE * own) & (power > LEAST_POWER * power.max(initial=0.0))
    wrong = moved[clear]
    exchanged = [k for k in wrong.tolist() if best[k] in wrong]
    if len(exchanged) >= 2:
        first = exchanged[0]
        found = f"signals of taxel {int(best[first])} at taxel {first}, and {len(exchanged) - 1} more"
        expected = f"the order of the taxels of {paths[1]}"
        remedy = "correct the order of the columns, or the wiring; then diagnose again"
        raise GapInputError(f"{paths[0]}: /grasps/*/values", expected, found, remedy)
    return []
