"""Likelihood of the number of missing frames of each board."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taxel.twin.null_model import count_alternatives
from taxel.twin.places import LEVELS, Places
from taxel.twin.reference import Reference
from taxel.twin.statistics import QUANTITIES
from taxel.types import FloatArray

_QUANTITY = next(quantity for quantity in QUANTITIES if quantity.name == "missing")
_AMPLITUDES = np.array(_QUANTITY.amplitudes)


@dataclass(eq=False)
class MissingFrames:
    """Usual share of missing frames of each of s boards, and its variability.

    share: f64[s], expected share. dispersion: f64[s], variance of the number of missing frames relative to a binomial
    distribution, at least 1, because frames are lost in bursts. Log likelihood ratios are divided by it; without a
    fault, the likelihood ratio then still has an expectation of at most 1, which the detector requires.
    """

    share: FloatArray
    dispersion: FloatArray
    places: Places

    @classmethod
    def learn(cls, reference: Reference) -> MissingFrames:
        """Learn share and dispersion from the contacts of a reference; half a missing frame is added (Jeffreys
        prior).
        """
        missing, expected = reference.missing.T
        share = (missing + 0.5) / (expected + 1.0)
        squares, number = np.zeros(len(share)), 0
        for _, step in reference.steps:
            usual = share * step.expected
            lost = step.expected - step.received
            squares += (lost - usual) ** 2 / np.maximum(usual * (1.0 - share), 0.5)
            number += 1
        return cls(share, np.maximum(squares / max(number, 1), 1.0), reference.places)

    def compute_log_ratios(self, missing: FloatArray, expected: FloatArray) -> FloatArray:
        """Compute the log likelihood ratio of a changed share for each place and alternative, f64[P, G].

        missing, expected: f64[s], numbers of missing and of expected frames of each board in a step. Only boards and
        the skin can change (0 at other places); the alternatives without a fixed amplitude are impossible (minus
        infinity).
        """
        usual = self.share[:, None]
        changed = np.minimum(usual + (1.0 - usual) * _AMPLITUDES, 1.0 - 1e-6)
        lost, arrived = missing[:, None], (expected - missing)[:, None]
        ratio = lost * np.log(changed / usual) + arrived * np.log((1.0 - changed) / (1.0 - usual))
        ratio /= self.dispersion[:, None]
        result = np.full((len(self.places), count_alternatives(_QUANTITY)), -np.inf)  # none without an amplitude
        result[:, : len(_AMPLITUDES)] = 0.0
        for number, place in enumerate(self.places.places):
            if place.level == "board":
                result[number, : len(_AMPLITUDES)] = ratio[self._find_board(number)]
            elif place.level == "skin":
                result[number, : len(_AMPLITUDES)] = ratio.sum(axis=0)
        return result

    def set_share(self, place: int, missing: FloatArray, expected: FloatArray) -> None:
        """Set the usual share of missing frames of the boards of a place to their share in one step.

        place: index in `Places`, of a board or of the whole skin. missing, expected: f64[s], numbers of missing and of
        expected frames of each board in the step.
        """
        level = LEVELS[int(self.places.level[place])]
        columns = np.arange(len(self.share)) if level == "skin" else np.array([self._find_board(place)])
        # Half a missing frame is added (Jeffreys prior), so that the share is never 0.
        self.share[columns] = (missing[columns] + 0.5) / (expected[columns] + 1.0)

    def _find_board(self, place: int) -> int:
        """Return the column of the board to which the first taxel of a place belongs."""
        taxel = int(self.places.members.indices[self.places.members.indptr[place]])
        return int(self.places.board[taxel])
