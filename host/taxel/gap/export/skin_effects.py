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

from taxel.gap.export.skin_steps import (
    FORCE_STEPS,
    STEPS,
    Array,
    Frame,
    Values,
    add_drift,
    delay_signals,
    get_signal,
    to_arrays,
)

PARAMETERS: dict[str, Any] = json.loads("{}")  # PARAMETERS

TAXELS = PARAMETERS.get("taxels", {})
"""Columns `board` (position in SkinEffects.boards), `tx` and `rx` of the n taxels, in the order of the counts."""

LARGEST_COUNT = 65_535
"""Largest raw count: 16 bits."""
MAX_SCALE_SHARE = 0.98
"""Largest share of the full scale that is converted into a force; larger signals give the force of this share."""
BASELINE_FRAMES = 100
"""Largest number of frames before the start that the baseline is averaged over."""


class SkinEffects:
    """Effects with their state over the frames of a stream.

    Attributes:
        n: number of taxels.
        boards: addresses.
        valid: bool[boards], whether the last frame of each board arrived.
        valid_frames: bool[T, boards] (T frames), the same for the frames of the last recording.
        not_expressed: reason by name of an effect that the module lacks.
    """

    def __init__(self, parameters: Values | None = None) -> None:
        """Prepare the effects of `parameters`; None: the effects of this module, `PARAMETERS`."""
        self.parameters = parameters = PARAMETERS if parameters is None else parameters
        self.n = len(parameters["taxels"]["board"])
        self.boards = tuple(parameters["boards"])
        self.not_expressed = dict(parameters["not_expressed"])
        self.has_force_steps = any(step["kind"] in FORCE_STEPS for step in parameters["steps"])
        self._steps = [(STEPS[step["kind"]], to_arrays(step)) for step in parameters["steps"]]
        self._board = np.array(parameters["taxels"]["board"])
        self._delay_s = np.array(parameters["delay_s"] or [0.0] * self.n)
        self._lost = np.array(parameters["lost"] or [0.0] * len(self.boards))
        self._stuck = np.array(parameters["stuck"], dtype=int)
        model = parameters["sensor_model"]
        self._model = None if model is None else {name: np.asarray(value, float) for name, value in model.items()}
        self.reset()

    def reset(self, seed: int = 0, start_s: float | None = None, baseline: npt.ArrayLike | None = None) -> None:
        """Discard the state of all previous frames.

        seed: seed of the random numbers of noise, drift and lost frames. start_s: time from which the effects of
        contact act; None: time of the first frame. baseline: raw counts f64[n] (n taxels) without contact; None: the
        baseline of the sensor model; without a sensor model, the mean of the frames before start_s, or the first frame.
        """
        self._noise = np.random.default_rng([seed, 1])
        self._loss = np.random.default_rng([seed, 3])
        self._start_s, self._given_baseline = start_s, baseline
        self._before: list[Array] = []
        self._history: list[tuple[float, Array]] = []
        self._first_s: float | None = None
        self._last_s: float | None = None
        self._last_counts: Array = np.zeros(self.n)
        self._state: list[dict[Any, Any]] = [{} for _ in self._steps]
        drift = np.random.default_rng([seed, 2])
        for (step, values), state in zip(self._steps, self._state, strict=True):
            if step is add_drift:
                state["deviate"] = drift.normal(size=int(values["block"].max()) + 1)[values["block"].astype(int)]
        self.valid = np.ones(len(self.boards), bool)

    def compute_counts(self, force: npt.ArrayLike) -> Array:
        """Convert forces f64[..., n] (n taxels), newtons, into raw counts without effects and noise.

        Raises ValueError if the exported file has no sensor model.
        """
        if self._model is None:
            raise ValueError("sensor model: expected one in the exported file, found none; export again with --sim")
        return self._model["baseline_counts"] - self._convert_force(np.asarray(force, float))

    def apply(
        self,
        time_s: float,
        values: npt.ArrayLike,
        force: npt.ArrayLike | None = None,
        separation: npt.ArrayLike | None = None,
    ) -> Array:
        """Compute the raw counts f64[n] (n taxels) of one frame with the effects.

        time_s: time of the frame, not before that of the previous frame. values: raw counts f64[n] of the simulator.
        force: f64[n], newtons; None: computed from the values by the sensor model where an effect needs it. separation:
        distance of the object from each taxel, f64[n], metres, needed by the effect proximity. A negative delay is
        treated as 0. Raises ValueError for a wrong shape or a missing input.
        """
        values, base, signal = self._apply_steps(float(time_s), values, force, separation)
        if signal is None:
            return self._finish(values, np.zeros(self.n))
        delay_s = np.maximum(self._delay_s, 0.0)
        if delay_s.any():
            self._history.append((float(time_s), signal))
            while len(self._history) > 2 and self._history[1][0] < time_s - delay_s.max():
                self._history.pop(0)
            times, signals = np.array([one[0] for one in self._history]), np.array([one[1] for one in self._history])
            signal = delay_signals(times, signals, delay_s, np.array([float(time_s)]))[0]
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
        """Compute the raw counts f64[T, n] (T frames, n taxels) of a recording with the effects; negative delays are
        applied as well.

        time_s: f64[T]. values: raw counts f64[T, n]. force, separation: f64[T, n] or None. seed, start_s, baseline: see
        `reset`, which is called first. Raises ValueError for a wrong shape or a missing input.
        """
        self.reset(seed, start_s, baseline)
        time_s, values = np.asarray(time_s, float), np.asarray(values, float)
        if time_s.ndim != 1 or values.shape != (len(time_s), self.n):
            raise ValueError(f"values: expected the shape ({time_s.size}, {self.n}), found {values.shape}")
        rows = [
            self._apply_steps(
                time, values[k], None if force is None else force[k], None if separation is None else separation[k]
            )
            for k, time in enumerate(time_s.tolist())
        ]
        started = [k for k, row in enumerate(rows) if row[2] is not None]
        change = np.zeros(values.shape)
        if started:
            signals = np.array([rows[k][2] for k in started])
            if self._delay_s.any():
                signals = delay_signals(time_s[started], signals, self._delay_s, time_s[started])
            change[started] = signals - np.array([rows[k][1] for k in started])
        result, valid = np.empty(values.shape), []
        for k in range(len(values)):
            result[k] = self._finish(values[k], change[k])
            valid.append(self.valid)
        self.valid_frames = np.array(valid, bool).reshape(len(values), len(self.boards))
        return result

    def _apply_steps(
        self, time_s: float, values: npt.ArrayLike, force: npt.ArrayLike | None, separation: npt.ArrayLike | None
    ) -> tuple[Array, Array, Array | None]:
        """Return the raw counts `values`, the signal without effects, and the signal with all effects except the delay.

        All are f64[n] (n taxels), counts. Before the start time the last item is None, and the second one is
        meaningless. Raises ValueError for a decreasing time.
        """
        values = self._check_shape("values", values)
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
        signal = self._get_baseline(values) - values
        newtons: Array | None = None
        if self._model is None or not (self.has_force_steps or force is not None):
            pass
        elif force is None:  # inverse of the force law of the sensor model
            share = np.clip(signal / self._model["full_scale_counts"], 0.0, MAX_SCALE_SHARE)
            newtons = self._model["half_force_n"] * share / (1.0 - share)
        else:
            newtons = self._check_shape("force", force)
        base = signal if newtons is None else self._convert_force(newtons)
        # The mean age of the frames of the baseline is half their duration.
        age_s = 0.5 * step_s * len(self._before)
        frame = Frame(step_s, time_s - start_s + 0.5 * step_s, age_s, self._model)
        frame.separation = None if separation is None else self._check_shape("separation", separation)
        if newtons is None:
            frame.signal = signal
        else:
            frame.force = newtons
        for (step, parameters), state in zip(self._steps, self._state, strict=True):
            step(frame, parameters, state)
        return values, base, get_signal(frame)

    def _get_baseline(self, values: Array) -> Array:
        """Return the baseline, raw counts f64[n] (n taxels); at its first use it is determined and stored, see `reset`.

        values: raw counts of the present frame, which are the baseline if nothing else determines it.
        """
        if self._given_baseline is None:
            if self._model is not None:
                self._given_baseline = self._model["baseline_counts"]
            else:
                self._given_baseline = np.mean(self._before, axis=0) if self._before else values
        return np.asarray(self._given_baseline, float)

    def _convert_force(self, force: Array) -> Array:
        """Convert forces f64[..., n] (n taxels), newtons, into signals, counts, by the sensor model."""
        assert self._model is not None
        return np.asarray(self._model["full_scale_counts"] * force / (force + self._model["half_force_n"]))

    def _check_shape(self, name: str, values: npt.ArrayLike) -> Array:
        """Convert values to f64[n] (n taxels). Raises ValueError for another shape."""
        values = np.asarray(values, float)
        if values.shape != (self.n,):
            raise ValueError(f"{name}: expected {self.n} numbers, found an array of shape {values.shape}")
        return values

    def _finish(self, values: Array, change: Array) -> Array:
        """Return the raw counts f64[n] (n taxels) of a frame with noise, constant taxels and lost frames added.

        values: raw counts of the simulator. change: change of the signal by the other effects, counts. A board whose
        frame is lost keeps its previous counts; `valid` states which boards have a new frame.
        """
        result = values - change
        for deviation, member in zip(self.parameters["noise"], self.parameters["noise_groups"], strict=True):
            if any(deviation):
                result = result + np.array(deviation) * self._noise.normal(size=max(member) + 1)[np.array(member)]
        result = np.clip(np.rint(result), 0, LARGEST_COUNT)
        if len(self._stuck):
            baseline = np.broadcast_to(self._get_baseline(values), (self.n,))
            result[self._stuck] = np.rint(baseline[self._stuck])
        self.valid = self._loss.random(len(self.boards)) >= self._lost
        self._last_counts = np.where(self.valid[self._board], result, self._last_counts)
        return self._last_counts.copy()
