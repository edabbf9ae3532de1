"""Predictions of contacts by the simulator, with the poses of their stream."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.stats import chi2

from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS
from taxel.twin.schedule import Condition, Contact
from taxel.twin.simulated.contact_fit import OBJECT_PRIOR, ContactEstimate, ContactPoses, ContactSimulator
from taxel.twin.simulated.poses import ConstantPoses, PoseSource
from taxel.twin.steps import BEFORE, HOLD, Step
from taxel.types import FloatArray

IMPLAUSIBLE: Final = 1e-6
"""Probability, under the prior of the object's motion, of a motion as large as that at which the pose counts as wrong
(chosen: less than one false report in a million contacts)."""

FRAME_ITERATIONS: Final = 3
"""Largest number of steps of the estimate of one frame in a view."""

MOST_CACHED: Final = 8
"""Number of contacts of the stream whose predictions are kept: the tests of a step use its prediction several times."""


_Key = tuple[Contact, bytes]
"""A contact and its measured signals: contacts of two sessions may have the same times."""


@dataclass(eq=False)
class SimulatedContacts:
    """Predictions of contacts.

    simulators: by name of the object. poses: nominal poses of the stream. usual: by condition, motion f64[6 + s] that
    its contacts need on average. on_fault: called with a line of text for a contact whose pose is unknown or wrong.
    """

    simulators: Mapping[str, ContactSimulator]
    poses: PoseSource = field(default=ConstantPoses(None))
    usual: dict[Condition, FloatArray] = field(default_factory=dict)
    on_fault: Callable[[str], None] = field(default=lambda text: None)
    _learnt: dict[_Key, FloatArray | None] = field(default_factory=dict)
    _newest: dict[_Key, FloatArray | None] = field(default_factory=dict)
    _frame: tuple[Contact, FloatArray] | None = None
    """Contact and motion of the newest predicted frame."""

    def predict(self, step: Step) -> FloatArray | None:
        """Return the predicted signals in the hold phase of a contact, f64[n], counts.

        None without a contact, for an object without a simulator, without poses, and if the estimated pose is
        implausible; the last two are reported with `on_fault`.
        """
        if step.contact is None:
            return None
        hold = compute_hold_signal(step)
        key = (step.contact, hold.tobytes())
        if key in self._learnt:
            return self._learnt[key]
        if key not in self._newest:
            if len(self._newest) >= MOST_CACHED:
                del self._newest[next(iter(self._newest))]
            self._newest[key] = self._predict(step.contact, hold, self._find_poses(step.contact))
        return self._newest[key]

    def learn(self, step: Step, poses: ContactPoses) -> None:
        """Predict a contact of the reference at its own nominal poses, and keep the prediction."""
        if step.contact is not None:
            hold = compute_hold_signal(step)
            self._learnt[step.contact, hold.tobytes()] = self._predict(step.contact, hold, poses)

    def _predict(self, contact: Contact, hold: FloatArray, poses: ContactPoses | None) -> FloatArray | None:
        """Predict a contact from its mean signals in the hold phase, f64[n], and its nominal poses; as `predict`."""
        simulator = self.simulators.get(contact.condition[0])
        if simulator is None:
            return None
        if poses is None:
            self.on_fault(f"the pose of {contact.condition[0]} is unknown; the contact is not compared")
            return None
        usual = self.usual.get(contact.condition, np.zeros(6 + len(poses.sensor)))
        estimate = simulator.estimate(poses, hold, usual)
        if not is_plausible(estimate, usual, hold):
            shift_mm = 1e3 * float(np.linalg.norm((estimate.motion - usual)[:3]))
            self.on_fault(
                f"the pose of {contact.condition[0]} does not explain the contact (nearest fit {shift_mm:.0f} mm away);"
                " the contact is not compared; check the source of the pose",
            )
            return None
        return estimate.signal

    def predict_frame(self, contact: Contact, time_s: float, measured: FloatArray) -> FloatArray | None:
        """Predict the signals of one frame of a contact, f64[n], counts, or None as `predict`; reports no fault.

        measured: f64[n], signals of the frame; NaN: not measured.
        """
        poses, simulator = self.poses.find(contact, time_s), self.simulators.get(contact.condition[0])
        if poses is None or simulator is None:
            return None
        usual = self.usual.get(contact.condition, np.zeros(6 + len(poses.sensor)))
        if self._frame is None or self._frame[0] != contact:
            estimate = simulator.estimate(poses, measured, usual)
        else:
            estimate = simulator.follow(poses, measured, usual, self._frame[1], FRAME_ITERATIONS)
        self._frame = (contact, estimate.motion)
        return estimate.signal

    def _find_poses(self, contact: Contact) -> ContactPoses | None:
        """Return the nominal poses in the middle of a contact's hold phase."""
        return self.poses.find(contact, 0.5 * (contact.times_s[1] + contact.times_s[2]))


def compute_hold_signal(step: Step) -> FloatArray:
    """Compute the mean signal in the hold phase of a contact, f64[n], counts; NaN without a valid frame."""
    with np.errstate(invalid="ignore", divide="ignore"):
        hold = step.total[HOLD].sum(axis=0) / step.count[HOLD].sum(axis=0)
    return np.asarray(step.compute_means()[BEFORE] - hold)


def is_plausible(estimate: ContactEstimate, usual: FloatArray, measured: FloatArray) -> bool:
    """Whether the object moved no further than its prior permits, and its contact explains the active taxels at all.

    usual: f64[6 + s], mean of the prior. measured: f64[n], counts; NaN: not measured.
    """
    distance = float((((estimate.motion - usual)[:6] / OBJECT_PRIOR) ** 2).sum())
    known = np.isfinite(measured)
    remaining, total = ((measured - estimate.signal)[known] ** 2).sum(), (measured[known] ** 2).sum()
    is_explained = remaining < total or not (measured[known] > ACTIVE_SIGNAL_COUNTS).any()
    return distance < float(chi2.isf(IMPLAUSIBLE, 6)) and bool(is_explained)
