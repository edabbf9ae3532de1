"""The soft layer over the electrodes as uncoupled springs (Winkler 1867): taxel forces from the wrench on a board.

A rigid-body engine computes the net wrench on a board, not its distribution. Here taxel i carries
f_i = k max(0, -separation_i) along its normal. The board rests at the approach and the two tilts at which these forces
sum to the net force and to the two moments about the centre of pressure. Wrench and normals are expressed in the
board's own frame, which the small tilts rotate as a whole.

Separations are exact: after each solution of the problem linearised in the small motion, the board is moved and the
rays along its normals are cast again, until the board no longer moves.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import Sheet
from taxel.sim.board_contacts import TILT_ARM_M, BoardContacts, find_board_contacts
from taxel.sim.equilibrium import Springs, solve_rest_positions
from taxel.sim.separation import compute_separations
from taxel.types import FloatArray

__all__ = ["MAX_TILT_RAD", "STIFFNESS_N_PER_M", "LayerLoads", "LayerResult", "SettledBoards", "press_layer"]

STIFFNESS_N_PER_M = 1450.0
"""Stiffness of the layer under an area of 25 mm2 (one taxel at a pitch of 5 mm), N/m: fitted to a block that is pressed
into the emulated skin, over the range of forces of one taxel in the grasps. Source: tools/sim/fit_stiffness.py. Taxel
force and indentation depth follow from this value; the net force on a board does not.
"""

MAX_TILT_RAD = np.radians(5.0)
"""Bound of either tilt, radians: about the compliance of joints and brackets, and small enough that the same taxels
stay near the object (chosen). A larger bound lets a board follow a moment that its taxels cannot bear.
"""

MAX_CASTS = 10
"""Upper limit of linearisations for each board."""

REST_MOTION_M = 1e-7
"""A board that moves less is at rest, metres; each further step is about ten times shorter than the one before."""

RATIO_RANGE = (0.25, 4.0)
"""Bounds of the ratio between the shortening of a taxel's ray and the approach of the board (`_linearise`)."""


@dataclass(frozen=True, eq=False)
class LayerLoads:
    """Poses and wrenches of the boards in T frames, checked: s boards.

    sensor_poses: f64[T, s, 4, 4], brackets in the world. object_poses: f64[T, 4, 4]. wrench: f64[T, s, 6], force (N)
    and moment (Nm, about the bracket's origin) on the board, bracket frame. Raises ValueError for other shapes and for
    numbers that are not finite.
    """

    hand: Hand | Sheet
    sensor_poses: FloatArray
    object_poses: FloatArray
    wrench: FloatArray

    def __post_init__(self) -> None:
        """Check the shapes of poses and wrenches, and that all wrenches are finite; raise ValueError."""
        poses, objects, wrench = self.sensor_poses, self.object_poses, self.wrench
        frames, sensors = len(objects), len(self.hand.boards)
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


@dataclass(frozen=True, eq=False)
class SettledBoards:
    """Boards at rest on the layer: G boards with m bearing taxels.

    boards: their poses and taxels. force: f64[m], newtons. indentation: f64[m], metres, 0 or negative: separation of a
    compressed taxel. approach: f64[G], metres. tilt: f64[G, 2], radians.
    """

    boards: BoardContacts
    force: FloatArray
    indentation: FloatArray
    approach: FloatArray
    tilt: FloatArray


@dataclass(frozen=True, eq=False)
class LayerResult:
    """Forces and separations under the wrenches of T frames, n taxels (or pieces of a sheet), s boards.

    Attributes:
        contact_force: f64[T, n], newtons along each taxel's normal, at least 0.
        separation: f64[T, n], metres, as `compute_separations`, of the boards at rest; below 0 only for a compressed
            taxel.
        force_residual_n: f64[T, s], net force of the taxels along the given force, minus the magnitude of that force.
            Zero up to rounding where at least one taxel can bear the force.
        moment_residual_nm: f64[T, s], magnitude of the unbalanced moment about the tilt axes.
        approach_m: f64[T, s], motion of the board against the force at the centre of pressure.
        tilt_rad: f64[T, s, 2], about the two axes perpendicular to the force.
        rest_poses: f64[T, s, 4, 4], brackets in the world at rest on the layer.
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
    """Distribute the wrench on every board over its taxels.

    sensor_poses: f64[T, s, 4, 4], brackets of s boards in the world in T frames. object_poses: f64[T, 4, 4]. wrench:
    f64[T, s, 6], force (N) and moment (Nm, about the bracket's origin) on the board, bracket frame. stiffness_n_per_m:
    of the layer under 25 mm2. max_tilt_rad: bound of either tilt.

    If the moments require a larger tilt (the force passes outside the taxels that can bear it), the board rests at the
    bound and the residual states the unbalanced moment; the net force is kept. A board without force has no compressed
    taxel. Raises ValueError for arrays of other shapes, and the errors of `compute_separations`.
    """
    loads = make_loads(hand, sensor_poses, object_poses, wrench)
    boards = find_board_contacts(hand, shape, loads.sensor_poses, loads.object_poses, loads.wrench)
    settled = SettledBoards(boards, np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 2)))
    if len(boards.frame):
        settled = settle_boards(hand, shape, boards, stiffness_n_per_m, max_tilt_rad)
    return assemble_result(shape, loads, settled)


def make_loads(
    hand: Hand | Sheet, sensor_poses: npt.ArrayLike, object_poses: npt.ArrayLike, wrench: npt.ArrayLike
) -> LayerLoads:
    """Convert the arguments of `press_layer` to float64 arrays. Raises ValueError as `LayerLoads`."""
    poses, objects, loads = (np.asarray(values, dtype=np.float64) for values in (sensor_poses, object_poses, wrench))
    return LayerLoads(hand, poses, objects, loads)


def settle_boards(
    hand: Hand | Sheet, shape: Shape, boards: BoardContacts, stiffness: float, max_tilt_rad: float
) -> SettledBoards:
    """Move the loaded boards to their rest positions on the uncoupled springs of their taxels.

    stiffness: of the layer under 25 mm2, N/m. max_tilt_rad: bound of either tilt. The separations are linearised at
    most `MAX_CASTS` times; a board that still moves then is returned at its last position.
    """
    travel = np.zeros((len(boards.frame), 3))
    bound = max_tilt_rad * TILT_ARM_M
    force, pose, centre = np.zeros(len(boards.taxel)), boards.pose.copy(), boards.centre.copy()
    moving_boards, moved = np.arange(len(travel)), boards
    for _ in range(MAX_CASTS):
        gap, gap_gradient = moved.cast_rays(hand, shape)
        of_springs = stiffness * hand.area_share[moved.taxel]
        springs = _linearise(moved, gap, gap_gradient, of_springs, bound, travel[moving_boards, 1:])
        x = solve_rest_positions(springs)  # approach and two tilts of each board; a tilt is multiplied by TILT_ARM_M
        force[np.isin(boards.group, moving_boards)] = springs.stiffness * springs.compute_compression(x)
        moved = moved.move(x)
        pose[moving_boards], centre[moving_boards] = moved.pose, moved.centre
        travel[moving_boards] += x
        is_moving = np.abs(x).max(axis=1) > REST_MOTION_M
        moving_boards, moved = moving_boards[is_moving], moved.select(is_moving)
        if not len(moving_boards):
            break
    at_rest = replace(boards, pose=pose, centre=centre)
    indentation = -force / (stiffness * hand.area_share[boards.taxel])
    return SettledBoards(at_rest, force, indentation, travel[:, 0], travel[:, 1:] / TILT_ARM_M)


def _linearise(
    boards: BoardContacts,
    gap: FloatArray,
    gap_gradient: FloatArray,
    stiffness: FloatArray,
    bound: float,
    tilt: FloatArray,
) -> Springs:
    """Build the springs of the problem that is linearised at the present positions of G boards with m taxels.

    gap f64[m] and its gradient f64[m, 3]: see `BoardContacts.cast_rays`. stiffness: f64[m], N/m. bound: largest tilt,
    metres. tilt: f64[G, 2], present tilts, metres. A ray that meets the surface at an angle shortens faster than the
    board approaches. One ratio of both rates for each taxel keeps the problem convex; the error of this approximation
    vanishes as the board comes to rest.
    """
    ratio = -np.sum(gap_gradient * boards.rows, axis=1) / np.sum(boards.rows**2, axis=1)
    ratio = np.where(gap_gradient.any(axis=1), np.clip(ratio, *RATIO_RANGE), 1.0)
    load = boards.force_n[:, None] * np.array([1.0, 0.0, 0.0])
    return Springs(boards.group, boards.rows, gap / ratio, stiffness * ratio, load, -bound - tilt, bound - tilt)


def assemble_result(shape: Shape, loads: LayerLoads, settled: SettledBoards) -> LayerResult:
    """Combine the settled boards into the result for all frames and boards.

    A board without load keeps its pose, has no taxel forces, and its force residual is minus the given force.
    """
    boards, hand = settled.boards, loads.hand
    frames, sensors = loads.wrench.shape[:2]
    bearing_taxels = boards.frame[boards.group], boards.taxel
    contact_force = np.zeros((frames, hand.n_taxels))
    contact_force[bearing_taxels] = settled.force
    rest_poses = loads.sensor_poses.copy()
    rest_poses[boards.frame, boards.board] = loads.object_poses[boards.frame] @ boards.pose
    separation = np.maximum(compute_separations(hand, shape, rest_poses, loads.object_poses), 0.0)
    is_compressed = settled.indentation < 0
    separation[bearing_taxels] = np.where(is_compressed, settled.indentation, separation[bearing_taxels])
    # Sums over the taxels of each board: forces along the given force, and moments about the tilt axes / TILT_ARM_M.
    balance = np.zeros((len(boards.frame), 3))
    for i in range(3):
        balance[:, i] = np.bincount(boards.group, settled.force * boards.rows[:, i], len(boards.frame))
    loaded_boards = boards.frame, boards.board
    force_residual = -np.linalg.norm(loads.wrench[..., :3], axis=-1)
    force_residual[loaded_boards] += balance[:, 0]
    moment_residual, approach = np.zeros((frames, sensors)), np.zeros((frames, sensors))
    moment_residual[loaded_boards] = TILT_ARM_M * np.linalg.norm(balance[:, 1:], axis=1)
    approach[loaded_boards] = settled.approach
    tilt = np.zeros((frames, sensors, 2))
    tilt[loaded_boards] = settled.tilt
    return LayerResult(contact_force, separation, force_residual, moment_residual, approach, tilt, rest_poses)
