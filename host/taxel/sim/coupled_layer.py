"""The soft layer as springs that a membrane couples: an indentation spreads to taxels that the object does not touch.

The springs of a board stand at the nodes of its grid of electrodes. The depths d solve (1 + (decay / pitch)^2 L) k d =
f, with the stiffness k of a spring, the forces f of the object and the Laplacian L of the grid (Filonenko-Borodich
1940, discretised). An electrode senses k d. The sum of k d over the board equals the sum of f, but k d extends beyond
the contact and decays over the length `decay`. At a touching node the depth follows from the object's surface and f is
at least 0; at any other node f is 0. The touching nodes are found as an active set.
"""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.sim.board_contacts import TILT_ARM_M, BoardContacts, find_board_contacts
from taxel.sim.layer import (
    MAX_TILT_RAD,
    STIFFNESS_N_PER_M,
    LayerResult,
    SettledBoards,
    assemble_result,
    make_loads,
    press_layer,
    settle_boards,
)
from taxel.types import BoolArray, FloatArray

__all__ = ["DECAY_M", "press_coupled_layer"]


DECAY_M = 0.003
"""Decay length of an indentation in the layer, metres. Assumed: a few times the thickness of the layer. A larger value
spreads the same force over more taxels.
"""

MAX_CASTS = 3
"""Number of linearisations for each board."""

MAX_CHANGES = 30
"""Changes of the active set after which the tilts are fixed; after twice as many the last active set is kept."""

MISS_GAP_M = 1.0
"""Gap of a node that cannot touch, metres."""

MIN_STIFFNESS_RATIO = 1e-6
"""A tilt with less stiffness than this fraction of the largest stiffness is not moved."""


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
    """Distribute the wrench on every board over its taxels as `press_layer`, but with springs that a membrane couples.

    decay_m: decay length of an indentation, at least 0, metres. In the result, `contact_force` is the force that the
    electrodes sense, and `separation` is below 0 only where the object touches; a taxel beside the contact can have a
    force with a separation of at least 0. The iteration starts at the rest position of the uncoupled layer.
    """
    loads = make_loads(hand, sensor_poses, object_poses, wrench)
    boards = find_board_contacts(hand, shape, loads.sensor_poses, loads.object_poses, loads.wrench)
    if not len(boards.frame):
        return press_layer(hand, shape, loads.sensor_poses, loads.object_poses, loads.wrench)
    uncoupled = settle_boards(hand, shape, boards, stiffness_n_per_m, max_tilt_rad)
    travel = np.column_stack([uncoupled.approach, uncoupled.tilt * TILT_ARM_M])
    nodes = boards.with_all_taxels(hand)
    bears = np.isin(nodes.group * hand.n_taxels + nodes.taxel, boards.group * hand.n_taxels + boards.taxel)
    nodes = replace(nodes, pose=uncoupled.boards.pose.copy(), centre=uncoupled.boards.centre.copy())
    force, indentation = np.zeros(len(nodes.taxel)), np.zeros(len(nodes.taxel))
    for index, board in enumerate(hand.boards):
        frames = nodes.board == index
        if frames.any():
            of_board = frames[nodes.group]
            compliance = _compute_compliance(hand, board.address, decay_m)
            # One stiffness for each board: the membrane couples springs of equal stiffness.
            stiffness = stiffness_n_per_m * float(hand.area_share[hand.get_slice(board.address)].mean())
            layer = _BoardLayer(hand, shape, stiffness, compliance, max_tilt_rad * TILT_ARM_M)
            result = layer.settle(nodes.select(frames), bears[of_board], travel[frames])
            nodes.pose[frames], force[of_board], indentation[of_board], travel[frames] = result
    settled = SettledBoards(nodes, force, indentation, travel[:, 0], travel[:, 1:] / TILT_ARM_M)
    return assemble_result(shape, loads, settled)


def _compute_compliance(hand: Hand, address: int, decay_m: float) -> FloatArray:
    """Compute the inverse of 1 + decay^2 L over the c nodes of one board, f64[c, c]; L: Laplacian of the node grid.

    Two nodes are neighbours if they are adjacent in a row or a column of the unrolled sheet; their weight in L follows
    from their distance.
    """
    of_board = hand.get_slice(address)
    steps = [np.abs(np.subtract.outer(line, line)) for line in (hand.row[of_board], hand.column[of_board])]
    differences = hand.position[of_board][:, None] - hand.position[of_board]
    weight = np.zeros((len(differences), len(differences)))
    is_neighbour = steps[0] + steps[1] == 1
    weight[is_neighbour] = (decay_m / np.linalg.norm(differences[is_neighbour], axis=1)) ** 2
    laplacian = np.diag(weight.sum(axis=1)) - weight
    return np.asarray(np.linalg.inv(np.eye(len(weight)) + laplacian), np.float64)


@dataclass(frozen=True, eq=False)
class _BoardLayer:
    """The coupled elastic layer of one board with c nodes, one for each taxel.

    stiffness: of one spring, N/m. compliance: f64[c, c], depths under unit forces with unit stiffness. tilt_bound: of
    either tilt, metres.
    """

    hand: Hand
    shape: Shape
    stiffness: float
    compliance: FloatArray
    tilt_bound: float

    def settle(
        self, board: BoardContacts, bears: BoolArray, travel: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Find the rest state of one board on its coupled layer in G frames.

        bears: bool[m], nodes that can touch the object. travel: f64[G, 3], motion up to now (approach and two tilts,
        metres). Returns pose f64[G, 4, 4], force f64[m], indentation f64[m] and travel f64[G, 3].
        """
        frames, nodes = len(board.frame), len(self.compliance)
        rows = board.rows.reshape(frames, nodes, 3)
        load = board.force_n / self.stiffness
        depth, active = np.zeros((frames, nodes)), np.zeros((frames, nodes), dtype=bool)
        for _ in range(MAX_CASTS):
            gap, gap_gradient = board.cast_rays(self.hand, self.shape)
            gap = np.where(bears, gap, MISS_GAP_M).reshape(frames, nodes)
            gradient = gap_gradient.reshape(frames, nodes, 3)
            problem = _Problem(self.compliance, gap, gradient, rows, load, self.tilt_bound)
            depth, active, x = problem.solve(travel)
            board, travel = board.move(x), travel + x
        return board.pose, self.stiffness * depth.ravel(), np.where(active, -depth, 0.0).ravel(), travel


@dataclass(frozen=True, eq=False)
class _Problem:
    """The linearised equilibrium problem of one board with c nodes in G frames.

    Forces are divided by the stiffness of a spring. compliance: f64[c, c], depth of node i under a unit force on node
    j. gap: f64[G, c], separation of each node from the object. gap_gradient: f64[G, c, 3], derivative of the gap with
    respect to the motion of the board (approach and two tilts). rows: f64[G, c, 3], force along the approach and
    moments about the tilt axes of a unit force on each node. load: f64[G], force on the board. tilt_bound: bound of
    either tilt, metres.
    """

    compliance: FloatArray
    gap: FloatArray
    gap_gradient: FloatArray
    rows: FloatArray
    load: FloatArray
    tilt_bound: float

    def solve(self, travel: FloatArray) -> tuple[FloatArray, BoolArray, FloatArray]:
        """Find the equilibrium of one board in G frames: depths f64[G, c], touching nodes bool[G, c], motion f64[G, 3].

        motion: approach and two tilts that lead to the equilibrium, metres. travel: f64[G, 3], motion before this call.
        The set of touching nodes is changed until no node is pulled and no node penetrates the object. A frame whose
        set still changes after `MAX_CHANGES` steps keeps its tilt from then on.
        """
        active, fixed_tilt = self.gap < 0, np.zeros(len(self.gap), dtype=bool)
        active[np.arange(len(active)), self.gap.argmin(axis=1)] = True  # at least one node bears the load
        depth, x = np.zeros_like(self.gap), np.zeros_like(travel)
        for change_count in range(2 * MAX_CHANGES):
            depth, force, x = self._balance(active, fixed_tilt, travel)
            is_reached = depth + self.gap + np.sum(self.gap_gradient * x[:, None], axis=2) < 0
            touching: BoolArray = np.asarray(np.where(active, force > 0, is_reached), dtype=np.bool_)
            has_changed: BoolArray = np.logical_or.reduce(touching != active, axis=1)
            if not has_changed.any():
                break
            fixed_tilt |= has_changed & (change_count >= MAX_CHANGES)
            active = np.where(touching.any(axis=1, keepdims=True), touching, active)
        return np.maximum(depth, 0.0), active, x

    def _balance(
        self, active: BoolArray, fixed_tilt: BoolArray, travel: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Compute the equilibrium for given touching nodes: depths f64[G, c], forces f64[G, c] and motion f64[G, 3].

        active: bool[G, c], touching nodes. fixed_tilt: bool[G], boards whose tilts are not moved. travel: f64[G, 3],
        motion up to now. Depths and forces are linear in the motion x: their first column in the code is the value for
        x = 0, the other three columns are the derivatives.
        """
        frames = np.arange(len(active))[:, None]
        node = np.argsort(~active, axis=1, kind="stable")[:, : active.sum(axis=1).max()]
        is_used = active[frames, node]
        pairs = is_used[:, :, None] & is_used[:, None, :]
        system = np.where(pairs, self.compliance[node[:, :, None], node[:, None, :]], np.eye(node.shape[1]))
        imposed_depths = -np.concatenate([self.gap[frames, node][:, :, None], self.gap_gradient[frames, node]], axis=2)
        forces = np.linalg.solve(system, np.where(is_used[:, :, None], imposed_depths, 0.0))
        depths = np.einsum("gac,gai->gci", self.compliance[node], forces)
        board_stiffness = np.einsum("gci,gcj->gij", self.rows, depths[:, :, 1:])
        unbalanced = -np.einsum("gci,gc->gi", self.rows, depths[:, :, 0])
        unbalanced[:, 0] += self.load
        x = np.einsum("gij,gj->gi", np.linalg.pinv(board_stiffness, rcond=MIN_STIFFNESS_RATIO), unbalanced)
        x[:, 1:] = np.clip(x[:, 1:], -self.tilt_bound - travel[:, 1:], self.tilt_bound - travel[:, 1:])
        x[fixed_tilt, 1:] = 0.0
        remainder = unbalanced[:, 0] - np.sum(board_stiffness[:, 0, 1:] * x[:, 1:], axis=1)
        # Where no node faces the object, a motion of the board changes no force.
        x[:, 0] = np.divide(
            remainder, board_stiffness[:, 0, 0], out=np.zeros_like(remainder), where=board_stiffness[:, 0, 0] > 0.0
        )
        force = np.zeros_like(self.gap)
        np.put_along_axis(force, node, forces[:, :, 0] + np.einsum("gai,gi->ga", forces[:, :, 1:], x), axis=1)
        return depths[:, :, 0] + np.einsum("gci,gi->gc", depths[:, :, 1:], x), force, x
