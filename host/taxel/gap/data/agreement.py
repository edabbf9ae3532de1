"""Checks that two datasets of any sensor agree in unit, direction and size of the values, and in the taxel order."""

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

MAX_SIGNAL_RATIO: Final = 2.0
"""Largest ratio between the signals of two files that do not both declare a unit (chosen). A wrong sensitivity of all
taxels by a factor of two is unusual, so that a larger ratio indicates different units. A declared unit in both files
makes this check unnecessary."""

MIN_CONDITIONS: Final = 3
"""Smallest number of conditions, and of independent patterns of signals, that identify a taxel by its signals (chosen).
With fewer, the order of the taxels is not checked."""

MIN_SINGULAR_VALUE_SHARE: Final = 0.05
"""Ratio of a singular value of the signals to the largest singular value, above which the singular value is treated as
an independent pattern of signals (chosen)."""

OFFSET_SHARE: Final = 0.05
"""Difference of the rest values above which the difference is reported, as a share of the strongest signal (chosen).
Smaller differences are usual between two mountings of a sensor."""

MAX_UNEXPLAINED_SHARE: Final = 0.5
MAX_EXCHANGED_SHARE: Final = 0.25
"""Thresholds of the check of the order of taxels (chosen). The order of the files is wrong for a taxel if more than
`MAX_UNEXPLAINED_SHARE` of its squared signals is unexplained, and if another order reduces this remainder to less than
the share `MAX_EXCHANGED_SHARE`. Effects of a skin change signals, but do not exchange taxels."""

OPPOSITE_COSINE: Final = -0.5
"""Cosine between the signals of two files below which one file has the opposite sign (chosen: halfway between
uncorrelated signals and exactly opposite signals). Signals of one sign have positive cosines."""

MIN_POWER_SHARE: Final = 0.01
"""Smallest ratio of the squared signals of a taxel to the largest squared signals of a taxel for which the order is
checked (chosen). A taxel with smaller signals is hardly loaded, and its place is uncertain."""

MAX_ORDER_TAXELS: Final = 4096
"""Largest number of taxels for which the order is checked; the run time grows with the third power of this number."""


def check_agreement(
    real: GeneralDataset,
    sim: GeneralDataset,
    real_means: HoldMeans,
    sim_means: HoldMeans,
    directions: tuple[Direction, Direction],
) -> list[str]:
    """Check that two datasets describe the same sensor in the same units, and return sentences for the report.

    Raises GapInputError if the taxels, the declared units and directions, the sizes and signs of the signals, or the
    orders of the taxels contradict each other.

    real_means, sim_means: means in hold of the two datasets. directions: direction in which contact changes the values
    of the real and of the simulated dataset. The sentences state an offset of the rest values (values without contact),
    and whether the order of the taxels was not checked.
    """
    paths = format_path(str(real.path)), format_path(str(sim.path))
    _check_shapes(real, sim, paths)
    _check_declarations(real, sim, paths, directions)
    conditions = sorted(set(real_means.conditions) & set(sim_means.conditions))
    if not conditions:
        return []  # `read_pair` refuses datasets without a common condition
    signals = real_means.average_conditions(conditions), sim_means.average_conditions(conditions)
    _check_ratio(real, sim, paths, signals)
    return [*_describe_offset(real, real_means, sim_means), *_check_order(paths, *signals)]


def _describe_offset(real: GeneralDataset, real_means: HoldMeans, sim_means: HoldMeans) -> list[str]:
    """Return a sentence on rest values (values without contact) that differ by more than `OFFSET_SHARE` of the
    strongest signal; an empty list if they agree.
    """
    offset = float(np.median(np.nanmean(real_means.rest, axis=0) - np.nanmean(sim_means.rest, axis=0)))
    strong = float(np.nanmax(np.abs(sim_means.change), initial=0.0))
    if abs(offset) <= OFFSET_SHARE * strong:
        return []
    unit = real.header.properties.unit or "units of the files"
    reason = "signals are changes from the rest value, so that an offset is no cause of a gap"
    return [f"the rest values differ by {offset:.3g} {unit} (median over the taxels): {reason}"]


def _check_shapes(real: GeneralDataset, sim: GeneralDataset, paths: tuple[str, str]) -> None:
    """Raise GapInputError if number, components, sensors, lines or positions of the taxels differ.

    paths: paths of the two files, for the message.
    """
    remedy = "give two datasets of the same sensor, with the same taxels in the same order"
    shapes = [f"{data.n} taxels{' of 3 components' if data.is_vector else ''}" for data in (real, sim)]
    if shapes[0] != shapes[1]:
        raise GapInputError(f"{paths[1]}: /grasps/*/values", f"{shapes[0]} as in {paths[0]}", shapes[1], remedy)
    for name in ("sensor", "tx", "rx", "position"):
        expected, actual = (getattr(data.header.places, name) for data in (real, sim))
        if expected is None or actual is None:
            continue
        tolerance = 1e-5 if name == "position" else 0  # metres; indices must be equal
        wrong = np.flatnonzero(np.abs(expected - actual).reshape(len(expected), -1).max(axis=1) > tolerance)
        if len(wrong):
            where = f"{paths[1]}: /taxels/{name}[{wrong[0]}]"
            found = f"{actual[wrong[0]].tolist()}"
            raise GapInputError(where, f"{expected[wrong[0]].tolist()} as in {paths[0]}", found, remedy)


def _check_declarations(
    real: GeneralDataset, sim: GeneralDataset, paths: tuple[str, str], directions: tuple[Direction, Direction]
) -> None:
    """Raise GapInputError if declared units or directions differ, or if the two files are exchanged. directions:
    direction in which contact changes the values of the real and of the simulated dataset.
    """
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
    """Raise GapInputError if the signals of the two files have different sizes or opposite signs.

    Sizes that differ by more than the factor `MAX_SIGNAL_RATIO` indicate different units; they are accepted if both
    files declare their unit.

    signals: mean signals in hold of the real and of the simulated dataset, [C, m] each, for C conditions and m taxels.
    """
    real_size, sim_size = (float(np.nanmedian(np.sqrt(np.nanmean(signal**2, axis=1)))) for signal in signals)
    if real_size <= 0.0 or sim_size <= 0.0:
        return
    ratio = real_size / sim_size
    declared = real.header.properties.unit is not None and sim.header.properties.unit is not None
    if not declared and not 1.0 / MAX_SIGNAL_RATIO < ratio < MAX_SIGNAL_RATIO:
        expected = f"signals as large as in {paths[1]}, or the attribute unit in both files"
        found = f"{ratio:.3g} times as large ones without a declared unit"
        remedy = "convert the values to one unit, and declare the unit in both files"
        raise GapInputError(f"{paths[0]}: /grasps/*/values", expected, found, remedy)
    power = float(np.nansum(signals[0] ** 2) * np.nansum(signals[1] ** 2))
    cosine = float(np.nansum(signals[0] * signals[1])) / max(power**0.5, 1e-300)
    if cosine < OPPOSITE_COSINE:
        remedy = "reverse the sign of one file"
        raise GapInputError(
            f"{paths[1]}: /grasps/*/values", "signals of the same sign", "signals of opposite sign", remedy
        )


def _check_order(paths: tuple[str, str], real: FloatArray, sim: FloatArray) -> list[str]:
    """Raise GapInputError if another order of the taxels explains the signals clearly better.

    Return a sentence for the report if the order cannot be checked, otherwise an empty list. The other order is the
    assignment of real to simulated taxels with the smallest squared difference. real, sim: f64[C, m] (C conditions),
    mean signals in hold.
    """
    conditions, taxels = real.shape
    singular = np.linalg.svd(np.nan_to_num(sim), compute_uv=False)
    # The rank of the signals is the number of independent load patterns, which distinguish the taxels.
    patterns = int((singular > MIN_SINGULAR_VALUE_SHARE * singular[0]).sum())
    unnoticed = "an exchange of taxels would not be noticed"
    if taxels > MAX_ORDER_TAXELS:
        return [f"the order of more than {MAX_ORDER_TAXELS} taxels is not checked: {unnoticed}"]
    if conditions < MIN_CONDITIONS or patterns < MIN_CONDITIONS:
        return [f"the contacts do not determine the order of the taxels: {unnoticed}"]
    x, y = np.nan_to_num(real).T, np.nan_to_num(sim).T
    # With equal norms, a common factor between the two files does not count as a difference.
    y = y * (np.linalg.norm(x) / max(float(np.linalg.norm(y)), 1e-300))
    cost = np.maximum((x**2).sum(axis=1)[:, None] + (y**2).sum(axis=1) - 2.0 * x @ y.T, 0.0)
    rows, best = linear_sum_assignment(cost)
    moved = np.flatnonzero(best != rows)
    cost_in_place, cost_moved = cost[moved, moved], cost[moved, best[moved]]
    power = (x[moved] ** 2).sum(axis=1) + (y[moved] ** 2).sum(axis=1)
    is_loaded = power > MIN_POWER_SHARE * power.max(initial=0.0)
    is_unexplained = cost_in_place > MAX_UNEXPLAINED_SHARE * power
    is_wrong = is_unexplained & (cost_moved < MAX_EXCHANGED_SHARE * cost_in_place) & is_loaded
    wrong = moved[is_wrong]
    exchanged = [k for k in wrong.tolist() if best[k] in wrong]
    if len(exchanged) >= 2:  # an exchange involves at least two taxels
        first = exchanged[0]
        found = f"signals of taxel {int(best[first])} at taxel {first}, and {len(exchanged) - 1} more"
        expected = f"the order of the taxels of {paths[1]}"
        remedy = "correct the order of the columns, or the wiring; then diagnose again"
        raise GapInputError(f"{paths[0]}: /grasps/*/values", expected, found, remedy)
    return []
