"""Effects of a tactile skin on the raw counts of a simulator, frame by frame; needs only NumPy.

    effects = SkinEffects()
    effects.reset(seed=0, start_s=0.5)      # the effects of contact act from 0.5 s on; earlier frames are the baseline
    counts = effects.apply(time_s, counts)  # one frame, f64[n]
    counts = effects.apply_recording(time_s, counts, force)  # a whole recording, f64[T, n]

The signal of a taxel is its baseline minus its raw count. The order of the taxels is that of TAXELS.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Values = dict[str, Any]

PARAMETERS: dict[str, Any] = json.loads("{}")  # PARAMETERS

TAXELS = PARAMETERS.get("taxels", {})
"""Columns `board` (position in SkinEffects.boards), `tx` and `rx` of the n taxels, in the order of the counts."""

LARGEST_COUNT = 65_535
MOST_CLOSED = 0.98
"""Largest closed share of a plate capacitor's gap."""
MOST_OF_SCALE = 0.98
"""Largest share of the full scale that is converted into a force; larger signals give the force of this share."""
MISSED_M = 0.0499
"""Separation, metres, from which on the normal of a taxel misses the object."""
PLAY_SHARE = 0.3
"""Share of the closed gap that the play of a sticking layer holds back."""
CREEP_TIMES_S = 10.0 ** np.arange(-1.5, 2.0, 0.5)
CREEP_STEP_DECADES = 0.5
CREEP_START_S = 0.1
"""Age of a load, seconds, at which creep changes nothing."""
END_SHARE = 0.9
"""Share of the duration of a grasp at which the variation of a drift between grasps was measured."""
BASELINE_FRAMES = 100
"""Largest number of frames before the start that the baseline is averaged over."""


class Frame:
    """One frame between the steps: force f64[n] (newtons) until `signal` f64[n] (counts below baseline) replaces it."""

    def __init__(self, step_s: float, since_s: float, age_s: float, model: Values | None) -> None:
        self.step_s, self.since_s, self.age_s = step_s, since_s, age_s
        self.model: Values = model or {}
        self.force: Array = np.zeros(0)
        self.signal: Array | None = None
        self.separation: Array | None = None
        self.force_scale: Any = 1.0


class SkinEffects:
    """Effects with their state. Attributes: n, boards (addresses), valid (bool[boards], of the last frame),
    valid_frames (bool[T, boards], of the last recording), not_expressed (reason by effect).
    """

    def __init__(self, parameters: Values | None = None) -> None:
        self.parameters = PARAMETERS if parameters is None else parameters
        own = self.parameters
        self.n = len(own["taxels"]["board"])
        self.boards = tuple(own["boards"])
        self.not_expressed = dict(own["not_expressed"])
        self.has_force_steps = any(step["kind"] in FORCE_STEPS for step in own["steps"])
        self._steps = [(STEPS[step["kind"]], _arrays(step)) for step in own["steps"]]
        self._board = np.array(own["taxels"]["board"])
        self._delay_s = np.array(own["delay_s"] or [0.0] * self.n)
        self._lost = np.array(own["lost"] or [0.0] * len(self.boards))
        self._stuck = np.array(own["stuck"], dtype=int)
        model = own["sensor_model"]
        self._model = None if model is None else {name: np.asarray(value, float) for name, value in model.items()}
        self.reset()

    def reset(self, seed: int = 0, start_s: float | None = None, baseline: npt.ArrayLike | None = None) -> None:
        """Forget all previous frames.

        seed: of noise, drift and lost frames. start_s: time from which the effects of contact act; None: the first
        frame. baseline: raw counts f64[n] without contact; None: that of the sensor model, or the mean of the frames
        before start_s, or the first frame.
        """
        self._noise = np.random.default_rng([seed, 1])
        self._loss = np.random.default_rng([seed, 3])
        self._start_s, self._given_baseline = start_s, baseline
        self._before: list[Array] = []
        self._history: list[tuple[float, Array]] = []
        self._first_s: float | None = None
        self._last_s: float | None = None
        self._held: Array = np.zeros(self.n)
        self._state: list[dict[Any, Any]] = [{} for _ in self._steps]
        drift = np.random.default_rng([seed, 2])
        for (step, values), state in zip(self._steps, self._state, strict=True):
            if step is _drift:
                state["deviate"] = drift.normal(size=int(values["block"].max()) + 1)[values["block"].astype(int)]
        self.valid = np.ones(len(self.boards), bool)

    def counts_of(self, force: npt.ArrayLike) -> Array:
        """Raw counts without effects and without noise for forces f64[..., n], newtons; needs a sensor model."""
        if self._model is None:
            raise ValueError("sensor model: expected one in the exported file, found none; export again with --sim")
        return self._model["baseline_counts"] - self._signal_of(np.asarray(force, float))

    def apply(
        self,
        time_s: float,
        values: npt.ArrayLike,
        force: npt.ArrayLike | None = None,
        separation: npt.ArrayLike | None = None,
    ) -> Array:
        """The raw counts f64[n] of one frame with the effects.

        time_s: increasing from frame to frame. values: raw counts f64[n] of the simulator. force: f64[n], newtons;
        None: computed from the values by the sensor model where an effect needs it. separation: f64[n], metres, needed
        by the effect proximity. A negative delay is 0 here. Raises ValueError for a wrong shape or a missing input.
        """
        values, base, signal = self._shape(float(time_s), values, force, separation)
        if signal is None:
            return self._finish(values, np.zeros(self.n))
        delay_s = np.maximum(self._delay_s, 0.0)
        if delay_s.any():
            self._history.append((float(time_s), signal))
            while len(self._history) > 2 and self._history[1][0] < time_s - delay_s.max():
                self._history.pop(0)
            times, signals = np.array([one[0] for one in self._history]), np.array([one[1] for one in self._history])
            signal = _delayed(times, signals, delay_s, np.array([float(time_s)]))[0]
        return self._finish(values, signal - base)

    def apply_recording(
        self,
        time_s: npt.ArrayLike,
        values: npt.ArrayLike,
        force: Array | None = None,
        separation: Array | None = None,
        seed: int = 0,
        start_s: float | None = None,
        baseline: npt.ArrayLike | None = None,
    ) -> Array:
        """The raw counts f64[T, n] of a recording with the effects; negative delays are applied as well.

        time_s: f64[T]. values: raw counts f64[T, n]. force, separation: f64[T, n] or None. seed, start_s, baseline: see
        `reset`, which is called first. Raises ValueError for a wrong shape or a missing input.
        """
        self.reset(seed, start_s, baseline)
        time_s, values = np.asarray(time_s, float), np.asarray(values, float)
        if time_s.ndim != 1 or values.shape != (len(time_s), self.n):
            raise ValueError(f"values: expected the shape ({time_s.size}, {self.n}), found {values.shape}")
        rows = [
            self._shape(
                time, values[k], None if force is None else force[k], None if separation is None else separation[k]
            )
            for k, time in enumerate(time_s.tolist())
        ]
        own = [k for k, row in enumerate(rows) if row[2] is not None]
        change = np.zeros(values.shape)
        if own:
            signals = np.array([rows[k][2] for k in own])
            if self._delay_s.any():
                signals = _delayed(time_s[own], signals, self._delay_s, time_s[own])
            change[own] = signals - np.array([rows[k][1] for k in own])
        result, valid = np.empty(values.shape), []
        for k in range(len(values)):
            result[k] = self._finish(values[k], change[k])
            valid.append(self.valid)
        self.valid_frames = np.array(valid, bool).reshape(len(values), len(self.boards))
        return result

    def _shape(
        self, time_s: float, values: npt.ArrayLike, force: npt.ArrayLike | None, separation: npt.ArrayLike | None
    ) -> tuple[Array, Array, Array | None]:
        """Values, signal without effects and signal with all effects before the delay; None before the start."""
        values = self._checked("values", values)
        if self._first_s is None:
            self._first_s = time_s
        step_s = 0.0 if self._last_s is None else time_s - self._last_s
        if step_s < 0.0:
            raise ValueError(f"time_s: expected at least {self._last_s}, found {time_s}; call reset() first")
        self._last_s = time_s
        start_s = self._first_s if self._start_s is None else self._start_s
        if time_s < start_s:
            if len(self._before) < BASELINE_FRAMES:
                self._before.append(values)
            return values, values, None
        rest = self._baseline(values)
        signal = rest - values
        newtons: Array | None = None
        if self._model is None or not (self.has_force_steps or force is not None):
            pass
        elif force is None:
            share = np.clip(signal / self._model["full_scale_counts"], 0.0, MOST_OF_SCALE)
            newtons = self._model["half_force_n"] * share / (1.0 - share)
        else:
            newtons = self._checked("force", force)
        base = signal if newtons is None else self._signal_of(newtons)
        # The baseline is as old as the middle of its frames.
        age_s = 0.5 * step_s * len(self._before)
        frame = Frame(step_s, time_s - start_s + 0.5 * step_s, age_s, self._model)
        frame.separation = None if separation is None else self._checked("separation", separation)
        if newtons is None:
            frame.signal = signal
        else:
            frame.force = newtons
        for (step, parameters), state in zip(self._steps, self._state, strict=True):
            step(frame, parameters, state)
        return values, base, _signal(frame)

    def _baseline(self, values: Array) -> Array:
        if self._given_baseline is None:
            if self._model is not None:
                self._given_baseline = self._model["baseline_counts"]
            else:
                self._given_baseline = np.mean(self._before, axis=0) if self._before else values
        return np.asarray(self._given_baseline, float)

    def _signal_of(self, force: Array) -> Array:
        assert self._model is not None
        return np.asarray(self._model["full_scale_counts"] * force / (force + self._model["half_force_n"]))

    def _checked(self, name: str, values: npt.ArrayLike) -> Array:
        values = np.asarray(values, float)
        if values.shape != (self.n,):
            raise ValueError(f"{name}: expected {self.n} numbers, found an array of shape {values.shape}")
        return values

    def _finish(self, values: Array, change: Array) -> Array:
        """Counts with the change of the signal, noise, constant taxels and lost frames."""
        result = values - change
        for deviation, member in zip(self.parameters["noise"], self.parameters["noise_groups"], strict=True):
            if any(deviation):
                result = result + np.array(deviation) * self._noise.normal(size=max(member) + 1)[np.array(member)]
        result = np.clip(np.rint(result), 0, LARGEST_COUNT)
        if len(self._stuck):
            rest = np.broadcast_to(self._baseline(values), (self.n,))
            result[self._stuck] = np.rint(rest[self._stuck])
        self.valid = self._loss.random(len(self.boards)) >= self._lost
        self._held = np.where(self.valid[self._board], result, self._held)
        return self._held.copy()


def _arrays(step: Values) -> Values:
    """A step of PARAMETERS with arrays instead of lists."""
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


def _signal(frame: Frame) -> Array:
    """The signal of a frame, counts; forces are converted by the sensor model."""
    if frame.signal is not None:
        return frame.signal
    half_n = frame.model["half_force_n"] * frame.force_scale
    return np.asarray(frame.model["full_scale_counts"] * frame.force / (frame.force + half_n))


def _delayed(times: Array, signals: Array, delay_s: Array, at: Array) -> Array:
    """Signals f64[K, n] at the times at - delay_s, linear between frames; before the first frame its signal."""
    result = np.empty((len(at), signals.shape[1]))
    for delay in np.unique(delay_s):
        taxels = np.flatnonzero(delay_s == delay)
        moment = at - delay
        right = np.clip(np.searchsorted(times, moment), 0, len(times) - 1)
        left = np.maximum(right - 1, 0)
        gap = times[right] - times[left]
        share = np.where(gap > 0.0, (moment - times[left]) / np.where(gap > 0.0, gap, 1.0), 1.0).clip(0.0, 1.0)[:, None]
        part = signals[:, taxels]
        result[:, taxels] = part[left] + share * (part[right] - part[left])
    return result


def _low_pass(values: Array, step_s: float, seconds: Any, state: dict[Any, Any], key: Any = "") -> Array:
    """First-order low pass of values that are linear between frames, from rest."""
    before, behind = state.get(key, (np.zeros_like(values), np.zeros_like(values)))
    x = np.maximum(step_s / np.maximum(seconds, 1e-6), 1e-12)
    behind = values + (values - before) * np.expm1(-x) / x + (behind - before) * np.exp(-x)
    state[key] = values, behind
    return np.asarray(behind)


def _late(values: Array, frame: Frame, parameters: Values, state: dict[Any, Any]) -> Array:
    """A share `fraction` of the values arrives late, with the time constant `seconds`."""
    return np.asarray(
        values + parameters["fraction"] * (_low_pass(values, frame.step_s, parameters["seconds"], state) - values)
    )


def _closed(frame: Frame, half_counts: Array) -> Array:
    """Closed share of the gap of a plate capacitor with the signal half_counts * x / (1 - x)."""
    signal = np.maximum(_signal(frame), 0.0)
    return np.asarray(signal / (half_counts + signal))


def _of_closed(closed: Array, half_counts: Array) -> Array:
    closed = np.minimum(closed, MOST_CLOSED)
    return np.asarray(half_counts * closed / (1.0 - closed))


def _mix_force(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    force = frame.force.copy()
    for board in parameters["boards"]:
        force[board["taxels"]] = frame.force[board["taxels"]] @ board["matrix"]
    frame.force = force


def _pillars(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    force, half_n = frame.force.copy(), float(parameters["half_depth_n"])
    for number, board in enumerate(parameters["boards"]):
        if number not in state:
            points = board["pieces"].reshape(-1, 3)
            apart = np.linalg.norm(points[:, None] - points, axis=2)
            np.fill_diagonal(apart, np.inf)
            state[number] = apart / float(board["reach_m"])
        pieces = board["pieces"].shape[1]
        own = np.repeat(np.maximum(frame.force[board["taxels"]], 0.0), pieces)
        sources = np.flatnonzero(own > 1e-4 * own.max())
        if not len(sources):
            continue
        depth = own / (own + half_n)
        reached = (depth[sources, None] - state[number][sources]).max(axis=0, initial=0.0)
        deeper = np.clip(reached, depth, 0.97)
        gained = np.maximum(half_n * deeper / (1.0 - deeper) - own, 0.0).reshape(-1, pieces).mean(axis=1)
        force[board["taxels"]] += float(board["strength"]) * gained
    frame.force = force


def _half_force(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    if frame.signal is None:
        frame.force_scale = frame.force_scale * parameters["factor"]


def _late_force(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    frame.force = _late(frame.force, frame, parameters, state)


def _late_more(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    low = _low_pass(frame.force, frame.step_s, parameters["seconds"], state)
    frame.force = frame.force + parameters["fraction"] * low


def _late_depth(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    depth_m, force_n = parameters["depth_m"], parameters["force_n"]
    depth = _late(np.interp(frame.force, force_n, depth_m), frame, parameters, state)
    frame.force = np.interp(depth, depth_m, force_n)


def _late_signal(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    frame.signal = _late(_signal(frame), frame, parameters, state)


def _late_gap(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    closed = _closed(frame, parameters["half_counts"])
    frame.signal = _of_closed(_late(closed, frame, parameters, state), parameters["half_counts"])


def _sticks(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    closed = _closed(frame, parameters["half_counts"])
    held = np.clip(
        state.get("held", np.zeros_like(closed)), np.maximum(closed - parameters["play"] / PLAY_SHARE, 0.0), closed
    )
    state["held"] = held
    closed = closed + PLAY_SHARE * (held - closed)
    crept = np.expm1(-CREEP_START_S / CREEP_TIMES_S).sum() * closed
    for constant in CREEP_TIMES_S:
        crept = crept + _low_pass(closed, frame.step_s, constant, state, constant)
    frame.signal = _of_closed(closed + parameters["creep"] * CREEP_STEP_DECADES * crept, parameters["half_counts"])


def _proximity(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    if frame.separation is None:
        raise ValueError(
            "separation: expected the distances f64[n] in metres, found None; the effect proximity needs them"
        )
    apart = np.maximum(frame.separation, 0.0) / parameters["range_m"]
    near = np.exp(-apart) if parameters["is_exponential"] else np.maximum(1.0 - apart, 0.0)
    frame.signal = _signal(frame) + parameters["counts"] * np.where(frame.separation < MISSED_M, near, 0.0)


def _scale(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    frame.signal = _signal(frame) * parameters["factor"]


def _power(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    signal, scale = _signal(frame), parameters["scale_counts"]
    frame.signal = np.sign(signal) * scale * (np.abs(signal) / scale) ** parameters["exponent"]


def _clip(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    frame.signal = np.minimum(_signal(frame), parameters["counts"])


def _soft(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    signal, most = _signal(frame), parameters["counts"]
    positive = np.maximum(signal, 0.0)
    frame.signal = np.where(most >= 1e6, signal, signal - positive + positive * most / (positive + most))


def _mix_signal(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    signal = _signal(frame)
    result = signal.copy()
    for board in parameters["boards"]:
        result[board["taxels"]] = signal[board["taxels"]] @ board["matrix"]
    frame.signal = result


def _drift(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    slope = parameters["slope"] + parameters["deviation"] * state["deviate"] / END_SHARE
    share = (frame.since_s + frame.age_s) / (parameters["until_s"] + frame.age_s)
    frame.signal = _signal(frame) + slope * share


def _lag(frame: Frame, parameters: Values, state: dict[Any, Any]) -> None:
    frame.signal = _low_pass(_signal(frame), frame.step_s, parameters["seconds"], state)


FORCE_STEPS = {
    "mix_force": _mix_force,
    "pillars": _pillars,
    "half_force": _half_force,
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
    "clip": _clip,
    "soft": _soft,
    "mix_signal": _mix_signal,
    "drift": _drift,
    "lag": _lag,
}
"""Functions of all steps by their kind; each changes a frame."""
