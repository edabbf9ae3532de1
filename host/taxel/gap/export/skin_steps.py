"""Steps from contact to count: one function for each kind of step, which changes a frame."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Values = dict[str, Any]

MAX_CLOSED_SHARE = 0.98
"""Largest closed share of the gap of a plate capacitor, beyond which the model of the signal is not valid."""
MISSED_SEPARATION_M = 0.0499
"""Separation in metres from which on the normal of a taxel does not meet the object."""
PLAY_SHARE = 0.3
"""Share of the closed gap on which the friction of a sticking layer acts, so that it follows the load with a play."""
CREEP_TIME_CONSTANTS_S = 10.0 ** np.arange(-1.5, 2.0, 0.5)
"""Time constants of the first-order lags that approximate creep, from the duration of a frame to far beyond a grasp."""
CREEP_STEP_DECADES = 0.5
"""Distance of two successive time constants, decades."""
CREEP_START_S = 0.1
"""Age of a load, seconds, at which creep changes nothing."""
DRIFT_END_SHARE = 0.9
"""Share of the duration of a grasp at which the variation of a drift between grasps was measured."""


class Frame:
    """One frame between the steps: force f64[n] (n taxels) (newtons) until `signal` f64[n] (counts below baseline)
    replaces it.

    step_s: time since the previous frame. since_s: time since the start of the effects. age_s: mean age of the baseline
    frames at the start. All in seconds. model: sensor model; None if there is none. separation: distance between object
    and taxel, f64[n], metres; None if unknown. force_scale: factor on the force at half the full scale.
    """

    def __init__(self, step_s: float, since_s: float, age_s: float, model: Values | None) -> None:
        """Create a frame without force and signal.

        step_s: time since the previous frame. since_s: time since the start of the effects. age_s: mean age of the
        baseline frames at the start. All in seconds. model: sensor model; None if there is none.
        """
        self.step_s, self.since_s, self.age_s = step_s, since_s, age_s
        self.model: Values = model or {}
        self.force: Array = np.zeros(0)
        self.signal: Array | None = None
        self.separation: Array | None = None
        self.force_scale: Any = 1.0


def to_arrays(step: Values) -> Values:
    """Return a step of PARAMETERS with its lists and numbers converted to arrays; texts are omitted."""
    values: Values = {
        name: np.asarray(value, float)
        for name, value in step.items()
        if isinstance(value, (list, float, int)) and name != "boards"
    }
    values["boards"] = [
        {name: np.asarray(value, int if name == "taxels" else float) for name, value in board.items()}
        for board in step.get("boards", [])
    ]
    return values


def get_signal(frame: Frame) -> Array:
    """Return the signal of a frame, counts f64[n] (n taxels); forces are converted by the sensor model."""
    if frame.signal is not None:
        return frame.signal
    half_n = frame.model["half_force_n"] * frame.force_scale
    return np.asarray(frame.model["full_scale_counts"] * frame.force / (frame.force + half_n))


def delay_signals(times: Array, signals: Array, delay_s: Array, at: Array) -> Array:
    """Return signals that are delayed by `delay_s` f64[n] (n taxels), seconds, at the times `at`, f64[len(at), n].

    times: f64[K] (K frames), times of the recorded signals f64[K, n], which are interpolated linearly at `at` -
    `delay_s`. Before the first frame the result is the signal of the first frame.
    """
    result = np.empty((len(at), signals.shape[1]))
    for delay in np.unique(delay_s):
        taxels = np.flatnonzero(delay_s == delay)
        moment = at - delay
        right = np.clip(np.searchsorted(times, moment), 0, len(times) - 1)
        before = np.maximum(right - 1, 0)
        gap = times[right] - times[before]
        share = np.where(gap > 0.0, (moment - times[before]) / np.where(gap > 0.0, gap, 1.0), 1.0).clip(0.0, 1.0)[
            :, None
        ]
        part = signals[:, taxels]
        result[:, taxels] = part[before] + share * (part[right] - part[before])
    return result


def _low_pass(values: Array, step_s: float, seconds: Any, state: dict[Any, Any], key: Any = "") -> Array:
    """Return values after a first-order low-pass filter with the time constant `seconds`, and update its state.

    The values are linear between frames; before the first frame, input and output are 0. state: values and result of
    the previous frame under `key`.
    """
    before, filtered = state.get(key, (np.zeros_like(values), np.zeros_like(values)))
    x = np.maximum(step_s / np.maximum(seconds, 1e-6), 1e-12)
    filtered = values + (values - before) * np.expm1(-x) / x + (filtered - before) * np.exp(-x)
    state[key] = values, filtered
    return np.asarray(filtered)


def _delay_share(values: Array, frame: Frame, parameters: Values, state: dict[Any, Any]) -> Array:
    """Return values of which the share `fraction` passes a first-order lag with the time constant `seconds`."""
    return np.asarray(
        values + parameters["fraction"] * (_low_pass(values, frame.step_s, parameters["seconds"], state) - values)
    )


def _close_gap(frame: Frame, half_counts: Array) -> Array:
    """Compute the closed share x of the gap of a plate capacitor with the signal half_counts * x / (1 - x)."""
    signal = np.maximum(get_signal(frame), 0.0)
    return np.asarray(signal / (half_counts + signal))


def _open_gap(closed: Array, half_counts: Array) -> Array:
    """Compute the signal of a closed share of the gap, counts: the inverse of `_close_gap`."""
    closed = np.minimum(closed, MAX_CLOSED_SHARE)
    return np.asarray(half_counts * closed / (1.0 - closed))


def _mix_force(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Spread the forces on each board: taxel j gains the share matrix[i, j] of the force of taxel i."""
    force = frame.force.copy()
    for board in parameters["boards"]:
        force[board["taxels"]] = frame.force[board["taxels"]] @ board["matrix"]
    frame.force = force


def _pillars(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Add the force that taxels gain because the depth decreases with a fixed slope around a loaded place.

    Taxels are divided into pieces. A depth is stated as a share of the greatest depth: a force gives the depth
    force / (force + half_depth_n). Around a loaded piece, the depth decreases linearly, by 1 over the distance
    `reach_m`. Pieces with less than 1e-4 of the largest load reach no other piece noticeably. The depth is limited to
    0.97, because no finite force reaches 1. state: distances of the pieces of each board, divided by `reach_m`.
    """
    force, half_n = frame.force.copy(), float(parameters["half_depth_n"])
    for number, board in enumerate(parameters["boards"]):
        if number not in state:
            points = board["pieces"].reshape(-1, 3)
            distances = np.linalg.norm(points[:, None] - points, axis=2)
            np.fill_diagonal(distances, np.inf)
            state[number] = distances / float(board["reach_m"])
        pieces = board["pieces"].shape[1]
        load = np.repeat(np.maximum(frame.force[board["taxels"]], 0.0), pieces)
        sources = np.flatnonzero(load > 1e-4 * load.max())
        if not len(sources):
            continue
        depth = load / (load + half_n)
        reached = (depth[sources, None] - state[number][sources]).max(axis=0, initial=0.0)
        deeper = np.clip(reached, depth, 0.97)
        gained = np.maximum(half_n * deeper / (1.0 - deeper) - load, 0.0).reshape(-1, pieces).mean(axis=1)
        force[board["taxels"]] += float(board["strength"]) * gained
    frame.force = force


def _half_force(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Multiply the half-scale force by `factor`, unless the forces are already converted to a signal."""
    if frame.signal is None:
        frame.force_scale = frame.force_scale * parameters["factor"]


def _power_force(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Replace the force F by h (F / h)^`exponent`, with the half-scale force h."""
    if frame.signal is None:
        half_n = frame.model["half_force_n"] * frame.force_scale
        frame.force = half_n * (np.maximum(frame.force, 0.0) / half_n) ** parameters["exponent"]


def _late_force(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Let the share `fraction` of the force follow with the time constant `seconds` (parameters of the step)."""
    frame.force = _delay_share(frame.force, frame, parameters, state)


def _late_more(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Add to the force the share `fraction` of the force after a low-pass filter with the time constant `seconds`."""
    low = _low_pass(frame.force, frame.step_s, parameters["seconds"], state)
    frame.force = frame.force + parameters["fraction"] * low


def _late_depth(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Let the share `fraction` of the layer's depth follow with the time constant `seconds`.

    Force and depth are converted into each other by the tabulated law of the layer, `depth_m` and `force_n`.
    """
    depth_m, force_n = parameters["depth_m"], parameters["force_n"]
    depth = _delay_share(np.interp(frame.force, force_n, depth_m), frame, parameters, state)
    frame.force = np.interp(depth, depth_m, force_n)


def _late_signal(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Let the share `fraction` of the signal follow with the time constant `seconds` (parameters of the step)."""
    frame.signal = _delay_share(get_signal(frame), frame, parameters, state)


def _late_gap(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Let the share `fraction` of the closed gap of a plate capacitor follow with the time constant `seconds`."""
    closed = _close_gap(frame, parameters["half_counts"])
    frame.signal = _open_gap(_delay_share(closed, frame, parameters, state), parameters["half_counts"])


def _sticks(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Apply play (backlash) and logarithmic creep to the closed gap of a plate capacitor.

    parameters: `play`, its width, and `creep`, the share per decade of time. state: output of the play, and the states
    of the low-pass filters.
    """
    closed = _close_gap(frame, parameters["half_counts"])
    lagging = np.clip(
        state.get("lagging", np.zeros_like(closed)), np.maximum(closed - parameters["play"] / PLAY_SHARE, 0.0), closed
    )
    state["lagging"] = lagging
    closed = closed + PLAY_SHARE * (lagging - closed)
    # The response of the low-pass filters at the age CREEP_START_S is subtracted, so that the creep is 0 at this age.
    crept = np.expm1(-CREEP_START_S / CREEP_TIME_CONSTANTS_S).sum() * closed
    for constant in CREEP_TIME_CONSTANTS_S:
        crept = crept + _low_pass(closed, frame.step_s, constant, state, constant)
    frame.signal = _open_gap(closed + parameters["creep"] * CREEP_STEP_DECADES * crept, parameters["half_counts"])


def _proximity(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Add a signal of `counts` in contact that decreases with the distance of the object. Raises ValueError without
    separations.
    """
    if frame.separation is None:
        raise ValueError(
            "separation: expected the distances f64[n] in metres, found None; the effect proximity needs them"
        )
    distance = np.maximum(frame.separation, 0.0) / parameters["range_m"]
    is_exponential = bool(parameters["is_exponential"])
    near = np.exp(-(distance ** parameters["shape"])) if is_exponential else np.maximum(1.0 - distance, 0.0)
    frame.signal = get_signal(frame) + parameters["counts"] * np.where(
        frame.separation < MISSED_SEPARATION_M, near, 0.0
    )


def _scale(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    frame.signal = get_signal(frame) * parameters["factor"]


def _power(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Apply a power law with the given exponent to the magnitude of the signal, relative to `scale_counts`."""
    signal, scale = get_signal(frame), parameters["scale_counts"]
    frame.signal = np.sign(signal) * scale * (np.abs(signal) / scale) ** parameters["exponent"]


def _polynomial(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Multiply the signal x by 1 - `quadratic` (1 - u) - `cubic` u (1 - u), with u = |x| / `scale_counts` up to 1."""
    signal = get_signal(frame)
    level = np.minimum(np.abs(signal) / parameters["scale_counts"], 1.0)
    frame.signal = signal * (1.0 - (parameters["quadratic"] + parameters["cubic"] * level) * (1.0 - level))


def _clip(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    frame.signal = np.clip(get_signal(frame), -parameters["counts"], parameters["counts"])


def _soft(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Limit the size of signals x gradually to `counts` c: x c / (|x| + c). A limit from 1e6 counts does nothing."""
    signal, most = get_signal(frame), parameters["counts"]
    frame.signal = np.where(most >= 1e6, signal, signal * most / (np.abs(signal) + most))


def _smooth(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Limit the size of signals x to `counts` c with the `sharpness` p: x / (1 + (|x| / c)^p)^(1 / p). A limit from 1e6
    counts does nothing.
    """
    signal, most, sharpness = get_signal(frame), parameters["counts"], parameters["sharpness"]
    limited = signal / (1.0 + (np.abs(signal) / most) ** sharpness) ** (1.0 / sharpness)
    frame.signal = np.where(most >= 1e6, signal, limited)


def _mix_signal(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Mix the signals on each board: taxel j gains the share matrix[i, j] of the signal of taxel i."""
    signal = get_signal(frame)
    result = signal.copy()
    for board in parameters["boards"]:
        result[board["taxels"]] = signal[board["taxels"]] @ board["matrix"]
    frame.signal = result


def add_drift(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    """Add to the signal a drift that increases linearly with time.

    parameters: `slope`, counts until the time `until_s`; `deviation`, its standard deviation between grasps;
    `from_closing`, 1 if the drift begins with the closing instead of in the baseline frames. state: `deviate`, a
    standard normal random number for each taxel, equal for all taxels that drift together.
    """
    # The deviation was measured where only the share DRIFT_END_SHARE of the drift was reached.
    slope = parameters["slope"] + parameters["deviation"] * state["deviate"] / DRIFT_END_SHARE
    age_s = frame.age_s * (1.0 - parameters["from_closing"])
    share = (frame.since_s + age_s) / (parameters["until_s"] + age_s)
    frame.signal = get_signal(frame) + slope * share


def _lag(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    frame.signal = _low_pass(get_signal(frame), frame.step_s, parameters["seconds"], state)


FORCE_STEPS = {
    "mix_force": _mix_force,
    "pillars": _pillars,
    "half_force": _half_force,
    "power_force": _power_force,
    "late_force": _late_force,
    "late_more": _late_more,
    "late_depth": _late_depth,
}
"""Steps that act on forces."""

STEPS = {
    **FORCE_STEPS,
    "late_signal": _late_signal,
    "late_gap": _late_gap,
    "sticks": _sticks,
    "proximity": _proximity,
    "scale": _scale,
    "power": _power,
    "polynomial": _polynomial,
    "clip": _clip,
    "soft": _soft,
    "smooth": _smooth,
    "mix_signal": _mix_signal,
    "drift": add_drift,
    "lag": _lag,
}
"""Functions of all steps by kind; each changes a frame."""
