"""Ways to press drawn at random: an object's feature against a spot of one board or of two, tried in the simulator."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.press.errors import PressError
from taxel.campaign.press.families import Feature, PressObject
from taxel.campaign.press.plan import PressApproach, PressMount
from taxel.campaign.press.settings import PRESS_SCATTER
from taxel.campaign.press.soft_rest import SoftRest
from taxel.campaign.press.standing_layer import PARTS, StandingLayer
from taxel.campaign.press.stroke import AWAY_M, CLEARANCE_M, LEAST_CLEARANCE_M
from taxel.campaign.scatter import FACTORS
from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import sheet_of
from taxel.hand.transforms import from_rotation_vector
from taxel.sim.sensor_model import SimSensor
from taxel.sim.soft_contact import LayerLaw
from taxel.types import FloatArray

NEIGHBOURS_M = 0.025
"""Two boards nearer than this may be pressed together."""

TILT_RAD = 0.015
"""Standard deviation of a press against its spot's normal."""

SLIDE_M = 0.012
"""Farthest that a feature's middle lies from the spot, along the feature."""

FELT_N = 0.15
"""A taxel that carries as much is pressed: it falls by some 150 counts."""

FEWEST_EACH, FEWEST, MOST = 3, 5, 60
"""Pressed taxels: of each board that is meant, of all, and at most."""

HARDEST_N = 3.0
"""On one taxel."""

ROOM_M = 0.002
"""That a board which is not meant stays clear by."""

MOST_MOTION_M, MOST_TURN_RAD = 0.0015, 0.04
"""How far the mount may give way across its line, and about its point."""

MOST_CHANGE = 90.0
"""By which the pressed taxels' counts may change (RMS) if object and force are one standard deviation off: a press
that is more delicate tells of nothing but its own scatter."""

GLANCE_M, GLANCE_N = 0.0012, 1.4
"""Before anything is solved: taxels that a rigid object reaches which sinks in so far, and force for each of them."""

TRIAL_PARTS = 3
"""Springs along each side of a taxel while a placing is tried."""

MOST_GRAIN = 10.0
"""By which the pressed taxels' counts may change (RMS) with the springs that the simulator has: else the patch is so
narrow that two models of it differ by their grain."""

TRIAL_LEVELS = (0.1, 1.0)
_SIDEWAYS_M = 0.015


@dataclass(frozen=True, eq=False)
class Skin:
    """A hand whose brackets stand still, seen from outside.

    surface, normal: of every square of its sheet, world, f64[m, 3]; board: whose it is, [m]. The first n are taxels.
    """

    hand: Hand
    bracket_poses: FloatArray
    surface: FloatArray
    normal: FloatArray
    board: NDArray[np.intp]

    @classmethod
    def of(cls, hand: Hand, bracket_poses: FloatArray) -> Skin:
        """`hand` with brackets at `bracket_poses` f64[s, 4, 4]."""
        sheet = sheet_of(hand)
        poses = bracket_poses[sheet.board_index]
        outer = sheet.position + (hand.layer_m or 0.0) * sheet.normal
        surface = np.einsum("mij,mj->mi", poses[:, :3, :3], outer) + poses[:, :3, 3]
        normal = np.einsum("mij,mj->mi", poses[:, :3, :3], sheet.normal)
        return cls(hand, bracket_poses, surface, normal, sheet.board_index)

    def taxels_of(self, board: int) -> NDArray[np.intp]:
        """Indices of a board's taxels."""
        return np.flatnonzero(self.board[: self.hand.n_taxels] == board)

    def neighbours(self, boards: Sequence[int]) -> list[tuple[int, ...]]:
        """Pairs of boards that one object may touch at once."""
        places = {board: self.surface[self.taxels_of(board)] for board in boards}
        return [
            (one, two)
            for one, two in combinations(boards, 2)
            if np.min(np.linalg.norm(places[one][:, None] - places[two], axis=2)) < NEIGHBOURS_M
        ]


def travel_to(skin: Skin, shape: Shape, pose: FloatArray, direction: FloatArray) -> FloatArray:
    """How far the object may move along `direction` until it touches the middle of each square, metres, f64[m];
    infinite if it never does.
    """
    low, high = shape.bounds
    arm = skin.surface - pose[:3, 3] - pose[:3, :3] @ (0.5 * (low + high))
    beside = np.sum(arm**2, axis=1) - (arm @ direction) ** 2
    ahead = beside < 0.25 * np.sum((high - low) ** 2)  # the ball round the object sweeps over them
    travel = np.full(len(ahead), np.inf)
    points = (skin.surface[ahead] - pose[:3, 3]) @ pose[:3, :3]
    travel[ahead] = shape.ray_separation(points, -pose[:3, :3].T @ direction)
    return travel


class _Trial(NamedTuple):
    """How far in the object rests, metres; where, f64[4, 4]; the force on every taxel, newtons, f64[n]."""

    sunk_m: float
    pose: FloatArray
    force: FloatArray


class Placer:
    """Draws ways to press `skin` with a mount. rng: where the numbers come from."""

    def __init__(self, skin: Skin, mount: PressMount, rng: np.random.Generator) -> None:
        self._skin, self._mount, self._rng = skin, mount, rng
        self._fine, self._layer, self._coarsest = (
            StandingLayer(skin.hand, skin.bracket_poses, LayerLaw(), parts) for parts in (PARTS, TRIAL_PARTS, 1)
        )

    def draw(self, thing: PressObject, boards: tuple[int, ...], force_n: float) -> PressApproach | None:
        """One attempt, without a name; None if it would not press those boards, those alone, and come to rest."""
        suited = [item for item in thing.features if len(boards) == 1 or item.kind != "edge"]
        feature = suited[self._rng.integers(len(suited))]
        spot, outward, line = self._spot(boards)
        if line is None:
            turn = self._rng.normal(size=3)
            line = turn - (turn @ outward) * outward
            slide = float(self._rng.uniform(-1, 1)) * min(SLIDE_M, feature.reach_m)
            outward = from_rotation_vector(TILT_RAD * self._rng.normal(size=3))[:3, :3] @ outward
        else:
            slide = 0.0
        pose = _facing(feature, -outward, line, spot, slide)
        shape = thing.item.shape
        if len(boards) == 2:
            pose = self._between(shape, pose, -outward, line, boards)
        return self._tried(thing, pose, -outward, boards, force_n)

    def _spot(self, boards: tuple[int, ...]) -> tuple[FloatArray, FloatArray, FloatArray | None]:
        """Where to press, the direction out of the skin there, and for two boards the line of the valley between."""
        skin = self._skin
        first = self._rng.choice(skin.taxels_of(boards[0]))
        if len(boards) == 1:
            return skin.surface[first], skin.normal[first], None
        others = skin.taxels_of(boards[1])
        outward = skin.normal[first] + skin.normal[others].mean(axis=0)
        outward /= np.linalg.norm(outward)
        apart = skin.surface[others].mean(axis=0) - skin.surface[skin.taxels_of(boards[0])].mean(axis=0)
        line = np.cross(outward, apart)
        line /= np.linalg.norm(line)
        away = skin.surface[others] - skin.surface[first]
        second = others[np.argmin(np.abs(away @ line) + np.abs(away @ outward))]
        return 0.5 * (skin.surface[first] + skin.surface[second]), outward, line

    def _between(
        self, shape: Shape, pose: FloatArray, direction: FloatArray, line: FloatArray, boards: tuple[int, ...]
    ) -> FloatArray:
        """Moved sideways until both boards are touched at once, if they can be."""
        side = np.cross(direction, line)
        own = [self._skin.board == board for board in boards]

        def lead(shift: float) -> float:
            travel = travel_to(self._skin, shape, _moved(pose, shift * side), direction)
            return float(np.clip(travel[own[0]].min(), -1.0, 1.0) - np.clip(travel[own[1]].min(), -1.0, 1.0))

        low, high = -_SIDEWAYS_M, _SIDEWAYS_M
        sign = np.sign(lead(low))
        if sign == np.sign(lead(high)):
            return pose
        for _ in range(20):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if np.sign(lead(middle)) == sign else (low, middle)
        return _moved(pose, high * side)

    def _tried(
        self, thing: PressObject, pose: FloatArray, direction: FloatArray, boards: tuple[int, ...], force_n: float
    ) -> PressApproach | None:
        shape, skin = thing.item.shape, self._skin
        travel = travel_to(skin, shape, pose, direction)
        first = float(travel.min())
        if not np.isfinite(first) or skin.board[np.argmin(travel)] not in boards:
            return None
        touch, room = _moved(pose, first * direction), travel[~np.isin(skin.board, boards)] - first
        under = np.count_nonzero(self._felt(self._coarsest, shape, _moved(touch, GLANCE_M * direction)))
        if under < FEWEST or force_n > GLANCE_N * under:
            return None
        back = travel_to(skin, shape, _moved(touch, -LEAST_CLEARANCE_M * direction), -direction)
        if back.min() < AWAY_M + CLEARANCE_M + ROOM_M:
            return None  # on its way it would touch what lies behind it
        found = self._pressed(shape, touch, direction, force_n)
        if found is None or room.min(initial=np.inf) < found.sunk_m + ROOM_M:
            return None
        if not self._presses(found.force, boards) or not self._is_resolved(found, shape):
            return None
        if self._is_delicate(found, shape, touch, direction, force_n):
            return None
        names = tuple(skin.hand.boards[board].name for board in boards)
        return PressApproach(thing.item.name, "", names, direction, touch, found.pose, force_n)

    def _pressed(self, shape: Shape, touch: FloatArray, direction: FloatArray, force_n: float) -> _Trial | None:
        rest = SoftRest(self._layer, shape, self._mount, touch, direction)
        try:
            moved = rest.press(force_n, TRIAL_LEVELS).motion
        except PressError:
            return None
        sunk = float(moved[:3] @ direction)
        across, turned = np.linalg.norm(moved[:3] - sunk * direction), np.linalg.norm(moved[3:])
        if across > MOST_MOTION_M or turned > MOST_TURN_RAD:
            return None
        return _Trial(sunk, rest.pose(moved), rest.taxel_forces(moved))

    def _is_delicate(
        self, found: _Trial, shape: Shape, touch: FloatArray, direction: FloatArray, force_n: float
    ) -> bool:
        signs = self._rng.choice([-1.0, 1.0], FACTORS)
        offset, strength = PRESS_SCATTER.moved(signs)
        other = self._pressed(shape, touch @ offset, direction, strength * force_n)
        if other is None:
            return True
        return _difference(found.force, other.force) > MOST_CHANGE

    def _is_resolved(self, found: _Trial, shape: Shape) -> bool:
        """Do the layer's springs stand close enough for what is pressed into them?"""
        return _difference(found.force, self._felt(self._fine, shape, found.pose)) < MOST_GRAIN

    def _felt(self, layer: StandingLayer, shape: Shape, pose: FloatArray) -> FloatArray:
        return layer.taxel_forces(layer.near(shape, pose), shape, pose)

    def _presses(self, force: FloatArray, boards: tuple[int, ...]) -> bool:
        felt = force > FELT_N
        each = [int(felt[self._skin.taxels_of(board)].sum()) for board in boards]
        return min(each) >= FEWEST_EACH and FEWEST <= int(felt.sum()) <= MOST and float(force.max()) < HARDEST_N


def _difference(one: FloatArray, other: FloatArray) -> float:
    """Between the drops that forces f64[n] make on taxels that either presses, counts RMS."""
    felt = np.maximum(one, other) > FELT_N
    change = SimSensor().drop(other[felt]) - SimSensor().drop(one[felt])
    return float(np.sqrt(np.mean(change**2)))


def _moved(pose: FloatArray, by: FloatArray) -> FloatArray:
    result = pose.copy()
    result[:3, 3] += by
    return result


def _facing(feature: Feature, direction: FloatArray, line: FloatArray, spot: FloatArray, slide: float) -> FloatArray:
    """The object's pose with its feature at `spot`, facing along `direction`, its own line along `line`."""
    line = line - (line @ direction) * direction
    line = line / np.linalg.norm(line)
    theirs = np.column_stack([feature.outward, feature.along, np.cross(feature.outward, feature.along)])
    ours = np.column_stack([direction, line, np.cross(direction, line)])
    pose = np.eye(4)
    pose[:3, :3] = ours @ theirs.T
    pose[:3, 3] = spot - pose[:3, :3] @ (feature.middle + slide * feature.along)
    return pose
