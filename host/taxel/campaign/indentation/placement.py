"""Random placements of an object against the skin: a face, an edge or a side of the object against one board or two.

Every sample is checked with the simulator's equilibrium before it is accepted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.indentation.errors import EquilibriumError
from taxel.campaign.indentation.fixed_layer import SPRINGS_PER_SIDE, FixedSkinLayer
from taxel.campaign.indentation.indenters import Feature, Indenter
from taxel.campaign.indentation.plan import IndentationApproach, IndenterMount
from taxel.campaign.indentation.settings import RIG_VARIATION
from taxel.campaign.indentation.simulated_equilibrium import SimulatedEquilibrium
from taxel.campaign.indentation.stroke import AWAY_M, CLEARANCE_M, MIN_CLEARANCE_M
from taxel.campaign.variation import FACTORS
from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import build_sheet
from taxel.hand.transforms import from_rotation_vector
from taxel.sim.sensor_model import SimSensor
from taxel.sim.soft_contact import LayerLaw
from taxel.types import FloatArray

MAX_NEIGHBOUR_DISTANCE_M = 0.025
"""Boards closer than this can be loaded together."""

TILT_RAD = 0.015
"""Standard deviation, per axis, of the angle between the approach's direction and the normal of the target taxel."""

MAX_SLIDE_M = 0.012
"""Largest distance of the feature's centre from the target point, along the feature."""

LOADED_N = 0.15
"""Force above which a taxel is treated as loaded: a signal of about 150 counts."""

MIN_LOADED_PER_BOARD, MIN_LOADED, MAX_LOADED = 3, 5, 60
"""Limits of the number of loaded taxels: minimum on each target board, minimum and maximum in total."""

MAX_TAXEL_FORCE_N = 3.0

MIN_GAP_M = 0.002
"""Smallest distance of the object from boards that are not targets."""

MAX_LATERAL_MOTION_M, MAX_ROTATION_RAD = 0.0015, 0.04
"""Largest deflection of the mount across its line of motion, and largest rotation about its centre."""

MAX_SENSITIVITY_COUNTS = 90.0
"""Largest change of the signal (RMS over loaded taxels) if the object's pose and the force deviate by one standard
deviation. The signals of a more sensitive indentation would be dominated by the variation between its repeats."""

COARSE_DEPTH_M, COARSE_FORCE_N = 0.0012, 1.4
"""Coarse check before the equilibrium is solved: a rigid object is pressed in by this depth, and an approach is
rejected if it needs more than this force for each taxel that the object then touches."""

COARSE_SPRINGS_PER_SIDE = 3
"""Springs along each side of a taxel while a placement is checked."""

MAX_DISCRETISATION_COUNTS = 10.0
"""Largest change of the signal (RMS over loaded taxels) between the coarse springs and those of the simulator. Above
it the contact patch is too narrow for the discretisation of the layer."""

CHECKED_LEVELS = (0.1, 1.0)
"""Shares of the force at which the equilibrium of a placement is solved; fewer than in a campaign, to save time."""

_MAX_SIDEWAYS_M = 0.015
"""Largest sideways motion of an object that makes it touch two boards at the same time."""


@dataclass(frozen=True, eq=False)
class SkinSurface:
    """Outer surface of the skin of a hand with fixed brackets, divided into m squares.

    bracket_poses: f64[s, 4, 4], poses of the s boards' brackets, world. surface, normal: f64[m, 3], centre and normal
    of every square, world; the first n squares are the n taxels, the others the bare margins of the boards. board:
    intp[m], index of the board of each square.
    """

    hand: Hand
    bracket_poses: FloatArray
    surface: FloatArray
    normal: FloatArray
    board: NDArray[np.intp]

    @classmethod
    def of(cls, hand: Hand, bracket_poses: FloatArray) -> SkinSurface:
        """Make the surface of a hand's skin for brackets at `bracket_poses` f64[s, 4, 4], world."""
        sheet = build_sheet(hand)
        poses = bracket_poses[sheet.board_index]
        outer = sheet.position + (hand.layer_m or 0.0) * sheet.normal
        surface = np.einsum("mij,mj->mi", poses[:, :3, :3], outer) + poses[:, :3, 3]
        normal = np.einsum("mij,mj->mi", poses[:, :3, :3], sheet.normal)
        return cls(hand, bracket_poses, surface, normal, sheet.board_index)

    def taxels_of(self, board: int) -> NDArray[np.intp]:
        """List the indices of a board's taxels. board: index in the hand."""
        return np.flatnonzero(self.board[: self.hand.n_taxels] == board)

    def neighbours(self, boards: Sequence[int]) -> list[tuple[int, ...]]:
        """List the pairs of board indices that are near enough for one object to touch both boards at the same time.

        boards: indices of the boards to consider.
        """
        points = {board: self.surface[self.taxels_of(board)] for board in boards}
        return [
            (first, second)
            for first, second in combinations(boards, 2)
            if np.min(np.linalg.norm(points[first][:, None] - points[second], axis=2)) < MAX_NEIGHBOUR_DISTANCE_M
        ]


def compute_travel(surface: SkinSurface, shape: Shape, pose: FloatArray, direction: FloatArray) -> FloatArray:
    """Compute the travel of an object along `direction` until it touches the centre of each of the skin's m squares.

    A square is a taxel or a part of a board's bare margin. Result: f64[m], metres; infinite for a square that the
    object never touches. pose: start pose of the object f64[4, 4], world. direction: unit vector f64[3].
    """
    low, high = shape.bounds
    arm = surface.surface - pose[:3, 3] - pose[:3, :3] @ (0.5 * (low + high))
    lateral2 = np.sum(arm**2, axis=1) - (arm @ direction) ** 2
    is_swept = lateral2 < 0.25 * np.sum((high - low) ** 2)  # swept by the bounding sphere of the object
    travel = np.full(len(is_swept), np.inf)
    points = (surface.surface[is_swept] - pose[:3, 3]) @ pose[:3, :3]
    travel[is_swept] = shape.ray_separation(points, -pose[:3, :3].T @ direction)
    return travel


class _CheckedEquilibrium(NamedTuple):
    """Simulated equilibrium of a placement.

    depth_m: motion of the object along the approach's direction since first contact. pose: f64[4, 4] of the object,
    world. force: f64[n], force on each taxel, newtons.
    """

    depth_m: float
    pose: FloatArray
    force: FloatArray


class PlacementSampler:
    """Samples placements of objects against a skin; each sample is checked by a simulation."""

    def __init__(self, surface: SkinSurface, mount: IndenterMount, rng: np.random.Generator) -> None:
        """Create a sampler for one skin. mount: springs that hold the object. rng: source of the random numbers."""
        self.surface, self._mount, self._rng = surface, mount, rng
        self._fine, self._layer, self._coarsest = (
            FixedSkinLayer(surface.hand, surface.bracket_poses, LayerLaw(), springs)
            for springs in (SPRINGS_PER_SIDE, COARSE_SPRINGS_PER_SIDE, 1)
        )

    def sample(self, indenter: Indenter, boards: tuple[int, ...], force_n: float) -> IndentationApproach | None:
        """Sample one approach of an object to one board or to two neighbouring boards.

        boards: indices of these boards. force_n: force in equilibrium, newtons. The name of the approach is empty; the
        caller sets it. Returns None if the sampled approach loads other boards than `boards`, or has no suitable
        equilibrium; the caller then samples again.
        """
        suitable = [feature for feature in indenter.features if len(boards) == 1 or feature.kind != "edge"]
        feature = suitable[self._rng.integers(len(suitable))]
        target, outward, line = self._sample_target(boards)
        if line is None:  # one board: random direction along the skin, random position on the feature, small tilt
            vector = self._rng.normal(size=3)
            line = vector - (vector @ outward) * outward
            slide = float(self._rng.uniform(-1, 1)) * min(MAX_SLIDE_M, feature.half_length_m)
            outward = from_rotation_vector(TILT_RAD * self._rng.normal(size=3))[:3, :3] @ outward
        else:
            slide = 0.0
        pose = _compute_facing_pose(feature, -outward, line, target, slide)
        if len(boards) == 2:
            pose = self._balance_between(indenter.item.shape, pose, -outward, line, boards)
        return self._check(indenter, pose, -outward, boards, force_n)

    def _sample_target(self, boards: tuple[int, ...]) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """Sample the target of an approach: a point of the skin f64[3] and the outward direction f64[3] at this point.

        The third value is the direction f64[3] of the valley between the two boards; None for one board.
        """
        surface = self.surface
        first = self._rng.choice(surface.taxels_of(boards[0]))
        if len(boards) == 1:
            return surface.surface[first], surface.normal[first], None
        # The valley runs across the line between the centres of the boards. The target lies midway between a taxel of
        # the first board and the taxel of the second board that is opposite to it.
        candidates = surface.taxels_of(boards[1])
        outward = surface.normal[first] + surface.normal[candidates].mean(axis=0)
        outward /= np.linalg.norm(outward)
        of_first_board = surface.surface[surface.taxels_of(boards[0])]
        separation = surface.surface[candidates].mean(axis=0) - of_first_board.mean(axis=0)
        line = np.cross(outward, separation)
        line /= np.linalg.norm(line)
        away = surface.surface[candidates] - surface.surface[first]
        second = candidates[np.argmin(np.abs(away @ line) + np.abs(away @ outward))]
        return 0.5 * (surface.surface[first] + surface.surface[second]), outward, line

    def _balance_between(
        self, shape: Shape, pose: FloatArray, direction: FloatArray, line: FloatArray, boards: tuple[int, ...]
    ) -> FloatArray:
        """Return a pose f64[4, 4] that is shifted sideways so that the object touches both boards at the same time.

        pose: f64[4, 4]; returned unchanged if no shift within `_MAX_SIDEWAYS_M` achieves this. direction: unit vector
        f64[3] of the approach. line: direction f64[3] of the valley between the boards.
        """
        side = np.cross(direction, line)
        squares = [self.surface.board == board for board in boards]

        def compute_travel_difference(offset: float) -> float:
            """Compute travel to the first board minus travel to the second, metres, after a sideways shift."""
            travel = compute_travel(self.surface, shape, _translate(pose, offset * side), direction)
            # The limit of 1 m replaces the infinite travel to a board that the object misses.
            return float(np.clip(travel[squares[0]].min(), -1.0, 1.0) - np.clip(travel[squares[1]].min(), -1.0, 1.0))

        low, high = -_MAX_SIDEWAYS_M, _MAX_SIDEWAYS_M
        sign = np.sign(compute_travel_difference(low))
        if sign == np.sign(compute_travel_difference(high)):
            return pose
        for _ in range(20):  # bisection to less than a micrometre
            middle = 0.5 * (low + high)
            low, high = (middle, high) if np.sign(compute_travel_difference(middle)) == sign else (low, middle)
        return _translate(pose, high * side)

    def _check(
        self, indenter: Indenter, pose: FloatArray, direction: FloatArray, boards: tuple[int, ...], force_n: float
    ) -> IndentationApproach | None:
        """Check a sampled approach by simulation; return the approach, or None if it is unsuitable.

        pose: start pose f64[4, 4] of the object. direction: unit vector f64[3] of the motion. boards: indices of the
        boards that the object must load; it must load no others. force_n: newtons.
        """
        shape, surface = indenter.item.shape, self.surface
        travel = compute_travel(surface, shape, pose, direction)
        first = float(travel.min())
        if not np.isfinite(first) or surface.board[np.argmin(travel)] not in boards:
            return None
        touch, gap = _translate(pose, first * direction), travel[~np.isin(surface.board, boards)] - first
        coarse_force = self._compute_rigid_force(self._coarsest, shape, _translate(touch, COARSE_DEPTH_M * direction))
        # This quick check rejects most unsuitable approaches before their equilibrium is solved.
        reached = np.count_nonzero(coarse_force)
        if reached < MIN_LOADED or force_n > COARSE_FORCE_N * reached:
            return None
        behind = compute_travel(surface, shape, _translate(touch, -MIN_CLEARANCE_M * direction), -direction)
        if behind.min() < AWAY_M + CLEARANCE_M + MIN_GAP_M:
            return None  # the withdrawn object would touch the skin behind it
        checked = self._solve_equilibrium(shape, touch, direction, force_n)
        if checked is None or gap.min(initial=np.inf) < checked.depth_m + MIN_GAP_M:
            return None
        if not self._is_load_suitable(checked.force, boards) or not self._is_resolved(checked, shape):
            return None
        if self._is_too_sensitive(checked, shape, touch, direction, force_n):
            return None
        names = tuple(surface.hand.boards[board].name for board in boards)
        return IndentationApproach(indenter.item.name, "", names, direction, touch, checked.pose, force_n)

    def _solve_equilibrium(
        self, shape: Shape, touch: FloatArray, direction: FloatArray, force_n: float
    ) -> _CheckedEquilibrium | None:
        """Simulate the equilibrium of an object under `force_n` newtons: depth, pose and taxel forces.

        touch: pose at first contact f64[4, 4]. direction: unit vector f64[3] of the motion. Returns None if there is no
        equilibrium, or if the object moves too far sideways or rotates too far.
        """
        equilibrium = SimulatedEquilibrium(self._layer, shape, self._mount, touch, direction)
        try:
            motion = equilibrium.solve_path(force_n, CHECKED_LEVELS).motion
        except EquilibriumError:
            return None
        depth = float(motion[:3] @ direction)
        lateral, rotation = np.linalg.norm(motion[:3] - depth * direction), np.linalg.norm(motion[3:])
        if lateral > MAX_LATERAL_MOTION_M or rotation > MAX_ROTATION_RAD:
            return None
        return _CheckedEquilibrium(depth, equilibrium.pose(motion), equilibrium.taxel_forces(motion))

    def _is_too_sensitive(
        self, checked: _CheckedEquilibrium, shape: Shape, touch: FloatArray, direction: FloatArray, force_n: float
    ) -> bool:
        """Return whether a typical variation of pose and force changes the signals so much that repeats differ greatly.

        One random variation is tried, whose elements each deviate by one standard deviation. checked: equilibrium
        without the variation. touch: pose at first contact f64[4, 4]. force_n: newtons.
        """
        signs = self._rng.choice([-1.0, 1.0], FACTORS)
        offset, force_factor = RIG_VARIATION.apply(signs)
        varied = self._solve_equilibrium(shape, touch @ offset, direction, force_factor * force_n)
        if varied is None:
            return True
        return _compute_rms_difference(checked.force, varied.force) > MAX_SENSITIVITY_COUNTS

    def _is_resolved(self, checked: _CheckedEquilibrium, shape: Shape) -> bool:
        """Return whether the coarse springs are dense enough: with fine springs the signals are nearly the same."""
        fine_force = self._compute_rigid_force(self._fine, shape, checked.pose)
        return _compute_rms_difference(checked.force, fine_force) < MAX_DISCRETISATION_COUNTS

    def _compute_rigid_force(self, layer: FixedSkinLayer, shape: Shape, pose: FloatArray) -> FloatArray:
        """Compute the force of an object that is fixed at `pose` f64[4, 4] on each taxel, newtons, f64[n]."""
        return layer.taxel_forces(layer.near(shape, pose), shape, pose)

    def _is_load_suitable(self, force: FloatArray, boards: tuple[int, ...]) -> bool:
        """Return whether the number of loaded taxels and the largest force are within their limits.

        force: force on each taxel f64[n], newtons. boards: indices of the boards that the object must load.
        """
        loaded = force > LOADED_N
        per_board = [int(loaded[self.surface.taxels_of(board)].sum()) for board in boards]
        return (
            min(per_board) >= MIN_LOADED_PER_BOARD
            and MIN_LOADED <= int(loaded.sum()) <= MAX_LOADED
            and float(force.max()) < MAX_TAXEL_FORCE_N
        )


def _compute_rms_difference(first: FloatArray, second: FloatArray) -> float:
    """Compute the RMS difference, in counts, of the signals that two sets of taxel forces f64[n] newtons cause.

    Only taxels that at least one of the two sets loads are compared.
    """
    loaded = np.maximum(first, second) > LOADED_N
    difference = SimSensor().predict_signal(second[loaded]) - SimSensor().predict_signal(first[loaded])
    return float(np.sqrt(np.mean(difference**2)))


def _translate(pose: FloatArray, offset: FloatArray) -> FloatArray:
    """Return a pose f64[4, 4] that is shifted by an offset f64[3], metres, world."""
    result = pose.copy()
    result[:3, 3] += offset
    return result


def _compute_facing_pose(
    feature: Feature, direction: FloatArray, line: FloatArray, target: FloatArray, slide: float
) -> FloatArray:
    """Compute the pose f64[4, 4] of an object with one of its features (face, edge or side) at the point `target`.

    The feature's outward normal points along `direction` f64[3], and its longest line along the component of `line`
    f64[3] that is perpendicular to `direction`. slide: shift of the feature's centre along this line, metres.
    """
    line = line - (line @ direction) * direction
    line = line / np.linalg.norm(line)
    object_axes = np.column_stack([feature.outward, feature.along, np.cross(feature.outward, feature.along)])
    world_axes = np.column_stack([direction, line, np.cross(direction, line)])
    pose = np.eye(4)
    pose[:3, :3] = world_axes @ object_axes.T
    pose[:3, 3] = target - pose[:3, :3] @ (feature.middle + slide * feature.along)
    return pose
