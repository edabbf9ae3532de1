"""Which taxels, lines and boards answer to nothing."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.effects.dropout import Dropped, Short, crossings
from taxel.gap.features import COUNTS_MISSING, SessionMeans, known_mean
from taxel.gap.state import State

Array = NDArray[np.float64]

LOADED_COUNTS: Final = 120.0
"""A taxel that is never expected to drop by more may be dead without anybody knowing."""

DEAD: Final = 0.2
"""Share of the expected drop below which a taxel does not answer."""

SURE: Final = 0.5
"""And below which it stays with three standard errors."""

MISSING: Final = 0.02
"""Share of missing frames beyond the simulator's that is no accident."""

ALIKE: Final = 0.03
"""Share of the expected squared difference of two lines below which they show the same."""

HALF: Final = 0.35
"""Two lines in one show half of the sum of what they should; lines that are alike and show less have another cause."""

GAINS: Final = tuple(np.geomspace(0.5, 3.0, 8).tolist())
"""Sensitivities relative to the expected one that lines whose counts end may have."""

ELSEWHERE: Final = 0.3
"""Share of a line's expected drops, squared, by which another line may miss them and still be taken for it."""

NOTHING: Final = 0.05
"""Share of the expected drop below which a line shows nothing at all."""

ONE_SESSION: Final = 0.1
"""Standard error of the share of its expected drop that a taxel shows, where one session tells it."""

SURELY: Final = 3.0
"""Standard errors."""

STUCK: Final = 0.1
"""Noise below this share of the board's usual noise: the taxel does not even read noise."""


def find_dropped(state: State, real: SessionMeans, features: Array, part: NDArray[np.bool_] | None = None) -> Dropped:
    """Look at some taxels of some cells, bool[C, n]; None: at all. features: f64[C, F, n], what is expected."""
    n, sensor = state.pair.n, state.pair.groups.sensor
    if part is not None:
        real = real.where(part)
        features = np.where(part[:, None], features, 0.0)
    answer, dead, loaded = _answers(state, real, features)
    noise = known_mean(real.value[:, :, state.layout.noise].reshape(-1, n), 0)
    usual = _median_of_board(noise, sensor)
    stuck = np.nan_to_num(noise, nan=np.inf) < STUCK * usual
    missing = np.zeros(int(sensor.max()) + 1)
    gone = np.nan_to_num(known_mean(real.value[:, :, state.layout.missing].reshape(-1, n), 0)) / COUNTS_MISSING
    simulated = features[:, state.layout.missing].mean(axis=0) / COUNTS_MISSING
    for board in range(len(missing)):
        extra = float(np.mean((gone - simulated)[sensor == board]))
        missing[board] = extra if extra > MISSING else 0.0
    dead = (dead | stuck) & (missing[sensor] < 0.9)
    for line in _touched_lines(state, dead & ~stuck):
        if _answers_elsewhere(state, real, features, line):
            dead &= ~_on_line(state, line) | stuck
    lines = _lines(state, dead, loaded | stuck)
    on_line = np.zeros(n, bool)
    for line in lines:
        on_line |= _on_line(state, line)
    shorts = _shorts(state, real, features)
    evident = any(_is_evident(state, np.where(loaded, answer, np.nan), line) for line in lines)
    evident = evident or any(short.pairs > 1 for short in shorts)
    return Dropped(dead & ~on_line, tuple(lines), missing, dead | on_line, stuck, shorts, evident)


def _median_of_board(noise: Array, sensor: NDArray[np.intp]) -> Array:
    """Of each taxel's board, f64[n]; NaN where nothing is known."""
    result = np.full(len(noise), np.nan)
    for board in np.unique(sensor):
        known = noise[(sensor == board) & np.isfinite(noise)]
        if len(known):
            result[sensor == board] = np.median(known)
    return result


def _answers(state: State, real: SessionMeans, features: Array) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """The share of its expected drop that each taxel shows, f64[n]; those that do not answer, and those that were
    expected to: bool[n] each.
    """
    expected = features[:, : state.layout.bins]
    weight = state.layout.weight[: state.layout.bins, None]
    seen = np.nan_to_num(real.value[:, :, : state.layout.bins])
    known = np.isfinite(real.value[:, :, : state.layout.bins])
    power = np.einsum("csfn,cfn->sn", known * weight, expected**2)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.einsum("csfn,cfn->sn", weight * seen, expected) / power
    loaded = expected.max(axis=(0, 1)) > LOADED_COUNTS
    count = np.isfinite(ratio).sum(axis=0)
    mean = known_mean(ratio, 0)
    squares = np.where(np.isfinite(ratio), (ratio - mean) ** 2, 0.0).sum(axis=0)
    error = np.where(count > 1, np.sqrt(squares / np.maximum(count * (count - 1), 1)), ONE_SESSION)
    return mean, loaded & (mean < DEAD) & (np.nan_to_num(mean + SURELY * error, nan=np.inf) < SURE), loaded


def _lines(state: State, dead: NDArray[np.bool_], known: NDArray[np.bool_]) -> list[tuple[int, str, int]]:
    """Lines of which every taxel that can be judged is dead, and there are two at least."""
    found: list[tuple[int, str, int]] = []
    sensor = state.pair.groups.sensor
    for axis, number in (("tx", state.pair.taxels.tx), ("rx", state.pair.taxels.rx)):
        for board in range(int(sensor.max()) + 1):
            for index in np.unique(number[sensor == board]).tolist():
                own = (sensor == board) & (number == index) & known
                whole = (sensor == board) & known
                if own.sum() >= 2 and dead[own].all() and not dead[whole].all():
                    found.append((board, axis, index))
    return found


def _is_evident(state: State, answer: Array, line: tuple[int, str, int]) -> bool:
    """Whether a line shows nothing at all between lines that answer. answer: f64[n], NaN where nothing is expected.

    An object that is elsewhere leaves whole lines untouched too, but not between two that it touches.
    """
    board, axis, index = line

    def shown(number: int) -> Array:
        own = answer[_on_line(state, (board, axis, number))]
        return own[np.isfinite(own)]

    beside = [shares for shares in (shown(index - 1), shown(index + 1)) if len(shares)]
    answers = len(beside) > 0 and all((shares > SURE).any() for shares in beside)
    return bool(answers and (np.abs(shown(index)) < NOTHING).all())


def _touched_lines(state: State, taxels: NDArray[np.bool_]) -> list[tuple[int, str, int]]:
    """Lines with one of some taxels, bool[n], at least."""
    sensor, own = state.pair.groups.sensor, np.flatnonzero(taxels)
    axes = (("tx", state.pair.taxels.tx), ("rx", state.pair.taxels.rx))
    return sorted({(int(sensor[one]), axis, int(number[one])) for axis, number in axes for one in own})


def _on_line(state: State, line: tuple[int, str, int]) -> NDArray[np.bool_]:
    """Its taxels, bool[n]."""
    board, axis, index = line
    number = state.pair.taxels.tx if axis == "tx" else state.pair.taxels.rx
    return np.asarray((state.pair.groups.sensor == board) & (number == index))


def _answers_elsewhere(state: State, real: SessionMeans, features: Array, line: tuple[int, str, int]) -> bool:
    """Whether another line of the board shows what was expected here: then it is not dead, but somewhere else."""
    board, axis, index = line
    bins, taxels = state.layout.bins, state.pair.taxels
    along, across = (taxels.tx, taxels.rx) if axis == "tx" else (taxels.rx, taxels.tx)
    seen = np.nan_to_num(known_mean(real.value, 1)[:, :bins])
    own = np.flatnonzero(_on_line(state, line))
    for other in np.unique(along[state.pair.groups.sensor == board]).tolist():
        theirs = np.flatnonzero(_on_line(state, (board, axis, other)))
        _, here, there = np.intersect1d(across[own], across[theirs], return_indices=True)
        if other == index or len(here) < 2:
            continue
        wanted, found = features[:, :bins, own[here]], seen[:, :, theirs[there]]
        meant = features[:, :bins, theirs[there]]
        apart, usual = float(np.sum((found - wanted) ** 2)), float(np.sum((found - meant) ** 2))
        if apart < ELSEWHERE * min(float(np.sum(wanted**2)), usual):
            return True
    return False


def _only_ends(
    seen: Array,
    expected: Array,
    weight: Array,
    lines: tuple[NDArray[np.intp], NDArray[np.intp]],
    share: float,
    end: float,
) -> bool:
    """Whether two lines are alike since counts end at `end`, whatever presses: that tells what they show better than a
    share of their sum does. seen, expected: f64[C, bins, n]. lines: their taxels, i64[k] each.
    """
    shown = np.stack([seen[:, :, own] for own in lines])
    meant = np.stack([expected[:, :, own] for own in lines])
    short = float(np.sum(weight * (shown - share * meant.sum(axis=0)) ** 2))
    return any(float(np.sum(weight * (shown - np.minimum(gain * meant, end)) ** 2)) < short for gain in GAINS)


def _shorts(state: State, real: SessionMeans, features: Array) -> tuple[Short, ...]:
    """Neighbouring lines whose crossings all show the same where they should differ."""
    bins = state.layout.bins
    expected = features[:, :bins]
    seen = np.nan_to_num(known_mean(real.value, 1)[:, :bins])
    weight = state.layout.weight[:bins, None]
    found = []
    sensor = state.pair.taxels.sensor
    for axis, number in (("tx", state.pair.taxels.tx), ("rx", state.pair.taxels.rx)):
        for address in state.pair.sensors.address.tolist():
            for index in np.unique(number[sensor == address])[:-1].tolist():
                first, second = crossings(state.pair, address, axis, index)
                if len(first) < 2:
                    continue
                apart, together = (
                    expected[:, :, first] - expected[:, :, second],
                    expected[:, :, first] + expected[:, :, second],
                )
                pairs = int((np.abs(apart).max(axis=(0, 1)) > LOADED_COUNTS).sum())
                if not pairs:
                    continue
                differs = float(np.sum(weight * (seen[:, :, first] - seen[:, :, second]) ** 2))
                if differs > ALIKE * float(np.sum(weight * apart**2)):
                    continue
                total = seen[:, :, first] + seen[:, :, second]
                share = 0.5 * float(np.sum(weight * total * together) / np.sum(weight * together**2))
                end = float(seen[:, :, sensor == address].max())
                if share > HALF and not _only_ends(seen, expected, weight, (first, second), share, end):
                    found.append(Short(address, axis, index, share, pairs))
    return tuple(found)
