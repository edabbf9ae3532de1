"""Grasp plan of the thesis: fifteen approaches to three objects, 144 grasps in six sessions (Table 5.1)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.grasp.objects import ASSUMED_SIZES, GraspObject, make_thesis_objects
from taxel.hand import Hand, load_hand
from taxel.types import FloatArray

PALM_BOARD: Final = "palm"  # board of the hand "allegro" whose dielectric touches the object

# Number of repetitions of each approach, Table 5.1 of the thesis.
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
class PalmPlacement:
    """Placement of the palm at a face, an edge or the top of an object; parameters of an approach.

    Attributes:
        azimuth_rad: direction from the object's axis to the palm, about z from x; on top: direction of the fingers.
        edge_z_m: largest coordinate of the object along the palm's z axis, towards the fingertips.
        thumb_rad: angles of th_j0 and th_j1, which are held.
        axis_y_m: coordinate of the object's centre (on its vertical axis, at half height) along the palm's y axis.
        spread_rad: angle between index or little finger and the middle finger, held.
        indentation_m: displacement of the palm past first contact with the nominal object (object and skin yield).
        top: whether the palm faces down on the top face.
    """

    azimuth_rad: float
    edge_z_m: float
    thumb_rad: tuple[float, float]
    axis_y_m: float = 0.0
    spread_rad: float = 0.0
    indentation_m: float = 0.0
    top: bool = False


# Selected from a grid of placements and displacements: those in which both solvers reach the same equilibrium. On a
# side face, palm, fingers and thumb carry load. On the top, palm and thumb carry load and the fingers close beyond the
# object, because without friction they slide off a vertical face near its upper edge.
_BOX_WIDE = PalmPlacement(0.0, edge_z_m=0.045, thumb_rad=(1.20, 0.30), indentation_m=0.0012)
_BOX_NARROW = PalmPlacement(0.0, edge_z_m=0.005, thumb_rad=(1.20, 0.30), indentation_m=0.002)
_BOX_EDGE = PalmPlacement(0.0, edge_z_m=0.025, thumb_rad=(1.20, 0.30), indentation_m=0.002)
_BOX_TOP = PalmPlacement(0.0, edge_z_m=-0.030, thumb_rad=(0.30, 0.50), indentation_m=0.002, top=True)
_CYLINDER = PalmPlacement(0.0, edge_z_m=0.015, thumb_rad=(1.30, 0.50), indentation_m=0.0012)
_CYLINDER_TOP = PalmPlacement(0.0, edge_z_m=-0.030, thumb_rad=(0.30, 0.50), indentation_m=0.002, top=True)
_PRISM = PalmPlacement(0.0, edge_z_m=0.0, thumb_rad=(0.90, 0.50), indentation_m=0.001)
_PRISM_TOP = PalmPlacement(0.0, edge_z_m=-0.030, thumb_rad=(0.90, 0.50), indentation_m=0.002, top=True)


def _set_azimuth(degrees: float, placement: PalmPlacement) -> PalmPlacement:
    """Return the placement of the palm with another direction from the object to the palm, degrees about z."""
    return replace(placement, azimuth_rad=float(np.deg2rad(degrees)))


PALM_PLACEMENTS: Final[dict[tuple[str, str], PalmPlacement]] = {
    ("rectangular_prism", "wide_side_1"): _set_azimuth(90, _BOX_WIDE),
    ("rectangular_prism", "narrow_side_1"): _set_azimuth(0, _BOX_NARROW),
    ("rectangular_prism", "wide_side_2"): _set_azimuth(270, _BOX_WIDE),
    ("rectangular_prism", "narrow_side_2"): _set_azimuth(180, _BOX_NARROW),
    ("rectangular_prism", "top"): _set_azimuth(90, _BOX_TOP),
    ("rectangular_prism", "side_edge"): _set_azimuth(45, _BOX_EDGE),
    **{("cylinder", f"side_{k + 1}"): _set_azimuth(90 * k, _CYLINDER) for k in range(4)},
    ("cylinder", "top"): _set_azimuth(0, _CYLINDER_TOP),
    **{("triangular_prism", f"side_{k + 1}"): _set_azimuth(90 + 120 * k, _PRISM) for k in range(3)},
    ("triangular_prism", "top"): _set_azimuth(0, _PRISM_TOP),
}

# Nm, of joints 1, 2 and 3 of a finger and of joints 2 and 3 of the thumb; equal for all objects, as in the thesis.
# Tuned for finger forces of 3 to 12 N.
FINGER_TORQUE_NM: Final = (0.31, 0.27, 0.105)
THUMB_TORQUE_NM: Final = (0.38, 0.155)
OPEN_RAD: Final = -0.1  # open angle of the closing joints, slightly extended, within their ranges
FINGERS: Final = 3


@dataclass(frozen=True, eq=False)
class Approach:
    """Palm pose, joint targets and torques of a grasp. Joints are in the order of the hand.

    Attributes:
        object: name of the object.
        name: such as "wide_side_1".
        palm_pose: pose of the palm link in the object frame during the grasp, f64[4, 4].
        open_angles: joint angles before closing and after release, f64[j], radians.
        base_targets: target angles of the held joints, f64[j], radians; NaN for closing joints.
        torque: torques of the closing joints, f64[j], Nm; 0 for held joints.
        withdraw_m: distance of the palm from its grasp position, along its -x axis, in baseline and recovery (the
            thesis takes the baseline before the arm approaches the object, section 5.4); 0: no motion.
    """

    object: str
    name: str
    palm_pose: FloatArray
    open_angles: FloatArray
    base_targets: FloatArray
    torque: FloatArray
    withdraw_m: float = 0.0

    @cached_property
    def is_held(self) -> npt.NDArray[np.bool_]:
        """Whether each joint is held at its angle during the grasp, instead of pressing with a torque; bool[j]."""
        return np.isfinite(self.base_targets)

    def compute_palm_pose_at(self, withdrawal: float) -> FloatArray:
        """Compute the pose of the palm link in the object frame, f64[4, 4], for a withdrawal of 0 (grasp) to 1."""
        result = self.palm_pose.copy()
        result[:3, 3] -= withdrawal * self.withdraw_m * result[:3, 0]
        return result


@dataclass(frozen=True, eq=False)
class PlannedGrasp:
    """One grasp of the plan.

    id: unique and sortable by time, such as "s1_07_cylinder_side_2_1". object, approach: names. iteration: number of
    earlier grasps of this approach. session: 0..sessions - 1.
    """

    id: str
    object: str
    approach: str
    iteration: int
    session: int


def compute_palm_surface_m(hand: Hand) -> float:
    """Compute the x coordinate of the palm surface (electrodes plus dielectric) in the palm link frame, metres.

    Raises ValueError if the hand description has no pose of the palm board.
    """
    board = hand.find_board(PALM_BOARD)
    if board.pose is None:
        raise ValueError(
            f"hand {hand.name!r}: expected a bracket pose of the palm board, found none; add it to the description"
        )
    electrodes = hand.position[hand.get_slice(board.address)] @ board.pose[:3, :3].T + board.pose[:3, 3]
    return float(electrodes[:, 0].max()) + (hand.layer_m or 0.0)


def compute_palm_pose(item: GraspObject, placement: PalmPlacement, surface_m: float, gap_m: float = 0.0) -> FloatArray:
    """Compute the pose of the palm link in the object frame, f64[4, 4], for a placement of the palm on an object.

    The origin of the object frame is the centre of the object's base, z up. The palm's x axis points to the object. On
    a side face the palm's y axis points up, so that the fingers close horizontally; on top the fingers point along the
    azimuth. surface_m: x coordinate of the palm surface in the palm link frame. gap_m: from the palm surface to the
    object. The placement states the azimuth of the palm, the coordinate of the object's centre (on the vertical axis,
    at half height) along the palm's y axis (`axis_y_m`), and the largest coordinate of the object along the palm's z
    axis (`edge_z_m`).
    """
    vertices = item.shape.mesh()[0]
    azimuth = np.array([np.cos(placement.azimuth_rad), np.sin(placement.azimuth_rad), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    result = np.eye(4)
    if placement.top:
        x, z = -up, azimuth
        y = np.cross(z, x)
        axis = np.zeros(3)  # the height of this point has no influence, because the palm's y and z are horizontal
    else:
        x, y = -azimuth, up
        z = np.cross(x, y)
        axis = up * item.shape.height / 2
    outward = -x
    extent = float(((vertices - axis) @ outward).max())
    axis_z = placement.edge_z_m - float(((vertices - axis) @ z).max())
    result[:3, :3] = np.column_stack([x, y, z])
    result[:3, 3] = axis + outward * (extent + surface_m + gap_m) - y * placement.axis_y_m - z * axis_z
    return result


def make_approach(
    item: GraspObject, name: str, placement: PalmPlacement, hand: Hand, gap_m: float = 0.0, withdraw_m: float = 0.0
) -> Approach:
    """Make the approach of the Allegro hand (palm pose, joint angles, torques) for a placement of the palm.

    item: object. name: of the approach. gap_m: distance from the palm surface to the object during the grasp, in
    addition to the placement's indentation. withdraw_m: distance of the palm from this position before and after the
    grasp. Rows of `base` and `torque`: three fingers and thumb, with four joints each; NaN in `base`: a joint that
    closes with its torque.
    """
    spread, (th_j0, th_j1) = placement.spread_rad, placement.thumb_rad
    base, torque = np.full((FINGERS + 1, 4), np.nan), np.zeros((FINGERS + 1, 4))
    base[:FINGERS, 0] = spread, 0.0, -spread
    base[FINGERS, :2] = th_j0, th_j1
    torque[:FINGERS, 1:] = FINGER_TORQUE_NM
    torque[FINGERS, 2:] = THUMB_TORQUE_NM
    return Approach(
        item.name,
        name,
        compute_palm_pose(item, placement, compute_palm_surface_m(hand), gap_m - placement.indentation_m),
        np.where(np.isfinite(base), base, OPEN_RAD).ravel(),
        base.ravel(),
        torque.ravel(),
        withdraw_m,
    )


def make_thesis_approaches(
    withdraw_m: float = 0.0,
    placements: Mapping[tuple[str, str], PalmPlacement] = PALM_PLACEMENTS,
    objects: Mapping[str, GraspObject] | None = None,
    hand: Hand | None = None,
    gap_m: float = 0.0,
) -> tuple[Approach, ...]:
    """Make the fifteen approaches of Table 5.1 of the thesis, in the order of the table.

    withdraw_m: distance of the withdrawn palm. placements: by object and approach; default: the placements selected for
    the assumed hand. objects: by name; None: the test objects in the assumed sizes. hand: None: the assumed hand
    `allegro`. gap_m: from the palm surface to the nominal object during the grasp.
    """
    objects, hand = objects or make_thesis_objects(ASSUMED_SIZES), hand or load_hand("allegro")
    return tuple(
        make_approach(objects[key[0]], key[1], placement, hand, gap_m, withdraw_m)
        for key, placement in placements.items()
    )


def make_thesis_plan(seed: int, sessions: int = SESSIONS) -> tuple[PlannedGrasp, ...]:
    """Make the plan of the 144 grasps of Table 5.1 of the thesis, in the order of execution.

    The grasps are distributed so that every session contains every approach, and the numbers of grasps of two sessions
    differ by at most one. The order within a session is sampled with `seed`. Raises ValueError for fewer than one
    session or more sessions than an approach has grasps.
    """
    if not 1 <= sessions <= min(ITERATIONS.values()):
        raise ValueError(f"sessions: expected 1 to {min(ITERATIONS.values())}, found {sessions}")
    keys_by_session: list[list[tuple[str, str]]] = [[] for _ in range(sessions)]
    for k, key in enumerate(key for key, count in ITERATIONS.items() for _ in range(count)):
        keys_by_session[k % sessions].append(key)
    rng, counts = np.random.default_rng(seed), dict.fromkeys(ITERATIONS, 0)
    plan = []
    for session, keys in enumerate(keys_by_session):
        for position, index in enumerate(rng.permutation(len(keys))):
            key = keys[index]
            plan.append(_make_planned_grasp(key, counts[key], session, position))
            counts[key] += 1
    return tuple(plan)


def _make_planned_grasp(key: tuple[str, str], iteration: int, session: int, position: int) -> PlannedGrasp:
    """Make a planned grasp with its id. key: (object, approach). position: place in the session's order, from 0."""
    name = f"s{session}_{position:02d}_{key[0]}_{key[1]}_{iteration}"
    return PlannedGrasp(name, key[0], key[1], iteration, session)
