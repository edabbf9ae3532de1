"""Python source with keyword arguments of Genesis' sensor `KinematicTaxel`, one set for each board."""

from __future__ import annotations

import pprint
from typing import Any, Final

import numpy as np

from taxel.gap.export.common import ExportSource
from taxel.gap.export.mixing import compute_grid_kernel
from taxel.gap.export.python_module import format_tables, list_limits, round_number
from taxel.gap.export.translation import Translation
from taxel.types import FloatArray, IndexArray

VERSION: Final = "1.4.5"
"""Version of the package genesis-world whose options are used (`genesis/options/sensors/tactile.py`, `options.py`)."""

OPTIONS: Final = ("probe_gain", "noise", "bias", "delay", "jitter", "crosstalk_kernel")
"""Names of the options that an export writes."""

DEAD_GAIN: Final = 1e-9
"""Gain of a dead taxel. Genesis requires gains above 0, and its option dead_taxel_probability selects random taxels."""

SMALL_SIGNALS: Final = "Genesis measures forces: exact as long as the signal is proportional to the force"
EDGES: Final = "one kernel for all taxels of a board: the mean of the mixing matrix over pairs with the same distance"
DRIFT: Final = "a constant bias with the mean of the drift over a grasp instead of a slope; no variation between grasps"
COMMON_NOISE: Final = "Genesis samples each taxel alone: the variance is right, the correlation on lines is 0"
STUCK: Final = "constant taxels keep their noise"
NEGATIVE_DELAY: Final = "a board that precedes the simulator has a delay of 0"

FORCE_LAW: Final = "the law of the force is normal_exponent and normal_stiffness: fit these to the simulator's contact"

NO_OPTION: Final = {
    "late": (
        "Genesis' hysteresis overshoots and relaxes (hysteresis_strength >= 0); the diagnosed one arrives late: "
        "this is hysteresis_strength = {strength:g} with hysteresis_tau = {tau:g}, outside the permitted range"
    ),
    "clip": "KinematicTaxel has no limit of the force",
    "soft": "KinematicTaxel has no limit of the force",
    "smooth": "KinematicTaxel has no limit of the force",
    **dict.fromkeys(("power", "power_force", "polynomial"), FORCE_LAW),
    "proximity": "KinematicTaxel has no signal before contact",
    "pillars": "the spread depends on the depth: Genesis' kernel is linear",
    "sticks": "Genesis has no play and no logarithmic creep",
    "lag": "Genesis has no low pass of the measured force",
    "lost": "Genesis has no lost frames; jitter changes the delay of every read",
    "model": "the sensor model of the simulation is needed for the conversion of counts into forces: {missing}",
}

HEAD: Final = '''"""{note}

Keyword arguments of gs.sensors.KinematicTaxel, names of genesis-world {version}. One sensor for each board:

    scene.add_sensor(gs.sensors.KinematicTaxel(entity_idx=..., probe_local_pos=..., **KINEMATIC_TAXEL[{board}]))

The probes are in the order of TAXELS[board]: row by row of the TX lines. crosstalk_kernel requires probe_local_pos as a
grid of TX x RX positions: {grids}. Forces are in newtons.
{limits}"""

NORMAL_EXPONENT = 1.0  # the option normal_exponent of the sensor: a gain of the depth scales the force by its power

'''


def write_genesis(source: ExportSource, translation: Translation, note: str) -> tuple[str, Translation]:
    """Return the text of a Python file with Genesis options, and the translation reduced to what Genesis supports.

    translation: effects as numeric steps. note: line that states the origin of the file.
    """
    limited = _restrict_to_genesis(source, translation)
    report, taxels, options = source.report, [], []
    grids: dict[str, list[int]] = {}
    for address, board_taxels in source.iterate_boards():
        tx, rx = report.tx[board_taxels], report.rx[board_taxels]
        order = board_taxels[np.lexsort((rx, tx))]
        sides = int(np.ptp(tx)) + 1, int(np.ptp(rx)) + 1
        grids.setdefault(f"{sides[0]} x {sides[1]}", []).append(address)
        lines = list(zip(report.tx[order].tolist(), report.rx[order].tolist(), strict=True))
        taxels.append(f"    {address}: {lines},")
        entries = _build_options(source, limited, order, sides)
        options.append(
            f"    {address}: {{\n" + "".join(f'        "{key}": {text},\n' for key, text in entries) + "    },"
        )
    head = HEAD.format(
        note=note,
        version=VERSION,
        board=source.boards[0],
        grids=_describe_grids(grids),
        limits="".join(f"\n{line}" for line in list_limits(limited)) + "\n",
    )
    tables = {"TAXELS": taxels, "KINEMATIC_TAXEL": options}
    return f"{head}{format_tables(tables)}\n", limited


def _restrict_to_genesis(source: ExportSource, translation: Translation) -> Translation:
    """Return a translation without the numeric steps that Genesis lacks, with the reasons for omitted and approximated
    effects.
    """
    refused, approximated, steps = dict(translation.not_expressed), dict(translation.approximated), []
    for step in translation.steps:
        kind, name = step["kind"], step["effect"]
        if kind.startswith("late"):
            # In Genesis, a positive strength is an overshoot; a late share `fraction` is a negative strength.
            fraction, tau = float(np.max(step["fraction"])), float(np.max(step["seconds"]))
            refused[name] = NO_OPTION["late"].format(strength=-fraction, tau=tau)
        elif kind in NO_OPTION:
            refused[name] = NO_OPTION[kind]
        elif kind == "drift" and source.model is None:
            refused[name] = NO_OPTION["model"].format(missing=source.missing or "the dataset has none")
        else:
            steps.append(step)
            if kind == "drift":
                approximated[name] = DRIFT
            elif kind in ("mix_force", "mix_signal"):
                approximated[name] = EDGES if kind == "mix_force" else f"{EDGES}; {SMALL_SIGNALS}"
            elif kind == "scale" and not np.isin(step["factor"], (0.0, 1.0)).all():
                approximated[name] = SMALL_SIGNALS
    if translation.noise.any() and source.model is None:
        refused["noise"] = NO_OPTION["model"].format(missing=source.missing or "the dataset has none")
    elif translation.noise.any():
        # The components after the first are common to a line or a board.
        approximated["noise"] = SMALL_SIGNALS + (f"; {COMMON_NOISE}" if translation.noise[1:].any() else "")
    if translation.lost.any():
        refused["dropout: lost frames"] = NO_OPTION["lost"]
    if translation.stuck:
        approximated["dropout: constant taxels"] = STUCK
    if (translation.delay_s < 0.0).any():
        approximated["latency"] = NEGATIVE_DELAY
    return translation.restrict(steps, approximated, refused)


def _build_options(
    source: ExportSource, translation: Translation, order: IndexArray, sides: tuple[int, int]
) -> list[tuple[str, str]]:
    """Return the options of one board as pairs of name and source text; options with their default are omitted.

    order: indices of the taxels of the board, row by row. sides: numbers of TX and RX lines of the board.
    """
    gain, kernel, matrix = np.ones(len(order)), None, np.eye(len(order))
    for step in translation.steps:
        if step["kind"] == "scale":
            gain = gain * step["factor"][order]
        elif step["kind"] == "half_force":
            gain = gain / step["factor"][order]  # the slope of a small signal is inverse to the force at half scale
        elif step["kind"] in ("mix_force", "mix_signal"):
            matrix = matrix @ _reorder_matrix(step, order)
            kernel = compute_grid_kernel(source.report.tx[order], source.report.rx[order], matrix)
    entries = []
    if (gain != 1.0).any():
        # Genesis' gain scales the depth, and the force is the depth to the power NORMAL_EXPONENT.
        values = [round_number(float(one)) for one in np.maximum(gain, DEAD_GAIN)]
        entries.append(("probe_gain", f"[gain ** (1.0 / NORMAL_EXPONENT) for gain in {values}]"))
    slope = _compute_counts_per_newton(source, order)
    if slope is not None:
        deviation = np.sqrt((translation.noise[:, order] ** 2).sum(axis=0)) / slope
        if deviation.any():
            entries.append(("noise", f"{round_number(float(deviation.mean()))}"))
        drift = next((step for step in translation.steps if step["kind"] == "drift"), None)
        if drift is not None:
            # The bias is the mean of a drift that increases linearly from 0 to `slope`: half of `slope`.
            bias = 0.5 * float(np.mean(drift["slope"][order] / slope))
            entries.append(("bias", f"{round_number(bias)}"))
    delay_s = float(max(translation.delay_s[order[0]], 0.0))
    if delay_s:
        entries += [("delay", f"{round_number(delay_s)}"), ("jitter", "0.0")]
    if kernel is not None and len(order) == sides[0] * sides[1]:
        rows: Any = [[round_number(float(one)) for one in row] for row in kernel]
        entries.append(("crosstalk_kernel", pprint.pformat(rows, width=110, compact=True).replace("\n", "\n        ")))
    return entries


def _reorder_matrix(step: dict[str, Any], order: IndexArray) -> FloatArray:
    """Return the mixing matrix of a board, f64[m, m], for its m taxels in another order.

    step: step of a translation with a mixing matrix for each board. order: indices of the taxels of the board.
    """
    board = next(one for one in step["boards"] if np.isin(order[0], one["taxels"]))
    position = {int(taxel): number for number, taxel in enumerate(board["taxels"])}
    rows = [position[int(taxel)] for taxel in order]
    return np.asarray(board["matrix"][np.ix_(rows, rows)])


def _compute_counts_per_newton(source: ExportSource, order: IndexArray) -> FloatArray | None:
    """Compute the slope of the signal over the force at zero force, counts per newton, f64[m] (m taxels); None without
    sensor model.

    order: [m], indices of the taxels.
    """
    if source.model is None:
        return None
    half_n = source.model.half_force_n * np.ones(source.n)
    return np.asarray(source.model.full_scale_drop_counts / half_n[order])


def _describe_grids(grids: dict[str, list[int]]) -> str:
    """Describe the sizes of the boards; with several sizes, each is followed by the addresses of its boards.

    grids: addresses of the boards by size, such as "4 x 5".
    """
    if len(grids) == 1:
        return next(iter(grids))
    return "; ".join(f"{size} on {', '.join(map(str, boards))}" for size, boards in grids.items())
