"""Worlds of three other kinds of sensor, with hidden causes: a resistive mat, a magnetic pad and a capacitive plate.

A world is a pair of datasets of version 2. The real one contains gains that vary between sessions and repeats, noise,
and at most one cause from `CAUSES`; the simulated one contains none of these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from taxel.blind.hidden import UNKNOWN
from taxel.recording.general.format import Contact, GeneralHeader, Properties, TaxelPlaces
from taxel.recording.general.writer import write_general
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

SENSORS: Final = ("resistive mat", "magnetic pad", "capacitive plate")

DURATIONS: Final = {Phase.BASELINE: 2.0, Phase.CLOSING: 1.0, Phase.HOLD: 1.5, Phase.RELEASE: 0.6, Phase.RECOVERY: 1.5}
"""Duration of each phase of a contact, seconds."""

SESSION_STD: Final = 0.04
REPEAT_STD: Final = 0.05
"""Relative standard deviations of the load: between sessions, independent for each taxel; between repeats, common to
all taxels."""

NOISE_SHARE: Final = 0.005
"""Standard deviation of the noise, relative to the full scale."""


@dataclass(frozen=True)
class SensorKind:
    """A kind of sensor with taxels on a rectangular grid.

    unit: unit of the values. full_scale: largest signal, in this unit. conditions: number of different contacts.
    raises: whether values increase on contact. modality: physical principle, as in the dataset. is_vector: whether a
    taxel has three components (shear x, shear y, normal). is_uniform: whether a contact loads all taxels equally.
    """

    name: str
    unit: str
    rows: int
    columns: int
    pitch_m: float
    full_scale: float
    rate_hz: float
    conditions: int
    raises: bool
    modality: str
    is_vector: bool = False
    is_uniform: bool = False

    @property
    def n(self) -> int:
        """Number of taxels."""
        return self.rows * self.columns

    @property
    def positions(self) -> FloatArray:
        """Centres of the taxels, f64[n, 3], metres."""
        x, y = np.meshgrid(np.arange(self.columns), np.arange(self.rows))
        return np.column_stack([self.pitch_m * x.ravel(), self.pitch_m * y.ravel(), np.zeros(self.n)])


KINDS: Final = {
    "resistive mat": SensorKind("resistive mat", "V", 12, 12, 8e-3, 3.3, 50.0, 14, raises=True, modality="resistive"),
    "magnetic pad": SensorKind(
        "magnetic pad", "uT", 4, 4, 4.7e-3, 800.0, 80.0, 14, raises=True, modality="magnetic", is_vector=True
    ),
    "capacitive plate": SensorKind(
        "capacitive plate", "pF", 10, 20, 5e-3, 4.0, 30.0, 8, raises=True, modality="capacitive", is_uniform=True
    ),
}

Change = Callable[[FloatArray, FloatArray, np.random.Generator], FloatArray]
"""Cause: function of the signal of one contact, f64[T, m] (T frames, m components of all taxels), the time since its
start, f64[T], and random numbers that returns the signal with the cause."""


@dataclass(frozen=True)
class ModalityWorld:
    """One world: a pair of datasets with at most one hidden cause.

    sensor: one of `SENSORS`. cause: name of the cause; "": none. strength: size of the cause relative to a typical
    case. sessions, repeats: numbers of sessions, and of repeats of each condition in a session, of the real dataset.
    conditions: approximate number of conditions; None: that of the sensor.
    """

    sensor: str
    cause: str
    strength: float
    seed: int
    sessions: int = 4
    repeats: int = 3
    conditions: int | None = None

    def make(self, real: Path, sim: Path) -> None:
        """Write the real dataset, with the cause, and the simulated dataset, without it.

        If `conditions` is set, every k-th load is used, with k such that about `conditions` loads remain. The second
        number of each random seed (5, 6, 7) makes the random numbers of the causes and of the two datasets independent.
        """
        kind, rng = KINDS[self.sensor], np.random.default_rng([self.seed, 5])
        loads = _sample_loads(kind, rng)[:: -(-kind.conditions // (self.conditions or kind.conditions))]
        change = _CHANGES[self.cause](kind, self.strength, rng)
        write_general(real, _make_header(kind, "real"), self._make_real(kind, loads, change))
        write_general(sim, _make_header(kind, "sim"), self._make_simulated(kind, loads))

    def _make_real(self, kind: SensorKind, loads: FloatArray, change: Change) -> Iterator[Contact]:
        """Yield the contacts of the real dataset, with variations between sessions and repeats and with the cause."""
        rng, number = np.random.default_rng([self.seed, 6]), 0
        for session in range(self.sessions):
            mounting = np.exp(rng.normal(0.0, SESSION_STD, loads.shape[1]))
            for condition, load in enumerate(loads):
                for repeat in range(self.repeats):
                    varied_load = load * mounting * np.exp(rng.normal(0.0, REPEAT_STD))
                    yield _make_contact(kind, (number, session, condition, repeat), varied_load, change, rng)
                    number += 1

    def _make_simulated(self, kind: SensorKind, loads: FloatArray) -> Iterator[Contact]:
        """Yield the contacts of the simulated dataset: two repeats of each condition, without variations and cause."""
        rng = np.random.default_rng([self.seed, 7])
        for condition, load in enumerate(loads):
            for repeat in range(2):
                yield _make_contact(kind, (2 * condition + repeat, 0, condition, repeat), load, _keep, rng)


def sample_modality_worlds(count: int, seed: int, sensor: str) -> list[ModalityWorld]:
    """Sample worlds of one sensor in random order.

    A fifth of them has no cause, an eighth a cause outside the catalogue, and all others one cause of the catalogue
    that the sensor can have. The strength is 0.7 to 2 times that of a typical case, uniform in the logarithm.
    """
    rng = np.random.default_rng([seed, count, SENSORS.index(sensor)])
    names = [name for name in _CHANGES if name and name != UNKNOWN and _is_possible(KINDS[sensor], name)]
    causes = [""] * round(0.2 * count) + [UNKNOWN] * round(0.125 * count)
    causes += [names[k % len(names)] for k in range(count - len(causes))]
    order = rng.permutation(count).tolist()
    return [
        ModalityWorld(sensor, causes[k], float(np.exp(rng.uniform(np.log(0.7), np.log(2.0)))), 1000 * seed + number)
        for number, k in enumerate(order)
    ]


def _is_possible(kind: SensorKind, cause: str) -> bool:
    """Whether a cause can change the signals of a sensor: contact propagation does not change a uniform load."""
    return cause != "contact_propagation" or not kind.is_uniform


def _make_header(kind: SensorKind, source: str) -> GeneralHeader:
    properties = Properties(kind.unit, None if kind.is_vector else "raises", kind.full_scale, None, kind.modality)
    places = TaxelPlaces(position=kind.positions)
    return GeneralHeader(source, kind.name, "synthetic sensor", properties, places)


def _sample_loads(kind: SensorKind, rng: np.random.Generator) -> FloatArray:
    """Sample the load of each condition, f64[C, m], relative to the full scale (C conditions, m components).

    A uniform load increases from condition to condition. Any other load is a Gaussian around a random place; on a
    sensor with vectors, the skin is also sheared away from this place and in a random direction.
    """
    if kind.is_uniform:
        return np.repeat(np.linspace(0.15, 0.9, kind.conditions)[:, None], kind.n, axis=1)
    place = kind.positions[:, :2] / kind.pitch_m
    loads = []
    for _ in range(kind.conditions):
        centre = rng.uniform([0.5, 0.5], [kind.columns - 1.5, kind.rows - 1.5])
        height, width = rng.uniform(0.3, 0.9), rng.uniform(0.8, 2.2)
        apart = place - centre
        normal = height * np.exp(-0.5 * (apart**2).sum(axis=1) / width**2)
        if not kind.is_vector:
            loads.append(normal)
            continue
        shear = -apart / width * normal[:, None] + rng.normal(0.0, 0.15, 2) * normal[:, None]
        loads.append(np.column_stack([shear, normal]).ravel())
    return np.array(loads)


def _make_contact(
    kind: SensorKind,
    labels: tuple[int, int, int, int],
    load: FloatArray,
    change: Change,
    rng: np.random.Generator,
) -> Contact:
    """Make one contact from its load, with the cause `change` and noise.

    labels: number, session, condition and repeat of the contact. load: f64[m], relative to the full scale.
    """
    number, session, condition, repeat = labels
    ends = np.cumsum(list(DURATIONS.values()))
    time = np.arange(0.0, ends[-1], 1.0 / kind.rate_hz)
    phase = np.searchsorted(ends, time, side="right").astype(np.uint8)
    start, closed, opens, released = ends[:4]
    # The load rises within the first 80 % of closing, and falls within the first 70 % of release.
    shape = np.clip((time - start) / (0.8 * (closed - start)), 0.0, 1.0)
    shape = shape * (1.0 - np.clip((time - opens) / (0.7 * (released - opens)), 0.0, 1.0))
    signal = kind.full_scale * np.tanh(shape[:, None] * load)
    signal = change(signal, time, rng) + rng.normal(0.0, NOISE_SHARE * kind.full_scale, signal.shape)
    rest = np.linspace(0.2, 0.4, signal.shape[1]) * kind.full_scale
    values = rest + signal if kind.raises else rest - signal
    if kind.is_vector:
        values = values.reshape(len(time), kind.n, 3)
    return Contact(
        id=f"{number:04d}",
        session=session,
        time=100.0 * number + time,
        values=values,
        object=kind.name,
        approach=f"place_{condition:02d}",
        iteration=repeat,
        phase=phase,
    )


# Each function _make_... below returns the change that one cause applies to the signal of every contact of a world, for
# a kind of sensor and a strength; rng samples the parameters that are the same for all contacts.


def _keep(signal: FloatArray, time: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the signal unchanged: no cause."""
    return signal


def _make_none(kind: SensorKind, strength: float, rng: np.random.Generator) -> Change:
    return _keep


def _make_gain(kind: SensorKind, strength: float, rng: np.random.Generator) -> Change:
    """Make a gain mismatch: every taxel has a random gain, 0.75 to 1.25 at strength 1."""
    gains = 1.0 + 0.25 * strength * rng.uniform(-1.0, 1.0, kind.n)
    component_gains = np.repeat(gains, 3) if kind.is_vector else gains
    return lambda signal, time, _: signal * component_gains


def _make_curve(kind: SensorKind, strength: float, rng: np.random.Generator) -> Change:
    """Make a nonlinearity: a smaller sensitivity to small loads."""
    share, scale = 0.45 * min(strength, 1.8), kind.full_scale

    def bend(signal: FloatArray, time: FloatArray, _: np.random.Generator) -> FloatArray:
        """Reduce the signal by `share` near 0 and not at full scale."""
        relative = np.clip(np.abs(signal) / scale, 0.0, 1.0)
        return np.asarray(np.sign(signal) * scale * relative * (1.0 - share * (1.0 - relative)))

    return bend


def _make_limit(kind: SensorKind, strength: float, rng: np.random.Generator) -> Change:
    """Make a saturation: soft (hyperbolic tangent) below strength 1, hard (clipped) from strength 1."""
    limit = kind.full_scale * (0.55 - 0.15 * strength)
    return lambda signal, time, _: limit * np.tanh(signal / limit) if strength < 1.0 else np.clip(signal, -limit, limit)


def _make_lag(kind: SensorKind, strength: float, rng: np.random.Generator) -> Change:
    """Make a hysteresis: a share of the signal follows with a random time constant (creep)."""
    share, constant = 0.3 * strength, rng.uniform(0.4, 1.2)

    def creep(signal: FloatArray, time: FloatArray, _: np.random.Generator) -> FloatArray:
        """Replace `share` of the signal f64[T, m] by its first-order lag with the time constant `constant` (s)."""
        step = time[1] - time[0]
        late, result = np.zeros(signal.shape[1]), np.empty_like(signal)
        for k, now in enumerate(signal):
            late = late + step / constant * (now - late)
            result[k] = (1.0 - share) * now + share * late
        return result

    return creep


def _make_drift(kind: SensorKind, strength: float, rng: np.random.Generator) -> Change:
    """Make a drift after the baseline phase, linear in time, with a slightly different slope in each contact."""
    slope = kind.full_scale * 0.02 * strength * rng.choice([-1.0, 1.0])
    baseline_s = 2.0
    return lambda signal, time, contact_rng: (
        signal + slope * contact_rng.normal(1.0, 0.3) * np.maximum(time - baseline_s, 0.0)[:, None]
    )


def _make_noise(kind: SensorKind, strength: float, rng: np.random.Generator) -> Change:
    """Make additional white noise with a Laplace distribution."""
    scale = kind.full_scale * 0.05 * strength
    return lambda signal, time, contact_rng: signal + scale * contact_rng.laplace(0.0, 0.7, signal.shape)


def _make_dead(kind: SensorKind, strength: float, rng: np.random.Generator) -> Change:
    """Make a dropout: random taxels have no signal; at strength 1, one more than 6 % of the taxels."""
    width = max(1, round(0.06 * strength * kind.n))
    dead = rng.permutation(kind.n)[: width + 1]
    dead_components = (dead[:, None] * 3 + np.arange(3)).ravel() if kind.is_vector else dead

    def silence(signal: FloatArray, time: FloatArray, _: np.random.Generator) -> FloatArray:
        """Set the signals of the dead taxels to 0."""
        result = signal.copy()
        result[:, dead_components] = 0.0
        return result

    return silence


def _make_delay(kind: SensorKind, strength: float, rng: np.random.Generator) -> Change:
    """Make a latency: all signals are late by a whole number of frames."""
    frames = max(2, round(0.15 * strength * kind.rate_hz))
    return lambda signal, time, _: np.concatenate([np.repeat(signal[:1], frames, axis=0), signal[:-frames]])


def _make_spread(kind: SensorKind, strength: float, rng: np.random.Generator) -> Change:
    """Make a contact propagation: each taxel passes a share of its signal to the eight taxels around it."""
    share = min(0.35 * strength, 0.7)
    apart = np.abs(kind.positions[:, None] - kind.positions).max(axis=2) / kind.pitch_m
    near = ((apart > 0.5) & (apart < 1.5)).astype(np.float64)
    mix = (1.0 - share) * np.eye(kind.n) + share * near / near.sum(axis=1, keepdims=True)
    if kind.is_vector:
        mix = np.kron(mix, np.eye(3))
    return lambda signal, time, _: signal @ mix


def _make_unknown(kind: SensorKind, strength: float, rng: np.random.Generator) -> Change:
    """Make a cause outside the catalogue: a dead zone, a subtracted mean signal, or a gain that oscillates with time.

    The mean signal is not subtracted from a sensor with uniform loads, whose signals it would almost remove.
    """
    dead_zone, mean_removed, oscillation = range(3)
    choices = [dead_zone, oscillation] if kind.is_uniform else [dead_zone, mean_removed, oscillation]
    choice, scale = int(rng.choice(choices)), kind.full_scale

    def change(signal: FloatArray, time: FloatArray, _: np.random.Generator) -> FloatArray:
        """Apply the chosen cause outside the catalogue to a signal f64[T, m]. time: f64[T], seconds."""
        if choice == dead_zone:
            return np.asarray(np.sign(signal) * np.maximum(np.abs(signal) - 0.12 * strength * scale, 0.0))
        if choice == mean_removed:
            return np.asarray(signal - 0.6 * min(strength, 1.5) * signal.mean(axis=1, keepdims=True))
        return np.asarray(signal * (1.0 + 0.35 * strength * np.sin(5.0 * time))[:, None])

    return change


_CHANGES: Final = {
    "": _make_none,
    "gain_mismatch": _make_gain,
    "nonlinearity": _make_curve,
    "saturation": _make_limit,
    "hysteresis": _make_lag,
    "baseline_drift": _make_drift,
    "noise": _make_noise,
    "dropout": _make_dead,
    "latency": _make_delay,
    "contact_propagation": _make_spread,
    UNKNOWN: _make_unknown,
}
