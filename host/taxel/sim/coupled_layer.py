"""The soft layer with cells that pull at each other: a press spreads to neighbours that the object does not touch.

The cells of a board are springs to the electrodes, joined by a membrane: (1 + (decay / pitch)^2 L) k d = f, with
the depths d, the object's forces f and the Laplacian L of the board's grid (Filonenko-Borodich 1940, discretised). What
an electrode feels is k d: the sum over the board is that of f, but it reaches beyond the contact and falls off over
`decay`. Where the object touches, the depth is the object's and f is not negative; elsewhere f is zero. Which cells
touch is an active set.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.sim.layer import MAX_TILT_RAD, STIFFNESS_N_PER_M, LayerResult, checked, press_layer, report, settle
from taxel.sim.touching import TILT_ARM_M, Touching, touching_boards
from taxel.types import BoolArray, FloatArray

__all__ = ["DECAY_M", "press_coupled_layer"]


DECAY_M = 0.003
"""Length over which a press falls off in the layer, metres. Assumed: a few times its thickness."""

CASTS = 3
MAX_CHANGES = 30
"""Of the active set; then the tilts stay where they are, and after as many again the last set is taken."""

FAR_M = 1.0
"""Gap of a cell that cannot touch."""

UNOPPOSED = 1e-6
"""A tilt with less than this share of the largest stiffness is left as it is."""


def press_coupled_layer(
    hand: Hand,
    shape: Shape,
    sensor_poses: npt.ArrayLike,
    object_poses: npt.ArrayLike,
    wrench: npt.ArrayLike,
    stiffness_n_per_m: float = STIFFNESS_N_PER_M,
    max_tilt_rad: float = MAX_TILT_RAD,
    decay_m: float = DECAY_M,
) -> LayerResult:
    """As `press_layer`, with coupled cells; it starts where the uncoupled layer rests.

    decay_m: above or equal 0, metres. `contact_force` is what the electrodes feel. `separation` is below 0 only where
    the object touches; a taxel beside it has a force and a separation of at least 0.
    """
    poses, objects = np.asarray(sensor_poses, dtype=np.float64), np.asarray(object_poses, dtype=np.float64)
    loads = checked(hand, poses, objects, np.asarray(wrench, dtype=np.float64))
    boards = touching_boards(hand, shape, poses, objects, loads)
    if not len(boards.frame):
        return press_layer(hand, shape, poses, objects, loads)
    rest, _, approach, tilt = settle(hand, shape, boards, stiffness_n_per_m, max_tilt_rad)
    travel = np.column_stack([approach, tilt * TILT_ARM_M])
    every = boards.with_all_taxels(hand)
    bears = np.isin(every.group * hand.n_taxels + every.taxel, boards.group * hand.n_taxels + boards.taxel)
    every = replace(every, pose=rest.pose.copy(), centre=rest.centre.copy())
    force, pressed = np.zeros(len(every.taxel)), np.zeros(len(every.taxel))
    for index, board in enumerate(hand.boards):
        mine = every.board == index
        if mine.any():
            own = mine[every.group]
            yields = _yields(hand, board.address, decay_m)
            result = _settle_board(
                hand, shape, every.take(mine), bears[own], stiffness_n_per_m, yields, travel[mine], max_tilt_rad
            )
            every.pose[mine], force[own], pressed[own], travel[mine] = result
    moves = travel[:, 0], travel[:, 1:] / TILT_ARM_M
    return report(hand, shape, poses, objects, loads, every, force, pressed, *moves)


def _yields(hand: Hand, address: int, decay_m: float) -> FloatArray:
    """Inverse of 1 + (decay / pitch)^2 L over the cells of one board, f64[c, c].

    Neighbours share a line and are one apart on the other.
    """
    own = hand.get_slice(address)
    steps = [np.abs(np.subtract.outer(line, line)) for line in (hand.tx[own].astype(int), hand.rx[own].astype(int))]
    joined = (steps[0] + steps[1] == 1).astype(np.float64)
    laplacian = np.diag(joined.sum(axis=1)) - joined
    return np.asarray(np.linalg.inv(np.eye(len(joined)) + (decay_m / hand.pitch_m) ** 2 * laplacian), np.float64)


def _settle_board(
    hand: Hand,
    shape: Shape,
    board: Touching,
    bears: BoolArray,
    stiffness: float,
    yields: FloatArray,
    travel: FloatArray,
    max_tilt_rad: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """One board in all its frames: pose f64[G, 4, 4], force f64[m], pressed f64[m], travel f64[G, 3].

    yields: depths that forces of one newton over one newton per metre make, f64[c, c].
    """
    frames, cells = len(board.frame), len(yields)
    rows = board.rows.reshape(frames, cells, 3)
    bound = max_tilt_rad * TILT_ARM_M
    depth, active = np.zeros((frames, cells)), np.zeros((frames, cells), dtype=bool)
    for _ in range(CASTS):
        gap, change = board.cast(hand, shape)
        gap = np.where(bears, gap, FAR_M).reshape(frames, cells)
        problem = _Problem(yields, gap, change.reshape(frames, cells, 3), rows, board.force_n / stiffness, bound)
        depth, active, x = problem.rest(travel)
        board, travel = board.moved(x), travel + x
    return board.pose, stiffness * depth.ravel(), np.where(active, -depth, 0.0).ravel(), travel


@dataclass(frozen=True, eq=False)
class _Problem:
    """The linear problem of one board in G frames at one position; forces are newtons over the cells' stiffness.

    yields: f64[c, c]. gap: f64[G, c]. change: f64[G, c, 3]. rows: f64[G, c, 3]. load: f64[G]. bound: of a tilt, metres.
    """

    yields: FloatArray
    gap: FloatArray
    change: FloatArray
    rows: FloatArray
    load: FloatArray
    bound: float

    def rest(self, travel: FloatArray) -> tuple[FloatArray, BoolArray, FloatArray]:
        """Depths f64[G, c], touching cells bool[G, c] and motion f64[G, 3]; travel: the motion so far, f64[G, 3]."""
        active, held = self.gap < 0, np.zeros(len(self.gap), dtype=bool)
        active[np.arange(len(active)), self.gap.argmin(axis=1)] = True  # one cell at least bears the load
        depth, x = np.zeros_like(self.gap), np.zeros_like(travel)
        for turn in range(2 * MAX_CHANGES):
            depth, force, x = self._balance(active, held, travel)
            reached = depth + self.gap + np.sum(self.change * x[:, None], axis=2) < 0
            touching: BoolArray = np.asarray(np.where(active, force > 0, reached), dtype=np.bool_)
            changed: BoolArray = np.logical_or.reduce(touching != active, axis=1)
            if not changed.any():
                break
            held |= changed & (turn >= MAX_CHANGES)
            active = np.where(touching.any(axis=1, keepdims=True), touching, active)
        return np.maximum(depth, 0.0), active, x

    def _balance(
        self, active: BoolArray, held: BoolArray, travel: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Depths f64[G, c], forces f64[G, c] and motion f64[G, 3] at which these cells touch and the board rests."""
        frames = np.arange(len(active))[:, None]
        cell = np.argsort(~active, axis=1, kind="stable")[:, : active.sum(axis=1).max()]
        used = active[frames, cell]
        pairs = used[:, :, None] & used[:, None, :]
        system = np.where(pairs, self.yields[cell[:, :, None], cell[:, None, :]], np.eye(cell.shape[1]))
        depths = -np.concatenate([self.gap[frames, cell][:, :, None], self.change[frames, cell]], axis=2)
        forces = np.linalg.solve(system, np.where(used[:, :, None], depths, 0.0))
        solved = np.einsum("gac,gai->gci", self.yields[cell], forces)
        bend = np.einsum("gci,gcj->gij", self.rows, solved[:, :, 1:])
        lack = -np.einsum("gci,gc->gi", self.rows, solved[:, :, 0])
        lack[:, 0] += self.load
        x = np.einsum("gij,gj->gi", np.linalg.pinv(bend, rcond=UNOPPOSED), lack)
        x[:, 1:] = np.clip(x[:, 1:], -self.bound - travel[:, 1:], self.bound - travel[:, 1:])
        x[held, 1:] = 0.0
        x[:, 0] = (lack[:, 0] - np.sum(bend[:, 0, 1:] * x[:, 1:], axis=1)) / bend[:, 0, 0]
        force = np.zeros_like(self.gap)
        np.put_along_axis(force, cell, forces[:, :, 0] + np.einsum("gai,gi->ga", forces[:, :, 1:], x), axis=1)
        return solved[:, :, 0] + np.einsum("gci,gi->gc", solved[:, :, 1:], x), force, x
