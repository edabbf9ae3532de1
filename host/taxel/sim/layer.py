"""The soft layer over the electrodes as uncoupled springs (Winkler 1867): from a board's contact wrench to its taxels.

A rigid-body engine knows the net wrench on a board, not its spread. The layer spreads it: taxel i carries
f_i = k max(0, -separation_i) along its normal, and the board comes to rest at the approach and the two tilts at which
these forces make the net force and the two moments about the centre of pressure. The wrench and the normals are taken
in the board's own frame, which the small tilts turn together.

Separations are exact: after every solution of the problem that is linear in the small motion, the board is moved and
its rays are cast again, until it no longer moves.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import Sheet
from taxel.sim.equilibrium import Springs, rest_positions
from taxel.sim.separation import separations
from taxel.sim.touching import TILT_ARM_M, Touching, touching_boards
from taxel.types import FloatArray

__all__ = ["MAX_TILT_RAD", "STIFFNESS_N_PER_M", "LayerResult", "press_layer"]

STIFFNESS_N_PER_M = 1450.0
"""Of the layer under one taxel: what an experimenter finds who presses a block into the emulated skin, over the forces
that grasps put on a taxel. Source: tools/sim/fit_stiffness.py."""

MAX_TILT_RAD = np.radians(5.0)
"""Bound of either tilt: about what joints and brackets give way, and little enough that the same taxels stay near."""

MAX_CASTS = 10
STILL_M = 1e-7
"""A board that moves less is at rest, metres; every further step would be some ten times shorter."""


@dataclass(frozen=True, eq=False)
class LayerResult:
    """What the layer makes of the wrenches, T frames, n taxels (or pieces of sheet), s boards.

    Attributes:
        contact_force: f64[T, n], newtons along each taxel's normal, at least 0.
        separation: f64[T, n], metres, as `separations`, of the boards at rest; below 0 only where the taxel is pressed.
        force_residual_n: f64[T, s], net force of the taxels along the given force, less its magnitude. Zero up to
            rounding, but where no taxel can bear it.
        moment_residual_nm: f64[T, s], length of the moment about the tilts' axes that is left over.
        approach_m: f64[T, s], how far the board moved against the force at the centre of pressure.
        tilt_rad: f64[T, s, 2], about the two axes across the force.
        rest_poses: f64[T, s, 4, 4], the brackets where the layer rests, in the world.
    """

    contact_force: FloatArray
    separation: FloatArray
    force_residual_n: FloatArray
    moment_residual_nm: FloatArray
    approach_m: FloatArray
    tilt_rad: FloatArray
    rest_poses: FloatArray


def press_layer(
    hand: Hand | Sheet,
    shape: Shape,
    sensor_poses: npt.ArrayLike,
    object_poses: npt.ArrayLike,
    wrench: npt.ArrayLike,
    stiffness_n_per_m: float = STIFFNESS_N_PER_M,
    max_tilt_rad: float = MAX_TILT_RAD,
) -> LayerResult:
    """Spread the wrench on every board over its taxels.

    sensor_poses: brackets in the world, f64[T, s, 4, 4]. object_poses: f64[T, 4, 4]. wrench: f64[T, s, 6], force (N)
    and moment (Nm, about the bracket's origin) that act on the board, bracket frame. stiffness_n_per_m: of the layer
    under one taxel. max_tilt_rad: bound of either tilt.

    Where the moments ask for more tilt than that (the force passes beyond the taxels that can bear it), the board rests
    at the bound and the residual says what is missing; the net force is kept. A board without force bears nothing and
    is nowhere pressed in. Raises ValueError for shapes that do not fit, else as `separations`.
    """
    poses, objects = np.asarray(sensor_poses, dtype=np.float64), np.asarray(object_poses, dtype=np.float64)
    loads = checked(hand, poses, objects, np.asarray(wrench, dtype=np.float64))
    boards = touching_boards(hand, shape, poses, objects, loads)
    force, tilt, approach = np.zeros(0), np.zeros((0, 2)), np.zeros(0)
    moved = boards
    if len(boards.frame):
        moved, force, approach, tilt = settle(hand, shape, boards, stiffness_n_per_m, max_tilt_rad)
    pressed = -force / stiffness_n_per_m
    return report(hand, shape, poses, objects, loads, moved, force, pressed, approach, tilt)


def settle(
    hand: Hand | Sheet, shape: Shape, boards: Touching, stiffness: float, max_tilt_rad: float
) -> tuple[Touching, FloatArray, FloatArray, FloatArray]:
    """The boards at rest, taxel forces f64[m], approaches f64[G] and tilts f64[G, 2]."""
    travel = np.zeros((len(boards.frame), 3))
    bound = max_tilt_rad * TILT_ARM_M
    force, pose, centre = np.zeros(len(boards.taxel)), boards.pose.copy(), boards.centre.copy()
    left, now = np.arange(len(travel)), boards
    for _ in range(MAX_CASTS):
        springs = _springs(now, *now.cast(hand, shape), stiffness, bound, travel[left, 1:])
        x = rest_positions(springs)
        force[np.isin(boards.group, left)] = springs.stiffness * springs.pressing(x)
        now = now.moved(x)
        pose[left], centre[left] = now.pose, now.centre
        travel[left] += x
        moving = np.abs(x).max(axis=1) > STILL_M
        left, now = left[moving], now.take(moving)
        if not len(left):
            break
    return replace(boards, pose=pose, centre=centre), force, travel[:, 0], travel[:, 1:] / TILT_ARM_M


def _springs(
    boards: Touching, gap: FloatArray, change: FloatArray, stiffness: float, bound: float, tilt: FloatArray
) -> Springs:
    """The linear problem at the present position.

    A ray that meets the surface at an angle shortens faster than the board approaches. That ratio, taken as one number
    for each taxel, keeps the problem convex; what it leaves out vanishes as the board comes to rest.
    """
    ratio = -np.sum(change * boards.rows, axis=1) / np.sum(boards.rows**2, axis=1)
    ratio = np.where(change.any(axis=1), np.clip(ratio, 0.25, 4.0), 1.0)
    load = boards.force_n[:, None] * np.array([1.0, 0.0, 0.0])
    return Springs(boards.group, boards.rows, gap / ratio, stiffness * ratio, load, -bound - tilt, bound - tilt)


def report(
    hand: Hand | Sheet,
    shape: Shape,
    sensor_poses: FloatArray,
    object_poses: FloatArray,
    wrench: FloatArray,
    boards: Touching,
    force: FloatArray,
    pressed: FloatArray,
    approach: FloatArray,
    tilt: FloatArray,
) -> LayerResult:
    """The result for all frames from that of the boards at rest; force, pressed: f64[m], the bearing taxels'."""
    frames, sensors = wrench.shape[:2]
    where = boards.frame[boards.group], boards.taxel
    contact_force = np.zeros((frames, hand.n_taxels))
    contact_force[where] = force
    at_rest = sensor_poses.copy()
    at_rest[boards.frame, boards.board] = object_poses[boards.frame] @ boards.pose
    separation = np.maximum(separations(hand, shape, at_rest, object_poses), 0.0)
    separation[where] = np.where(pressed < 0, pressed, separation[where])
    residual = np.zeros((len(boards.frame), 3))
    for i in range(3):
        residual[:, i] = np.bincount(boards.group, force * boards.rows[:, i], len(boards.frame))
    own = boards.frame, boards.board
    force_left, moment_left, moves = -np.linalg.norm(wrench[..., :3], axis=-1), np.zeros((frames, sensors)), []
    force_left[own] += residual[:, 0]
    moment_left[own] = TILT_ARM_M * np.linalg.norm(residual[:, 1:], axis=1)
    for values in (approach, tilt):
        moves.append(np.zeros((frames, sensors, *values.shape[1:])))
        moves[-1][own] = values
    return LayerResult(contact_force, separation, force_left, moment_left, moves[0], moves[1], at_rest)


def checked(hand: Hand | Sheet, poses: FloatArray, objects: FloatArray, wrench: FloatArray) -> FloatArray:
    """The wrench, f64[T, s, 6], once all shapes fit; raises ValueError."""
    frames, sensors = len(objects), len(hand.boards)
    if (poses.shape, objects.shape, wrench.shape) != (
        (frames, sensors, 4, 4),
        (frames, 4, 4),
        (frames, sensors, 6),
    ):
        raise ValueError(
            f"expected sensor_poses [T, {sensors}, 4, 4], object_poses [T, 4, 4] and wrench [T, {sensors}, 6], "
            f"found {poses.shape}, {objects.shape} and {wrench.shape}"
        )
    if not np.isfinite(wrench).all():
        raise ValueError("wrench: expected finite numbers, found a NaN or an infinity")
    return wrench
