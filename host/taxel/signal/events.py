"""Pressed and released events of a stream of frames."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from taxel.signal.activation import Activation
from taxel.types import BoolArray


@dataclass(frozen=True)
class ContactEvent:
    """Change of the activity of one taxel.

    sample: index of the frame; the first `update` has index 0, and missing frames count. taxel: index of the taxel.
    kind: "pressed" or "released".
    """

    sample: int
    taxel: int
    kind: Literal["pressed", "released"]


class ActivationTracker:
    """Tracker of the state of every taxel that reports changes as events.

    Every taxel starts inactive, so a first valid sample that is active is an event. Missing samples do not change the
    state: a change during a gap is reported at the first valid sample after the gap.

    active: bool[n], the current state.
    has_valid_sample: bool[n], whether at least one valid sample was received.
    suspect_baseline: bool[n], whether the raw count ever exceeded the baseline by more than the threshold, for example
        after the release of a touch that lasted through the whole baseline.
    samples: number of frames so far.
    """

    def __init__(self, activation: Activation) -> None:
        """Create a tracker that reports changes of the activity of taxels; activation: evaluates each frame."""
        self.activation = activation
        self.reset()

    def reset(self) -> None:
        """Return the tracker to sample 0, with all taxels inactive."""
        n_taxels = self.activation.n_taxels
        self.samples = 0
        self.active: BoolArray = np.zeros(n_taxels, dtype=np.bool_)
        self.has_valid_sample: BoolArray = np.zeros(n_taxels, dtype=np.bool_)
        self.suspect_baseline: BoolArray = np.zeros(n_taxels, dtype=np.bool_)

    def update(self, raw_counts: npt.ArrayLike, valid: npt.ArrayLike | None = None) -> tuple[ContactEvent, ...]:
        """Add one frame, and return the taxels that were pressed or released since the last frame as events.

        raw_counts: u16[n]. valid: bool for the whole frame or bool[n]. Raises ValueError for a wrong shape or dtype; a
        rejected frame is not counted.
        """
        if np.ndim(raw_counts) != 1:
            raise ValueError(f"raw_counts: expected one frame of shape [n], found {np.ndim(raw_counts)} dimensions")
        frame = self.activation(raw_counts, valid)
        changed = ~frame.missing & (frame.active != self.active)
        events = tuple(
            ContactEvent(self.samples, taxel, "pressed" if frame.active[taxel] else "released")
            for taxel in np.flatnonzero(changed).tolist()
        )
        self.active = self.active ^ changed
        self.has_valid_sample = self.has_valid_sample | ~frame.missing
        self.suspect_baseline = self.suspect_baseline | frame.suspect_baseline
        self.samples += 1
        return events
