"""Python source with modifiers and noise models of Isaac Lab for the observation of each board."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from taxel.gap.export.common import ExportSource
from taxel.gap.export.python_module import format_tables, list_limits, round_number
from taxel.gap.export.skin_steps import FORCE_STEPS
from taxel.gap.export.translation import Step, Translation
from taxel.types import FloatArray, IndexArray

VERSION: Final = "3.0.0"
"""Version of the package isaaclab whose names are used: `isaaclab.utils.noise` and `isaaclab.utils.modifiers`."""

DEFAULT_STEP_S: Final = 0.02
"""Time between two observations, seconds, if the user states none: 50 Hz, the control rate of Isaac Lab's examples."""

NEEDS_FORCES: Final = "acts on forces: the observation is a signal; use --to python before the observation"
LOST_FRAMES: Final = "Isaac Lab has no term that repeats the last observation at random"
NEEDS_SEPARATION: Final = "needs the distance between object and taxel, which the observation lacks"
NEEDS_PLAY: Final = "Isaac Lab has no modifier with a play; use --to python"
COMMON_NOISE: Final = "GaussianNoiseCfg samples each taxel alone: the variance is right, the correlation on lines is 0"
DRIFT: Final = "a bias of each episode with the mean of the drift over a grasp instead of a slope"
STUCK: Final = "constant taxels keep their noise"
NEGATIVE_DELAY: Final = "a board that precedes the simulator has a delay of 0"

HEAD: Final = '''"""{note}

Names of Isaac Lab {version} (isaaclab.utils.noise, isaaclab.utils.modifiers).
Each board has its own observation term. Its function returns the signals of the board's taxels, float[num_envs, m]:
counts below the baseline, in the order of TAXELS[board]. Example:

    ObservationTermCfg(func=signals_of_board, modifiers=MODIFIERS[{board}], noise=NOISE.get({board}))
{limits}"""

import torch
from isaaclab.utils import modifiers
from isaaclab.utils.noise import GaussianNoiseCfg, NoiseModelWithAdditiveBiasCfg

DEVICE = "cuda:0"  # of the simulation
STEP_S = {step_s!r}  # seconds between two observations; the filters are computed for this time


def tensor(values):
    return torch.tensor(values, dtype=torch.float32, device=DEVICE)


def mix(data, matrix):
    """Crosstalk: each taxel gains shares of the signals of other taxels."""
    return data @ matrix


def saturate(data, counts):
    """Gradual saturation."""
    return data * counts / (data.abs() + counts)


def saturate_smoothly(data, counts, sharpness):
    """Saturation with a sharpness."""
    return data / (1.0 + (data.abs() / counts) ** sharpness) ** (1.0 / sharpness)


def raise_to_power(data, exponent, scale):
    """Power law of the signal."""
    return data.sign() * scale * (data.abs() / scale) ** exponent


def bend(data, quadratic, cubic, scale):
    """Polynomial of the signal, fixed at 0 and at the full scale."""
    level = (data.abs() / scale).clamp(max=1.0)
    return data * (1.0 - (quadratic + cubic * level) * (1.0 - level))


def close_gap(data, half_counts):
    """Closed share of the gap of a plate capacitor."""
    positive = data.clamp(min=0.0)
    return positive / (half_counts + positive)


def open_gap(data, half_counts):
    """Signal of the closed share of a gap."""
    share = data.clamp(max=0.98)
    return half_counts * share / (1.0 - share)


'''


def write_isaac(source: ExportSource, translation: Translation, step_s: float, note: str) -> tuple[str, Translation]:
    """Return the text of a Python file with Isaac Lab configurations, and the translation reduced to what Isaac Lab
    supports.

    translation: effects as numeric steps. step_s: time between two observations, seconds. note: line that states the
    origin of the file.
    """
    limited = _restrict_to_isaac(translation)
    report = source.report
    taxels, filters, noises = [], [], []
    for address, board_taxels in source.iterate_boards():
        lines = list(zip(report.tx[board_taxels].tolist(), report.rx[board_taxels].tolist(), strict=True))
        taxels.append(f"    {address}: {lines},  # (TX line, RX line)")
        modifiers = [text for step in limited.steps for text in _write_modifiers(step, board_taxels, step_s)]
        delay_s = float(max(limited.delay_s[board_taxels[0]], 0.0))
        if delay_s:
            modifiers.append(
                _write_filter([0.0], _compute_delay_taps(delay_s, step_s), f"delay of {round_number(delay_s)} s")
            )
        filters.append(f"    {address}: [\n" + "".join(f"        {text}\n" for text in modifiers) + "    ],")
        noise = _write_noise(limited, board_taxels)
        if noise:
            noises.append(f"    {address}: {noise},")
    head = HEAD.format(
        note=note,
        version=VERSION,
        board=source.boards[0],
        limits="".join(f"\n{line}" for line in list_limits(limited)) + "\n",
        step_s=step_s,
    )
    tables = {"TAXELS": taxels, "MODIFIERS": filters, "NOISE": noises}
    return f"{head}{format_tables(tables)}\n", limited


def _restrict_to_isaac(translation: Translation) -> Translation:
    """Return a translation without the numeric steps that Isaac Lab lacks, with the reasons for omitted and
    approximated effects.
    """
    refused, approximated = dict(translation.not_expressed), dict(translation.approximated)
    steps = []
    for step in translation.steps:
        reason = _explain_missing_modifier(step)
        if reason:
            refused[step["effect"]] = reason
        else:
            steps.append(step)
        if step["kind"] == "drift":
            approximated[step["effect"]] = DRIFT
    if translation.lost.any():
        refused["dropout: lost frames"] = LOST_FRAMES
    if translation.stuck:
        approximated["dropout: constant taxels"] = STUCK
    if translation.noise[1:].any():
        approximated["noise"] = COMMON_NOISE
    if (translation.delay_s < 0.0).any():
        approximated["latency"] = NEGATIVE_DELAY
    return translation.restrict(steps, approximated, refused)


def _explain_missing_modifier(step: Step) -> str:
    """Return why Isaac Lab cannot express a step of an effect by a modifier; an empty string if it can.

    A modifier is an Isaac Lab function that changes an observation, here the signals of a board. A step is one numeric
    operation of an effect (`translation.Translation.steps`); its `kind` names the operation.
    """
    kind = step["kind"]
    if kind in FORCE_STEPS:
        return NEEDS_FORCES
    return {"proximity": NEEDS_SEPARATION, "sticks": NEEDS_PLAY}.get(kind, "")


def _write_modifiers(step: Step, taxels: IndexArray, step_s: float) -> list[str]:
    """Return the source texts of the Isaac Lab modifiers that perform a step of an effect on one board.

    taxels: indices of the taxels of the board. step_s: time between two observations, seconds. The list is empty for a
    step that needs no modifier, such as a drift.
    """
    kind, name = step["kind"], step["effect"]
    if kind == "scale":
        return [_write_function("modifiers.scale", {"multiplier": step["factor"][taxels]}, name)]
    if kind == "clip":
        limit = float(step["counts"][taxels[0]])
        return [_write_function("modifiers.clip", {"bounds": (-limit, limit)}, name)]
    if kind == "soft":
        return [_write_function("saturate", {"counts": step["counts"][taxels]}, name)]
    if kind == "smooth":
        limits = {"counts": step["counts"][taxels], "sharpness": step["sharpness"][taxels]}
        return [_write_function("saturate_smoothly", limits, name)]
    if kind == "polynomial":
        terms = {term: step[term][taxels] for term in ("quadratic", "cubic")}
        return [_write_function("bend", {**terms, "scale": step["scale_counts"]}, name)]
    if kind == "power":
        parameters = {"exponent": step["exponent"][taxels], "scale": step["scale_counts"]}
        return [_write_function("raise_to_power", parameters, name)]
    if kind == "mix_signal":
        matrix = next(board["matrix"] for board in step["boards"] if board["taxels"][0] == taxels[0])
        return [_write_function("mix", {"matrix": matrix}, name)]
    if kind == "lag":
        return [_write_lag_filter(1.0, float(step["seconds"][taxels[0]]), step_s, name)]
    if kind in ("late_signal", "late_gap"):
        late = _write_lag_filter(float(step["fraction"][taxels[0]]), float(step["seconds"][taxels[0]]), step_s, name)
        if kind == "late_signal":
            return [late]
        share = {"half_counts": step["half_counts"]}
        return [_write_function("close_gap", share, name), late, _write_function("open_gap", share, name)]
    return []


def _write_lag_filter(fraction: float, seconds: float, step_s: float, name: str) -> str:
    """Return the source text of a filter that passes the share `fraction` of the signal through a first-order lag.

    seconds: time constant of the lag. step_s: time between two observations, seconds. name: effect, for the comment.
    The coefficients are exact for signals that are linear between two observations.
    """
    x = step_s / max(seconds, 1e-6)
    kept, ramp = float(np.exp(-x)), float(np.expm1(-x) / x)
    taps = [(1.0 - fraction) + fraction * (1.0 + ramp), -(1.0 - fraction) * kept - fraction * (ramp + kept)]
    return _write_filter([-kept], taps, f"{name}: fraction {round_number(fraction)}, {round_number(seconds)} s")


def _compute_delay_taps(delay_s: float, step_s: float) -> list[float]:
    """Return the coefficients of a filter that delays its input by `delay_s`, newest input first.

    step_s: time between two observations, seconds. Between two observations the delay is interpolated linearly.
    """
    whole, share = divmod(delay_s / step_s, 1.0)
    return [0.0] * int(whole) + [1.0 - share, share]


def _write_filter(past: list[float], taps: list[float], comment: str) -> str:
    """Return the source text of a digital filter.

    past: coefficients of previous outputs. taps: coefficients of the inputs. Both start with the newest value.
    """
    return f"modifiers.DigitalFilterCfg(A={_write_value(past)}, B={_write_value(taps)}),  # {comment}"


def _write_function(function: str, parameters: dict[str, Any], comment: str) -> str:
    """Return the source text of a modifier that calls a function. parameters: arguments by name."""
    text = ", ".join(f'"{name}": {_write_value(value)}' for name, value in parameters.items())
    return f"modifiers.ModifierCfg(func={function}, params={{{text}}}),  # {comment}"


def _write_noise(translation: Translation, taxels: IndexArray) -> str:
    """Return the source text of the noise model of a board; an empty string without noise and drift.

    taxels: indices of the taxels of the board.
    """
    deviation: FloatArray = np.sqrt((translation.noise[:, taxels] ** 2).sum(axis=0))
    drift = next((step for step in translation.steps if step["kind"] == "drift"), None)
    white = f"GaussianNoiseCfg(mean=0.0, std={_write_value(deviation if np.ptp(deviation) else float(deviation[0]))})"
    if drift is None:
        return white if deviation.any() else ""
    # The mean of a drift that increases linearly from 0 to `slope` is half of `slope`.
    mean, std = 0.5 * float(drift["slope"][taxels[0]]), float(drift["deviation"][taxels[0]])
    # With the operation "add", the bias of an episode would be added to the bias of the previous episode.
    bias = f'GaussianNoiseCfg(mean={_write_value(mean)}, std={_write_value(std)}, operation="abs")'
    return f"NoiseModelWithAdditiveBiasCfg(noise_cfg={white}, bias_noise_cfg={bias}, sample_bias_per_component=False)"


def _write_value(value: Any) -> str:
    """Return the Python source text of a number, list or tuple of numbers, or array (as a tensor)."""
    if isinstance(value, np.ndarray):
        return f"tensor({_write_value(value.tolist())})"
    if isinstance(value, list | tuple):
        texts = ", ".join(_write_value(one) for one in value)
        return f"[{texts}]" if isinstance(value, list) else f"({texts})"
    return repr(round_number(value)) if isinstance(value, float) else repr(value)
