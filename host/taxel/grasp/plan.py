"""The grasps of the thesis: fifteen approaches to three objects, repeated 144 times in six sessions (Table 5.1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.grasp.objects import GraspObject, thesis_objects
from taxel.hand import Hand, load_hand
from taxel.types import FloatArray

PALM_BOARD: Final = "palm"  # of the hand "allegro": its layer touches the object

# Table 5.1 of the thesis: how often each approach was repeated.
ITERATIONS: Final[dict[tuple[str, str], int]] = {
    ("rectangular_prism", "wide_side_1"): 6,
    ("rectangular_prism", "narrow_side_1"): 10,
    ("rectangular_prism", "wide_side_2"): 8,
    ("rectangular_prism", "narrow_side_2"): 10,
    ("rectangular_prism", "top"): 10,
    ("rectangular_prism", "side_edge"): 10,
    ("cylinder", "side_1"): 10,
    ("cylinder", "side_2"): 10,
    ("cylinder", "side_3"): 10,
    ("cylinder", "side_4"): 10,
    ("cylinder", "top"): 10,
    ("triangular_prism", "side_1"): 10,
    ("triangular_prism", "side_2"): 10,
    ("triangular_prism", "side_3"): 10,
    ("triangular_prism", "top"): 10,
}
SESSIONS: Final = 6


@dataclass(frozen=True)
class Placing:
    """How the hand meets one face, edge or top of an object; the figures behind an approach.

    Attributes:
        azimuth_rad: side: direction from the object's axis to the palm, about z from x. Top: direction of the fingers.
        edge_z_m: how far towards the fingertips the object reaches: the largest coordinate along the palm's z.
        axis_y_m: coordinate along the palm's y of the object's middle.
        thumb_rad: th_j0 and th_j1, held.
        spread_rad: by how much index and little finger turn away from the middle one, held.
        press_m: how far the palm goes on once its surface touches the nominal object; mount and skin give way.
        top: the palm faces down on the top face.
    """

    azimuth_rad: float
    edge_z_m: float
    thumb_rad: tuple[float, float]
    axis_y_m: float = 0.0
    spread_rad: float = 0.0
    press_m: float = 0.0
    top: bool = False


# Found by closing the hand over a grid of placings and presses, and keeping those in which both solvers come to rest,
# and to the same rest. On a side palm, fingers and thumb bear. On a top palm and thumb bear, and the fingers close
# beyond the object: without friction none stays on a vertical face so near its upper edge.
_BOX_WIDE = Placing(0.0, edge_z_m=0.045, thumb_rad=(1.20, 0.30), press_m=0.0012)
_BOX_NARROW = Placing(0.0, edge_z_m=0.005, thumb_rad=(1.20, 0.30), press_m=0.002)
_BOX_EDGE = Placing(0.0, edge_z_m=0.025, thumb_rad=(1.20, 0.30), press_m=0.002)
_BOX_TOP = Placing(0.0, edge_z_m=-0.030, thumb_rad=(0.30, 0.50), press_m=0.002, top=True)
_CYLINDER = Placing(0.0, edge_z_m=0.015, thumb_rad=(1.30, 0.50), press_m=0.0012)
_CYLINDER_TOP = Placing(0.0, edge_z_m=-0.030, thumb_rad=(0.30, 0.50), press_m=0.002, top=True)
_PRISM = Placing(0.0, edge_z_m=0.0, thumb_rad=(0.90, 0.50), press_m=0.001)
_PRISM_TOP = Placing(0.0, edge_z_m=-0.030, thumb_rad=(0.90, 0.50), press_m=0.002, top=True)


def _from(degrees: float, placing: Placing) -> Placing:
    return replace(placing, azimuth_rad=float(np.deg2rad(degrees)))


PLACINGS: Final[dict[tuple[str, str], Placing]] = {
    ("rectangular_prism", "wide_side_1"): _from(90, _BOX_WIDE),
    ("rectangular_prism", "narrow_side_1"): _from(0, _BOX_NARROW),
    ("rectangular_prism", "wide_side_2"): _from(270, _BOX_WIDE),
    ("rectangular_prism", "narrow_side_2"): _from(180, _BOX_NARROW),
    ("rectangular_prism", "top"): _from(90, _BOX_TOP),
    ("rectangular_prism", "side_edge"): _from(45, _BOX_EDGE),
    **{("cylinder", f"side_{k + 1}"): _from(90 * k, _CYLINDER) for k in range(4)},
    ("cylinder", "top"): _from(0, _CYLINDER_TOP),
    **{("triangular_prism", f"side_{k + 1}"): _from(90 + 120 * k, _PRISM) for k in range(3)},
    ("triangular_prism", "top"): _from(0, _PRISM_TOP),
}

# Nm of joints 1, 2 and 3 of a finger and 2 and 3 of the thumb; the same for every object, as in the thesis. Tuned so
# that a finger presses with 3 to 12 N.
FINGER_TORQUE_NM: Final = (0.31, 0.27, 0.105)
THUMB_TORQUE_NM: Final = (0.38, 0.155)
OPEN_RAD: Final = -0.1  # of the joints that close: slightly bent back, within their ranges
FINGERS: Final = 3


@dataclass(frozen=True, eq=False)
class Approach:
    """How the hand comes to an object and what its joints do. Joints in the order of the hand's, j of them.

    Attributes:
        object: name of the object.
        name: such as "wide_side_1".
        palm_pose: the palm link's frame in the object's while the hand grasps, f64[4, 4].
        open_angles: f64[j], radians, before closing and after release.
        base_targets: f64[j], radians, of the joints that hold their place all the time; NaN for those that close.
        torque: f64[j], Nm, with which the others close; 0 for held joints.
        withdraw_m: how far the palm stays away, back along its own x, in the baseline and in recovery (the thesis
            takes its baseline before the arm comes to the object, section 5.4); 0: it does not move.
    """

    object: str
    name: str
    palm_pose: FloatArray
    open_angles: FloatArray
    base_targets: FloatArray
    torque: FloatArray
    withdraw_m: float = 0.0

    @cached_property
    def held(self) -> npt.NDArray[np.bool_]:
        """Which joints hold their place, bool[j]."""
        return np.isfinite(self.base_targets)

    def palm_pose_at(self, withdrawn: float) -> FloatArray:
        """The palm link's frame in the object's, f64[4, 4], from 0 (grasping) to 1 (see `Timeline.withdrawn_at`)."""
        result = self.palm_pose.copy()
        result[:3, 3] -= withdrawn * self.withdraw_m * result[:3, 0]
        return result


@dataclass(frozen=True, eq=False)
class PlannedGrasp:
    """One grasp of the plan.

    Attributes:
        id: unique and sortable by time, such as "s1_07_cylinder_side_2_1".
        object, approach: names.
        iteration: how many grasps of that approach came before it, from 0.
        session: 0..sessions - 1.
    """

    id: str
    object: str
    approach: str
    iteration: int
    session: int


def palm_surface_m(hand: Hand) -> float:
    """Coordinate along the palm link's x of the palm board's outer surface: its electrodes and the layer on them."""
    board = hand.find_board(PALM_BOARD)
    if board.pose is None:
        raise ValueError(f"hand {hand.name!r}: the palm board has no bracket")
    electrodes = hand.position[hand.get_slice(board.address)] @ board.pose[:3, :3].T + board.pose[:3, 3]
    return float(electrodes[:, 0].max()) + (hand.layer_m or 0.0)


def palm_pose(item: GraspObject, placing: Placing, surface_m: float, gap_m: float = 0.0) -> FloatArray:
    """The palm link's pose in the object's frame, f64[4, 4].

    surface_m: from the palm link's origin to the palm's outer surface. gap_m: from there to the object.
    On a side the palm's y points up, so that the fingers wrap round the object horizontally; on top they point along
    the azimuth.
    """
    vertices = item.shape.mesh()[0]
    azimuth = np.array([np.cos(placing.azimuth_rad), np.sin(placing.azimuth_rad), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    result = np.eye(4)
    if placing.top:
        x, z = -up, azimuth
        y = np.cross(z, x)
        axis = np.zeros(3)
    else:
        x, y = -azimuth, up
        z = np.cross(x, y)
        axis = up * item.shape.height / 2
    outward = -x
    reach = float(((vertices - axis) @ outward).max())
    axis_z = placing.edge_z_m - float(((vertices - axis) @ z).max())
    result[:3, :3] = np.column_stack([x, y, z])
    result[:3, 3] = axis + outward * (reach + surface_m + gap_m) - y * placing.axis_y_m - z * axis_z
    return result


def approach_of(
    item: GraspObject, name: str, placing: Placing, hand: Hand, gap_m: float = 0.0, withdraw_m: float = 0.0
) -> Approach:
    """The approach that a placing of the Allegro hand stands for."""
    spread, (th_j0, th_j1) = placing.spread_rad, placing.thumb_rad
    base, torque = np.full((FINGERS + 1, 4), np.nan), np.zeros((FINGERS + 1, 4))
    base[:FINGERS, 0] = spread, 0.0, -spread
    base[FINGERS, :2] = th_j0, th_j1
    torque[:FINGERS, 1:] = FINGER_TORQUE_NM
    torque[FINGERS, 2:] = THUMB_TORQUE_NM
    return Approach(
        item.name,
        name,
        palm_pose(item, placing, palm_surface_m(hand), gap_m - placing.press_m),
        np.where(np.isfinite(base), base, OPEN_RAD).ravel(),
        base.ravel(),
        torque.ravel(),
        withdraw_m,
    )


def thesis_approaches(
    gap_m: float = 0.0, withdraw_m: float = 0.0, placings: Mapping[tuple[str, str], Placing] = PLACINGS
) -> tuple[Approach, ...]:
    """The fifteen approaches of Table 5.1, in its order.

    gap_m: from the palm's surface to the nominal object while the hand grasps. withdraw_m: see `Approach`. placings:
    of objects and approaches; those that were found for both solvers are the default.
    """
    objects, hand = thesis_objects(), load_hand("allegro")
    return tuple(
        approach_of(objects[key[0]], key[1], placing, hand, gap_m, withdraw_m) for key, placing in placings.items()
    )


def thesis_plan(seed: int, sessions: int = SESSIONS) -> tuple[PlannedGrasp, ...]:
    """The 144 grasps of Table 5.1, in the order in which they are made.

    They are dealt out so that every session has every approach (with at most six sessions) and all have the same
    length within one; the order inside a session is drawn with `seed`. Raises ValueError for no session or more
    sessions than an approach has grasps.
    """
    if not 1 <= sessions <= min(ITERATIONS.values()):
        raise ValueError(f"sessions: expected 1 to {min(ITERATIONS.values())}, found {sessions}")
    dealt: list[list[tuple[str, str]]] = [[] for _ in range(sessions)]
    for k, key in enumerate(key for key, count in ITERATIONS.items() for _ in range(count)):
        dealt[k % sessions].append(key)
    rng, made = np.random.default_rng(seed), dict.fromkeys(ITERATIONS, 0)
    plan = []
    for session, keys in enumerate(dealt):
        for place, index in enumerate(rng.permutation(len(keys))):
            key = keys[index]
            plan.append(_planned(key, made[key], session, place))
            made[key] += 1
    return tuple(plan)


def _planned(key: tuple[str, str], iteration: int, session: int, place: int) -> PlannedGrasp:
    name = f"s{session}_{place:02d}_{key[0]}_{key[1]}_{iteration}"
    return PlannedGrasp(name, key[0], key[1], iteration, session)
