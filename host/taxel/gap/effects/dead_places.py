"""Where taxels that do not answer lie: on lines, and in patches."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from taxel.gap.features.features import SessionMeans, known_mean
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

LOADED_COUNTS: Final = 120.0
"""A taxel that is never expected to drop by more may be dead without anybody knowing."""

SURE: Final = 0.5
"""Share of the expected drop below which one that does not answer stays with three standard errors, and above which
one answers."""

ELSEWHERE: Final = 0.3
"""Share of a line's expected drops, squared, by which another line may miss them and still be taken for it."""

NOTHING: Final = 0.05
"""Share of the expected drop below which a line or taxel shows nothing at all."""

BESIDE: Final = 0.7
"""Share of what its board usually shows of an expected drop, that a taxel must show to be at its place."""

PATCH: Final = 3
"""Dead taxels that hang together, and taxels beside them that answer, from which on that is seen at a glance."""


def patches(
    state: State, answer: FloatArray, mute: NDArray[np.bool_], expected: FloatArray
) -> tuple[NDArray[np.bool_], bool]:
    """Which of the mute taxels, bool[n], are dead: those that hang together with one of which much is expected. But
    where all of that is one press, and a neighbour answers faintly, the object may as well be elsewhere. And whether
    some show nothing at all, and all beside them what they should.

    answer: f64[n], NaN where nothing is expected. expected: largest drops, f64[C, n].
    """
    sensor, own = state.pair.groups.sensor, np.flatnonzero(mute)
    beside = _beside(state, own)
    usual = np.array([_usual(answer[sensor == board]) for board in range(int(sensor.max()) + 1)])
    others = beside & ~mute
    fades = np.asarray((others & (answer < BESIDE * usual[sensor])).any(axis=1))
    full = np.asarray((others & (answer >= BESIDE * usual[sensor])).sum(axis=1))
    contacts = (expected[:, own] > LOADED_COUNTS).sum(axis=0)
    result, evident = np.zeros(len(answer), bool), False
    count, group = connected_components(beside[:, own], directed=False)
    for number in range(count):
        one = group == number
        most, rim = contacts[one].max(), fades[one].any()
        result[own[one]] = most > 0 and (most > 1 or not rim)
        nothing = (np.abs(answer[own[one]]) < NOTHING).sum() >= PATCH and full[one].sum() >= PATCH
        evident |= bool(most > 0 and not rim and nothing)
    return result, evident


def lines_of(state: State, dead: NDArray[np.bool_], known: NDArray[np.bool_]) -> list[tuple[int, str, int]]:
    """Lines of which every taxel that can be judged is dead, and there are two at least; and which are no part of a
    patch of dead taxels.
    """
    found: list[tuple[int, str, int]] = []
    sensor = state.pair.groups.sensor
    for axis, number in (("tx", state.pair.taxels.tx), ("rx", state.pair.taxels.rx)):
        for board in range(int(sensor.max()) + 1):
            for index in np.unique(number[sensor == board]).tolist():
                own = (sensor == board) & (number == index) & known
                whole = (sensor == board) & known
                if own.sum() >= 2 and dead[own].all() and not dead[whole].all():
                    found.append((board, axis, index))
    while True:
        whole = np.zeros(len(dead), bool)
        for line in found:
            whole |= on_line(state, line)
        lines = [line for line in found if not _is_of_patch(state, dead & known, line, whole)]
        if len(lines) == len(found):
            return found
        found = lines


def _is_of_patch(state: State, dead: NDArray[np.bool_], line: tuple[int, str, int], lines: NDArray[np.bool_]) -> bool:
    """Whether half as many dead taxels stand beside a line as it has itself. dead: bool[n]; lines: those on a line."""
    own = dead & on_line(state, line)
    stray = np.flatnonzero(dead & ~lines)
    return bool(2 * _beside(state, stray)[:, own].any(axis=1).sum() >= own.sum())


def _beside(state: State, own: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether taxels lie one line from each of some, bool[len(own), n]."""
    place = np.column_stack([state.pair.groups.sensor, state.pair.taxels.tx, state.pair.taxels.rx]).astype(np.intp)
    steps = np.abs(place[own, None] - place)
    return np.asarray((steps[:, :, 0] == 0) & (steps[:, :, 1:].sum(axis=2) == 1))


def is_evident(state: State, answer: FloatArray, line: tuple[int, str, int]) -> bool:
    """Whether a line shows nothing at all between lines that answer. answer: f64[n], NaN where nothing is expected.

    An object that is elsewhere leaves whole lines untouched too, but not between two that it touches, nor beside one
    that it touches as it should.
    """
    board, axis, index = line
    usual = _usual(answer[state.pair.groups.sensor == board])

    def shown(number: int) -> FloatArray:
        own = answer[on_line(state, (board, axis, number))]
        return own[np.isfinite(own)]

    beside = [shares for shares in (shown(index - 1), shown(index + 1)) if len(shares)]
    answers = len(beside) > 0 and all((shares > SURE).any() for shares in beside)
    if len(beside) == 1:
        answers = answers and bool((beside[0] > BESIDE * usual).all())
    return bool(answers and (np.abs(shown(index)) < NOTHING).all())


def _usual(answer: FloatArray) -> float:
    """What the taxels of a board that answer usually show."""
    answers = answer[answer > SURE]
    return float(np.median(answers)) if len(answers) else 1.0


def touched_lines(state: State, taxels: NDArray[np.bool_]) -> list[tuple[int, str, int]]:
    """Lines with one of some taxels, bool[n], at least."""
    sensor, own = state.pair.groups.sensor, np.flatnonzero(taxels)
    axes = (("tx", state.pair.taxels.tx), ("rx", state.pair.taxels.rx))
    return sorted({(int(sensor[one]), axis, int(number[one])) for axis, number in axes for one in own})


def answers_elsewhere(
    state: State, real: SessionMeans, features: FloatArray, line: tuple[int, str, int], mute: NDArray[np.bool_]
) -> bool:
    """Whether another line of the board shows what was expected here: then it is not dead, but somewhere else. mute:
    bool[n]; what does not answer on the other line tells nothing of that.
    """
    board, axis, index = line
    bins, taxels = state.layout.bins, state.pair.taxels
    along, across = (taxels.tx, taxels.rx) if axis == "tx" else (taxels.rx, taxels.tx)
    seen = np.nan_to_num(known_mean(real.value, 1)[:, :bins])
    own = np.flatnonzero(on_line(state, line))
    for other in np.unique(along[state.pair.groups.sensor == board]).tolist():
        theirs = np.flatnonzero(on_line(state, (board, axis, other)) & ~mute)
        _, here, there = np.intersect1d(across[own], across[theirs], return_indices=True)
        if other == index or len(here) < 2:
            continue
        wanted, found = features[:, :bins, own[here]], seen[:, :, theirs[there]]
        meant = features[:, :bins, theirs[there]]
        apart, usual = float(np.sum((found - wanted) ** 2)), float(np.sum((found - meant) ** 2))
        if apart < ELSEWHERE * min(float(np.sum(wanted**2)), usual):
            return True
    return False


def on_line(state: State, line: tuple[int, str, int]) -> NDArray[np.bool_]:
    """Its taxels, bool[n]."""
    board, axis, index = line
    number = state.pair.taxels.tx if axis == "tx" else state.pair.taxels.rx
    return np.asarray((state.pair.groups.sensor == board) & (number == index))
