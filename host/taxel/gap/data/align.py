"""How the frames of two recordings fell: a common shift of all boards, within a frame, is no gap."""

from __future__ import annotations

import numpy as np

from taxel.gap.effects.effect import HAND
from taxel.gap.effects.latency import Latency
from taxel.gap.features.chances import compute_student_survival
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.fit import fit, started
from taxel.gap.fitting.judge import Judge
from taxel.types import FloatArray

SURE = 0.05
"""P-value from which on a shift that helps is chance."""

FRAMES = 1.5
"""Frame periods by which the first frames of a phase can lie apart in two recordings, at most."""


def common_shift(judge: Judge) -> float:
    """Seconds by which the hand is later: the median of the boards' delays, so that one late board does not move it.
    0 where that does not surely help.
    """
    state = judge.state
    fitted = fit(judge.problem(), CompositeModel((started(state, Latency()),)), iterations=6).composite.links[0]
    boards = state.touched_boards
    if not len(boards):
        return 0.0
    most = FRAMES * state.pair.frame_s
    shift = float(np.clip(np.median(fitted.values[0, boards]), -most, most))
    return shift if _is_better(judge, state.shifted(shift).mean, state.mean) else 0.0


def _is_better(judge: Judge, features: FloatArray, than: FloatArray) -> bool:
    """Whether features f64[C, F, n] agree better with the sessions than others, by a t test over the sessions."""
    sessions = range(judge.sessions.value.shape[1])
    before, after = (
        np.array([judge.sessions.square(session, one, judge.weight) for session in sessions])
        for one in (than, features)
    )
    gain = before - after
    if gain.mean() <= 0.0 or len(gain) < 3:
        return bool(gain.mean() > 0.0)
    error = float(gain.std(ddof=1) / np.sqrt(len(gain)))
    return error == 0.0 or compute_student_survival(float(gain.mean()) / error, len(gain) - 1) < SURE


class CommonShift(Latency):
    """All boards are `seconds` later: beside the delays of single boards, it has a name of its own."""

    name = "common_shift"

    def __init__(self) -> None:
        super().__init__(HAND)


def shift_beside(judge: Judge, composite: CompositeModel, fixed: tuple[str, ...]) -> tuple[float, CompositeModel]:
    """By how much a hand whose effects are known is later still, and the chain fitted to that. Both are fitted at once:
    an effect with a memory took what was the shift's for its own. chain: fitted. fixed: of its effects those that keep
    their values.
    """
    link = started(judge.state, CommonShift())
    fitted = judge.in_sample(composite.with_link(link), fixed)
    more = next(float(one.values[0, 0]) for one in fitted.composite.links if one.effect.name == link.effect.name)
    most = FRAMES * judge.state.pair.frame_s
    shift = float(np.clip(judge.state.shift_s + more, -most, most)) - judge.state.shift_s
    if not _is_better(judge, fitted.features, composite.features(judge.state)):
        return 0.0, composite
    return shift, fitted.composite.without(link.effect.name)
