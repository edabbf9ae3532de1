"""Expected signals of the current session: the reference, corrected by the contacts of the session so far.

All contacts of a session deviate from the reference by a common amount.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from taxel.twin.schedule import Condition
from taxel.types import BoolArray, FloatArray

RELEARNED: float = 100.0
"""Prior variance of a changed taxel's new expected signal, relative to the variance between contacts. With 100, the
prior is almost uniform and the first contacts after the change determine the new expectation."""


@dataclass(eq=False)
class LiveSession:
    """Expected signals of a session, updated with every contact (normal model with known variance ratio).

    ratio: f64[BINS, n], variance between sessions relative to the variance between the contacts of a session. The error
    of a condition's mean in the reference, which all contacts of the session share, adds a relative variance of 1 / R
    for R repeats. Without this term, the error of the mean would be detected as a change.
    """

    ratio: FloatArray
    _sums: dict[Condition, tuple[FloatArray, FloatArray]] = field(default_factory=dict)

    @classmethod
    def start(cls, session_ratio: FloatArray, n: int) -> LiveSession:
        """Start a session of n taxels. session_ratio: f64[BINS], variance ratio of the reference."""
        return cls(np.repeat(session_ratio[:, None], n, axis=1))

    def predict(self, condition: Condition, mean: FloatArray, repeats: float) -> tuple[FloatArray, FloatArray]:
        """Return the expected signals of the next contact, f64[BINS, n], counts, and their relative variance f64[BINS,
        n].

        The relative variance is the variance of the next contact about the expectation, divided by the variance between
        contacts. mean: f64[BINS, n], mean signals of the condition in the reference. repeats: number of contacts in it.
        """
        # Normal model: prior N(mean, ratio) of the session's expectation, relative to the variance between contacts,
        # updated with `number` contacts.
        ratio = self.ratio + 1.0 / repeats
        if condition not in self._sums:
            return mean, 1.0 + ratio
        number, deviation = self._sums[condition]
        gain = ratio / (1.0 + number * ratio)
        return mean + gain * deviation, 1.0 + gain

    def add(self, condition: Condition, mean: FloatArray, signal: FloatArray) -> None:
        """Add the signals of a contact of the session.

        mean: f64[BINS, n], mean signals of the contact's condition in the reference, counts. signal: f64[BINS, n],
        measured signals of the contact, counts; NaN: no data.
        """
        usable = np.isfinite(signal)
        number, deviation = self._sums.setdefault(condition, (np.zeros_like(mean), np.zeros_like(mean)))
        number += usable
        deviation += np.where(usable, signal - mean, 0.0)

    def begin(self) -> None:
        """Begin another session: what was learnt about changed taxels stays, the deviations of contacts do not."""
        self._sums.clear()

    def relearn(self, taxels: BoolArray) -> None:
        """Discard what is known about the taxels bool[n] that have changed: their next contacts define the
        expectation.
        """
        self.ratio[:, taxels] = RELEARNED
        for number, deviation in self._sums.values():
            number[:, taxels] = 0.0
            deviation[:, taxels] = 0.0

    def restore(self, session_ratio: FloatArray, taxels: BoolArray) -> None:
        """Expect the signals of the reference again at the taxels bool[n], after a fault has been removed."""
        self.ratio[:, taxels] = session_ratio[:, None]
        for number, deviation in self._sums.values():
            number[:, taxels] = 0.0
            deviation[:, taxels] = 0.0
