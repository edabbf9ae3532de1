"""Gains and stiffnesses that parts do not have: of taxels on one board alone or in patches; of boards all alike, or
beyond any part. And crosstalk that electrodes do not make.

Etched electrodes and moulded pillars scatter from taxel to taxel, on every board, each by itself. A model with a value
for each taxel or board also takes on what somebody else did to the amplitude: a drop of water, a bit that sticks, a
force that is lost. What such a model was fitted to shows in the pattern of its values.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.chain import FittedEffect
from taxel.gap.chances import fisher_tail, student_tail
from taxel.gap.effects.effect import BOARD, TAXEL
from taxel.gap.effects.electrode_crosstalk import ElectrodeCrosstalk
from taxel.gap.effects.gain_mismatch import GainMismatch
from taxel.gap.effects.stiffness import Stiffness
from taxel.gap.judge import Judge
from taxel.gap.told import amplitude_information
from taxel.types import FloatArray

LEVEL: Final = 0.01
"""Of a pattern being chance."""

ALONE: Final = 3.0
"""Standard deviation of one board's values over the others', from which on it stands alone."""

PATCHY: Final = 0.25
"""Correlation of neighbouring taxels (Moran 1950), from which on values come in patches."""

NEIGHBOUR: Final = 1.2
"""Pitches between neighbours."""

COMMON: Final = 0.05
"""Least mean log of a value that all boards share. Boards that are made one by one lie on both sides of what they
should be: that their mean differs from that, by a t test, is odd."""

TELLING: Final = 0.1
"""Standard error of a board's log value, above which these presses do not tell it."""

FREE: Final = 0.35
"""Scatter of parts that nobody has told anything of."""

LEAST_TAXELS: Final = 8
"""Of a board, for its values to be looked at."""

SHUFFLES: Final = 499

BESIDE: Final = 0.67
"""Greatest difference of what goes to the lines beside along one axis and the other, over their mean, at which nothing
tells that lines have to do with it: a factor of two, since pitches differ.
"""

ALONG: Final = 0.2
"""And greatest share of it that goes along the lines themselves: a trace disturbs the next one over its whole length.
"""


def odd_pattern(judge: Judge, link: FittedEffect) -> str | None:
    """What is odd about a link's values, as words after its name; None: they are as parts' are, or nobody knows."""
    if _goes_round(link):
        return "acts on the neighbours in all directions instead of along the lines, like pressure in a cover"
    if link.effect.name not in (GainMismatch.name, Stiffness.name):
        return None
    (parameter, *_) = link.effect.parameters()
    values, middle = link.values[0], parameter.middle
    logs = values - middle if parameter.neutral == 0 else np.log(values / middle)
    if link.effect.scope == BOARD:
        return _pattern_of_boards(judge, logs, np.isclose(values[:, None], (parameter.low, parameter.high)).any(axis=1))
    return _pattern_of_taxels(judge, logs, min(parameter.prior, FREE)) if link.effect.scope == TAXEL else None


def _goes_round(link: FittedEffect) -> bool:
    """Whether what is called crosstalk goes to the next taxels alone, along TX about as far as along RX: electrodes of
    two layers do not do that, and what spreads in the cover does.
    """
    if link.effect.name != ElectrodeCrosstalk.name or link.effect.variant != "network":
        return False
    size = np.abs(link.values[:4]).max(axis=1)
    tx, rx = link.values[2:4, np.abs(link.values[2:4]).sum(axis=0).argmax()]
    middle = 0.5 * (tx + rx)
    return bool(middle > 0.0 and abs(tx - rx) < BESIDE * middle and size[:2].max() < ALONG * size[2:].max())


def _pattern_of_boards(judge: Judge, logs: FloatArray, at_limit: NDArray[np.bool_]) -> str | None:
    information = amplitude_information(judge).sum(axis=0)
    told = np.bincount(judge.state.pair.groups.sensor, information, len(logs)) * TELLING**2 > 1.0
    if (at_limit & told).any():
        return "is at the limit of its plausible range"
    if told.sum() >= 3 and abs(logs[told].mean()) > COMMON and _mean_is_sure(logs[told]):
        return "has nearly the same value on every board, unlike manufacturing tolerances"
    return None


def _mean_is_sure(values: FloatArray) -> bool:
    """Whether their mean is not 0 (two-sided t test)."""
    error = float(values.std(ddof=1)) / np.sqrt(len(values))
    return error == 0.0 or 2.0 * student_tail(abs(float(values.mean())) / error, len(values) - 1) < LEVEL


def _pattern_of_taxels(judge: Judge, logs: FloatArray, prior: float) -> str | None:
    known = amplitude_information(judge).sum(axis=0) * prior**2 > 1.0
    boards = [one.taxels[known[one.taxels]] for one in judge.state.pair.boards]
    boards = [own for own in boards if len(own) >= LEAST_TAXELS]
    if len(boards) >= 3 and _stands_alone([float(np.var(logs[own], ddof=1)) for own in boards], [*map(len, boards)]):
        return "varies on a single board only, unlike manufacturing tolerances"
    return "varies in patches, unlike manufacturing tolerances" if _is_patchy(judge, logs, known) else None


def _stands_alone(variances: list[float], counts: list[int]) -> bool:
    """Whether the board that scatters most does so far more than all others (F test, corrected for the choice)."""
    most = int(np.argmax(variances))
    freedom = np.array(counts) - 1.0
    others = np.arange(len(counts)) != most
    pooled = float(np.average(np.array(variances)[others], weights=freedom[others]))
    ratio = variances[most] / max(pooled, 1e-12)
    chance = fisher_tail(ratio, freedom[most], freedom[others].sum()) * len(counts)
    return ratio > ALONE**2 and chance < LEVEL


def _is_patchy(judge: Judge, logs: FloatArray, known: NDArray[np.bool_]) -> bool:
    """Whether neighbours of a board are alike, beyond what an exchange of its taxels gives."""
    pairs, groups = [], []
    centred = np.zeros_like(logs)
    for one in judge.state.pair.boards:
        own = np.flatnonzero(known[one.taxels])
        if len(own) < LEAST_TAXELS:
            continue
        taxels = one.taxels[own]
        first, second = np.nonzero(np.triu(one.apart_m[np.ix_(own, own)] < NEIGHBOUR * one.pitch_m, 1))
        pairs.append(np.stack([taxels[first], taxels[second]]))
        groups.append(taxels)
        centred[taxels] = logs[taxels] - logs[taxels].mean()
    if not pairs or not any(one.size for one in pairs):
        return False
    first, second = np.concatenate(pairs, axis=1)
    everyone = np.concatenate(groups)

    def alike(values: FloatArray) -> float:
        return float((values[first] * values[second]).mean() / max((values[everyone] ** 2).mean(), 1e-12))

    found, rng = alike(centred), np.random.default_rng(0)
    if found < PATCHY:
        return False
    mixed, as_much = centred.copy(), 1
    for _ in range(SHUFFLES):
        for taxels in groups:
            mixed[taxels] = centred[rng.permutation(taxels)]
        as_much += alike(mixed) >= found
    return as_much / (SHUFFLES + 1) < LEVEL
