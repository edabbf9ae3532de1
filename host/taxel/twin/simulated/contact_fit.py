"""Signals of a contact predicted by the simulator's layer, at poses that are estimated from the measured signals.

The nominal poses of brackets and object have errors of millimetres, and the layer is about two millimetres thick. A
prediction at the nominal poses therefore has little in common with the contact. The estimate moves the object (six
numbers) and brings each board closer or further away (one number). Two fits follow each other: the first places the
surface of the object at the depths that the signals imply, which converges from far away; the second compares the
signals themselves.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.kinematics import compute_taxel_normals, compute_taxel_positions
from taxel.hand.transforms import apply, from_rotation_vector, inverse
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS
from taxel.sim.native_contact import NativeContact
from taxel.sim.sensor_model import SimSensor
from taxel.sim.soft_contact import LayerLaw
from taxel.twin.simulated.robust_fit import Prior, fit
from taxel.types import FloatArray, IndexArray

OBJECT_PRIOR: Final = np.array([0.002, 0.002, 0.002, 0.05, 0.05, 0.05])
"""Standard deviations of the object's motion: three translations, metres, and three rotations, radians (chosen: an
object that a person places on marks)."""

APPROACH_PRIOR_M: Final = 0.001
"""Standard deviation of the approach of a board, metres (chosen: the play of the finger joints, and the error of the
encoders at the length of a finger)."""

SIGNAL_ERROR_COUNTS: Final = 30.0
RELATIVE_SIGNAL_ERROR: Final = 0.2
"""Scale of the error of a predicted signal: a constant, counts, plus this share of the measured signal (chosen: the
difference between the emulated skin and the simulator in single taxels)."""

DEPTH_ERROR_M: Final = 0.0002
"""Scale of the error of a depth that a signal implies, metres (chosen: a tenth of the layer and more)."""

STEP: Final = 0.02
"""Step of the numerical derivatives, in standard deviations of the prior."""

GAUSSIAN: Final = 1e6
"""Degrees of freedom of the errors of the first fit, which are then normal: with heavier tails, a search that begins
far away may leave the object outside the contact."""

SURFACE_ITERATIONS: Final = 15
ITERATIONS: Final = 25
"""Largest numbers of steps of the two fits; most contacts need fewer than ten."""

NEIGHBOUR_M: Final = 0.0075
"""Largest distance of neighbouring taxels, metres: one and a half pitches."""

TABLE_DEPTHS_M: Final = np.linspace(0.0, 0.0016, 161)
"""Depths of the table from which the depth follows for a signal, metres: up to the solid layer."""


@dataclass(frozen=True, eq=False)
class ContactPoses:
    """Poses in the world: brackets of the s boards, f64[s, 4, 4], and the object, f64[4, 4]."""

    sensor: FloatArray
    object: FloatArray


@dataclass(frozen=True, eq=False)
class ContactEstimate:
    """Estimate of one contact; n taxels, s boards.

    signal: f64[n], predicted signal, counts. motion: f64[6 + s], translation (m) and rotation vector (rad) of the
    object about its origin in the world, and approach of each board towards the object (m). misfit: minus the logarithm
    of the posterior density up to a constant.
    """

    signal: FloatArray
    motion: FloatArray
    misfit: float


@dataclass(eq=False)
class ContactSimulator:
    """Predicts the signals of a hand in contact with one object.

    shape: the object. sensor, law: models of sensor and layer. prior_deviation: f64[6 + s], standard deviations of the
    motions. neighbours: int[k, 2], pairs of neighbouring taxels.
    """

    hand: Hand
    shape: Shape
    sensor: SimSensor = field(default_factory=SimSensor)
    law: LayerLaw = field(default_factory=LayerLaw)

    def __post_init__(self) -> None:
        """Prepare the contact of the layer; raises SimLibraryError and TypeError as `NativeContact`."""
        self._contact = NativeContact(self.hand, self.shape, self.law)
        self._table = self.sensor.predict_signal(self.law.compute_force(TABLE_DEPTHS_M))
        self.prior_deviation = np.concatenate([OBJECT_PRIOR, np.full(len(self.hand.boards), APPROACH_PRIOR_M)])
        self.neighbours = find_neighbour_pairs(self.hand)

    def predict(self, poses: ContactPoses) -> FloatArray:
        """Predict the signals at given poses, f64[n], counts."""
        force = self._contact.compute_taxel_forces(poses.sensor, poses.object)
        return self.sensor.predict_signal(force, self.hand.area_share)

    def compute_depths(self, signal: FloatArray) -> FloatArray:
        """Return the compression of the layer that a signal implies, f64[n], metres; 0 without signal."""
        return np.asarray(np.interp(signal, self._table, TABLE_DEPTHS_M))

    def estimate(self, poses: ContactPoses, measured: FloatArray, usual: FloatArray | None = None) -> ContactEstimate:
        """Estimate motions of object and boards from measured signals, and predict the signals after these motions.

        A first fit moves the surface of the object to the depths that the signals imply, which converges from far away.
        Its result is one start of the fit of the signals, the mean of the prior is the other; the fit with the smaller
        misfit is returned.

        poses: nominal poses. measured: f64[n], counts; NaN: not measured. usual: f64[6 + s], mean of the prior of the
        motions; None: 0.
        """
        prior = Prior(np.zeros(6 + len(self.hand.boards)) if usual is None else usual, self.prior_deviation)
        surface, _ = fit(_SurfaceModel(self, poses, measured), prior, prior.mean, SURFACE_ITERATIONS, GAUSSIAN)
        model = _SignalModel(self, poses, measured)
        found = [fit(model, prior, start, ITERATIONS) for start in (surface, prior.mean)]
        motion, misfit = min(found, key=lambda each: each[1])
        return ContactEstimate(model.predict(motion), motion, misfit)

    def follow(
        self, poses: ContactPoses, measured: FloatArray, usual: FloatArray, start: FloatArray, iterations: int
    ) -> ContactEstimate:
        """Estimate motions from the next frame of a contact with a few steps from the last frame's motions `start`.

        Other arguments as for `estimate`.
        """
        model = _SignalModel(self, poses, measured)
        motion, misfit = fit(model, Prior(usual, self.prior_deviation), start, iterations)
        return ContactEstimate(model.predict(motion), motion, misfit)


class _MotionModel:
    """Base of the two models: poses after a motion, and numerical derivatives.

    Each value belongs to one taxel, so that it depends on the approach of one board only.
    """

    def __init__(self, simulator: ContactSimulator, poses: ContactPoses, measured: FloatArray) -> None:
        """Prepare a fit; arguments as for `ContactSimulator.estimate`."""
        self._simulator, self._poses = simulator, poses
        self._is_measured = np.isfinite(measured)
        self._measured = np.nan_to_num(measured)
        self._directions = self._find_directions()

    def _find_directions(self) -> FloatArray:
        """Return the direction in which each board approaches the object, f64[s, 3], unit vectors in the world.

        This direction is the mean outward normal of the board's taxels, with their measured signals as weights.
        """
        hand = self._simulator.hand
        normals = compute_taxel_normals(hand, self._poses.sensor)
        weight = np.maximum(self._measured, 1.0)
        sums = np.stack(
            [np.bincount(hand.board_index, weight * normals[:, axis], len(hand.boards)) for axis in range(3)], axis=1
        )
        return np.asarray(sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12))

    def _move(self, motion: FloatArray) -> ContactPoses:
        """Return the poses after the motions f64[6 + s] of object and boards (see `ContactEstimate`)."""
        item = self._poses.object.copy()
        item[:3, :3] = from_rotation_vector(motion[3:6])[:3, :3] @ item[:3, :3]
        item[:3, 3] += motion[:3]
        sensor = self._poses.sensor.copy()
        sensor[:, :3, 3] += motion[6:, None] * self._directions
        return ContactPoses(sensor, item)

    def compute_errors(self, parameters: FloatArray) -> FloatArray:
        """Return the errors after the motions f64[6 + s], f64[n] (see `robust_fit.FitModel`)."""
        raise NotImplementedError

    def differentiate(self, parameters: FloatArray, errors: FloatArray) -> FloatArray:
        """Return minus the derivatives of the errors, f64[n, 6 + s], per standard deviation of the prior.

        The approach of a board changes only the errors of its own taxels, so that one evaluation moves all boards.
        """
        hand, prior = self._simulator.hand, self._simulator.prior_deviation
        slopes = np.zeros((len(errors), len(parameters)))
        for index in range(6):
            moved = parameters.copy()
            moved[index] += STEP * prior[index]
            slopes[:, index] = errors - self.compute_errors(moved)
        moved = parameters.copy()
        moved[6:] += STEP * prior[6:]
        slopes[np.arange(len(errors)), 6 + hand.board_index] = errors - self.compute_errors(moved)
        return slopes / STEP


class _SignalModel(_MotionModel):
    """Errors of the signals."""

    def __init__(self, simulator: ContactSimulator, poses: ContactPoses, measured: FloatArray) -> None:
        super().__init__(simulator, poses, measured)
        self._scale = SIGNAL_ERROR_COUNTS + RELATIVE_SIGNAL_ERROR * np.maximum(self._measured, 0.0)

    def predict(self, motion: FloatArray) -> FloatArray:
        """Predict the signals after the motions, f64[n], counts."""
        return self._simulator.predict(self._move(motion))

    def compute_errors(self, parameters: FloatArray) -> FloatArray:
        """Return measured minus predicted signal in units of the scale of their error, f64[n]."""
        return np.where(self._is_measured, (self._measured - self.predict(parameters)) / self._scale, 0.0)


class _SurfaceModel(_MotionModel):
    """Errors of the distances from the taxels to the object.

    The layer over an active taxel is indented by the depth that the signal implies; over an inactive taxel the object
    does not reach into the layer.
    """

    def __init__(self, simulator: ContactSimulator, poses: ContactPoses, measured: FloatArray) -> None:
        super().__init__(simulator, poses, measured)
        self._is_active = self._measured > ACTIVE_SIGNAL_COUNTS
        self._depth = simulator.compute_depths(self._measured)
        # Contact propagation and crosstalk make taxels beside the contact active, with less signal than their
        # neighbours: they contain little information on the surface.
        largest = find_largest_neighbour(simulator.neighbours, np.maximum(self._measured, 0.0))
        share = np.where(self._is_active, self._measured / np.maximum(largest, 1.0), 1.0)
        self._scale = DEPTH_ERROR_M / share**2

    def compute_errors(self, parameters: FloatArray) -> FloatArray:
        """Return the expected minus the present distance of each taxel's surface from the object, f64[n].

        The unit is the scale of the error. An active taxel is expected at the depth that its signal implies, an
        inactive taxel outside the object; a taxel without measurement has the error 0.
        """
        simulator = self._simulator
        poses = self._move(parameters)
        tops = compute_taxel_positions(simulator.hand, poses.sensor)
        tops += (simulator.hand.layer_m or 0.0) * compute_taxel_normals(simulator.hand, poses.sensor)
        distance = simulator.shape.signed_distance(apply(inverse(poses.object), tops))
        expected = np.where(self._is_active, -self._depth, np.maximum(distance, 0.0))
        return np.where(self._is_measured, (expected - distance) / self._scale, 0.0)


def find_neighbour_pairs(hand: Hand) -> IndexArray:
    """Return the pairs of neighbouring taxels on the same board, int[k, 2]."""
    pairs = []
    for board in range(len(hand.boards)):
        members = np.flatnonzero(hand.board_index == board)
        pairs.append(members[cKDTree(hand.position[members]).query_pairs(NEIGHBOUR_M, output_type="ndarray")])
    return np.concatenate(pairs)


def find_largest_neighbour(pairs: IndexArray, values: FloatArray) -> FloatArray:
    """Return the largest value of each taxel and its neighbours, f64[n]. pairs: as `find_neighbour_pairs` returns."""
    result = values.copy()
    np.maximum.at(result, pairs[:, 0], values[pairs[:, 1]])
    np.maximum.at(result, pairs[:, 1], values[pairs[:, 0]])
    return result
