"""Physical invariants of the grasps in a simulated dataset, for the file of any simulator.

A frame of a simulator is wrong if force appears without contact, if the object lies deeper in the skin than the layer
is thick, if the total force jumps, if force and separation contradict the force law of the other taxels, or if the
force changes while the hand holds still. Each violation names the grasp, the frame and the taxel.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import Phase
from taxel.types import BoolArray, FloatArray, IntArray

MIN_FORCE_N: Final = 0.05
"""Forces below this value are ignored, newtons: the smallest force that the skin detects is 0.06 N (thesis)."""

MAX_FORCE_RATIO: Final = 1.5
"""Largest total force in relation to the maximum of the hold; also the largest ratio to both neighbouring frames. A
controller that never commands more than the torque of the hold gives a larger force only in an impact.
"""

MAX_IMPACT_RATIO: Final = 4.0
"""Largest total force of a frame of the closing phase in relation to the maximum of the hold (chosen)."""

MAX_HOLD_CHANGE: Final = 0.1
"""Largest relative change of the total force from the first to the last third of the hold: an object at rest."""

MAX_LAW_RATIO: Final = 3.0
"""Largest ratio of a taxel's force to the range of forces that the dataset shows at its separation (chosen)."""

LAW_QUANTILE: Final = 0.001
"""Quantile of the forces at a separation that is the lower end of their permitted range; the upper end is 1 minus this
value. Origin: wrong frames are rarer than this share.
"""

LAW_BIN_M: Final = 0.1e-3
"""Width of the depth intervals (bins) in which the range of forces is determined, metres."""

MIN_BIN_SAMPLES: Final = 50
"""Smallest number of forces in a depth interval for which the interval is used."""

TAXEL_REACH_PITCHES: Final = 0.71
"""Half the diagonal of a taxel in pitches: the object may touch the corner of a taxel whose centre is as far away."""

OBJECT_RADIUS_M: Final = 0.025
"""Distance along a board within which an object that touches a corner of a taxel is near the centre of another taxel
(chosen: the boards of the original hand have gaps of 15 mm between taxels).
"""

CORNER_DEPTH_M: Final = 1e-3
"""Depth to which an object in the neighbourhood may enter the corner of a taxel while no normal at a centre meets it,
metres (chosen: half of the layer). Distances in the dataset give an exact check in addition.
"""

NEIGHBOUR_PITCHES: Final = 1.6
"""Taxels of a board within this multiple of the pitch are neighbours: also the diagonal ones."""


@dataclass(frozen=True)
class Violation:
    """One violated invariant of a simulated grasp.

    kind: "force jump", "force without contact", "penetration", "force law" or "not at rest". frame: index in the grasp.
    taxel: index in the taxel table; None: the whole hand. text: measured and permitted value.
    """

    grasp: str
    frame: int
    time_s: float
    kind: str
    taxel: int | None
    text: str

    def __str__(self) -> str:
        """Format the violation as one line."""
        place = "" if self.taxel is None else f", taxel {self.taxel}"
        return f"grasp {self.grasp}, frame {self.frame} ({self.time_s:.2f} s){place}: {self.kind}: {self.text}"


class InvariantChecker:
    """Checks the grasps of one simulated dataset; the force law is learnt from all its grasps.

    The force law is the range of forces that the dataset contains at each depth of the object in the skin. A dataset
    without separations is checked only for force jumps and for changes during the hold. The layer thickness of a hand
    that is not packaged is not known, so its penetrations are found only by the force law.
    """

    def __init__(self, dataset: GraspDataset) -> None:
        """Prepare the checks of a dataset, which stays open while the checker is used."""
        self._dataset = dataset
        self._neighbours, self._pitch_m = _find_neighbours(dataset)
        self._surroundings = list(_find_surroundings(dataset))
        self._layer_m = _get_layer_m(dataset.hand)
        self._law = self._learn_law()

    def find_violations(self) -> Iterator[Violation]:
        """Yield the violations of all grasps in order of time; none for a dataset without contact forces."""
        for grasp in self._dataset:
            yield from self.check_grasp(grasp)

    def check_grasp(self, grasp: Grasp) -> list[Violation]:
        """Return the violations of one grasp in order of time."""
        force, separation = grasp.contact_force, grasp.separation
        if force is None:
            return []
        found = _find_jumps(grasp, force) + _find_unrest(grasp, force) + self._find_detached_forces(grasp, force)
        if separation is not None:
            found += self._find_penetrations(grasp, force, separation)
            found += self._find_lawless_forces(grasp, force, separation)
        return sorted(found, key=lambda violation: violation.frame)

    def _find_nearest(self, separation: FloatArray) -> FloatArray:
        """Return the smallest separation among each taxel and its neighbours, f64[T, n], metres.

        separation: f64[T, n], metres.
        """
        padded = np.pad(separation, ((0, 0), (0, 1)), constant_values=np.inf)  # at the index n, a missing neighbour
        return np.asarray(np.minimum(separation, padded[:, self._neighbours].min(axis=2)))

    def _is_surrounded(self, separation: FloatArray) -> BoolArray:
        """Whether each taxel and all its neighbours touch the object, bool[T, n]; separation: f64[T, n], metres."""
        touches = separation < 0.0
        padded = np.pad(touches, ((0, 0), (0, 1)), constant_values=True)  # at the index n, a missing neighbour
        return np.asarray(touches & padded[:, self._neighbours].all(axis=2))

    def _has_object_nearby(self, separation: FloatArray) -> BoolArray:
        """Return whether the object is near any taxel in the surroundings of each taxel, bool[T, n].

        The surroundings of a taxel are the taxels of the same board within `OBJECT_RADIUS_M` of it. The object is near
        a taxel if it may touch a corner of the taxel (`TAXEL_REACH_PITCHES`). separation: distance of the object from
        the centre of each taxel, f64[T, n], metres.
        """
        is_near = (separation < TAXEL_REACH_PITCHES * self._pitch_m).astype(np.float32)
        result = np.zeros(separation.shape, dtype=np.bool_)
        for on_board, is_within in self._surroundings:
            result[:, on_board] = is_near[:, on_board] @ is_within > 0.0
        return result

    def _find_detached_forces(self, grasp: Grasp, force: FloatArray) -> list[Violation]:
        """Find forces on taxels that are too far from the object to touch it with a corner.

        Empty for a grasp without the array `distance`.
        """
        distance = grasp.distance
        if distance is None:
            return []
        wrong = (force > MIN_FORCE_N) & (distance > TAXEL_REACH_PITCHES * self._pitch_m)
        return [
            _make_violation(
                grasp,
                frame,
                "force without contact",
                taxel,
                f"{force[frame, taxel]:.2f} N, object {1e3 * distance[frame, taxel]:.2f} mm away",
            )
            for frame, taxel in np.argwhere(wrong).tolist()
        ]

    def _find_penetrations(self, grasp: Grasp, force: FloatArray, separation: FloatArray) -> list[Violation]:
        """Find loaded taxels in which the object lies deeper than the layer is thick; empty for an unknown layer."""
        if self._layer_m is None:
            return []
        wrong = (separation < -self._layer_m) & (force > MIN_FORCE_N)
        return [
            _make_violation(
                grasp,
                frame,
                "penetration",
                taxel,
                f"{-1e3 * separation[frame, taxel]:.2f} mm in a layer of {1e3 * self._layer_m:.2f} mm",
            )
            for frame, taxel in np.argwhere(wrong).tolist()
        ]

    def _find_lawless_forces(self, grasp: Grasp, force: FloatArray, separation: FloatArray) -> list[Violation]:
        """Find taxels whose force contradicts the dataset's forces at equal depths by more than `MAX_LAW_RATIO`.

        The permitted range of a force is that of the force law (`_learn_law`). Its upper end applies to every taxel,
        its lower end only to a taxel that touches the object together with all its neighbours. Empty if the dataset has
        too few samples for a force law.
        """
        if self._law is None:
            return []
        depths, smallest, largest = self._law
        # Without force and contact no taxel of a frame can be found: the other frames take no time.
        frames = np.flatnonzero((force > MIN_FORCE_N).any(axis=1) | (separation < 0.0).any(axis=1))
        force, separation = force[frames], separation[frames]
        nearest = self._find_nearest(separation)
        low = np.interp(-separation, depths, smallest)
        # Separations are measured at the centres only: the object may enter the corner of a taxel between the centres.
        has_object = self._has_object_nearby(separation)
        depth = np.where(has_object, np.maximum(-nearest, CORNER_DEPTH_M), -nearest)
        high = np.interp(depth, depths, largest)
        # The multiples of `MIN_FORCE_N` exclude small forces, whose ratios are not reliable.
        too_large = force > MAX_LAW_RATIO * np.maximum(high, 4.0 * MIN_FORCE_N)
        too_small = self._is_surrounded(separation) & (low > 10.0 * MIN_FORCE_N) & (force < low / MAX_LAW_RATIO)
        return [
            _make_violation(
                grasp,
                int(frames[row]),
                "force without contact" if nearest[row, taxel] > 0.0 else "force law",
                taxel,
                f"{force[row, taxel]:.2f} N at a separation of {1e3 * separation[row, taxel]:.2f} mm, elsewhere "
                f"{low[row, taxel]:.2f} to {high[row, taxel]:.2f} N",
            )
            for row, taxel in np.argwhere(too_large | too_small).tolist()
        ]

    def _learn_law(self) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """Learn the range of forces by depth; return (depths f64[k], metres, smallest and largest forces f64[k], N).

        The smallest forces are those of taxels that touch the object together with all their neighbours, by the depth
        at the centre of the taxel. The largest forces are those of all taxels near the object, by the largest depth
        among the taxel and its neighbours. Both do not decrease with the depth. None for a dataset without forces or
        separations, or with too few samples.
        """
        values: list[tuple[FloatArray, ...]] = []
        for grasp in self._dataset:
            force, separation = grasp.contact_force, grasp.separation
            if force is None or separation is None:
                return None
            reach_m = TAXEL_REACH_PITCHES * self._pitch_m
            is_contact = (separation < reach_m).any(axis=1)  # in all other frames, no taxel is near the object
            force, separation = force[is_contact], separation[is_contact]
            nearest = self._find_nearest(separation)
            is_near = nearest < reach_m
            is_surrounded = self._is_surrounded(separation)
            values.append((-nearest[is_near], force[is_near], -separation[is_surrounded], force[is_surrounded]))
        if not values:
            return None
        largest_depth, force, depth, force_within = (np.concatenate(parts) for parts in zip(*values, strict=True))
        high_number, low_number = (np.floor(part / LAW_BIN_M).astype(np.int64) for part in (largest_depth, depth))
        bins = []
        for index in np.unique(high_number).tolist():
            near, within = force[high_number == index], force_within[low_number == index]
            if len(near) >= MIN_BIN_SAMPLES:
                low = float(np.quantile(within, LAW_QUANTILE)) if len(within) >= MIN_BIN_SAMPLES else 0.0
                bins.append(((index + 0.5) * LAW_BIN_M, low, float(np.quantile(near, 1.0 - LAW_QUANTILE))))
        if not bins:
            return None
        middle, smallest, largest = np.array(bins).T
        # The depth varies within a bin. The range of forces of a bin therefore includes the smallest force of the bin
        # below and the largest force of the bin above.
        smallest = np.minimum.accumulate(np.minimum(smallest, np.r_[0.0, smallest[:-1]])[::-1])[::-1]
        largest = np.maximum.accumulate(np.maximum(largest, np.r_[largest[1:], largest[-1]]))
        return middle, smallest, largest


def _make_violation(grasp: Grasp, frame: int, kind: str, taxel: int | None, text: str) -> Violation:
    """Return a violation at the index `frame` of a grasp, with its time since the grasp's first frame."""
    return Violation(grasp.id, int(frame), float(grasp.timestamp[frame] - grasp.timestamp[0]), kind, taxel, text)


def _find_jumps(grasp: Grasp, force: FloatArray) -> list[Violation]:
    """Find frames whose total force jumps relative to the hold or to the neighbouring frames.

    The level of the hold is the second largest total force of the hold, and at least ten times `MIN_FORCE_N`, because
    ratios of smaller forces are not reliable. A frame is found if its total force exceeds this level by more than
    `MAX_FORCE_RATIO`. It is also found if it exceeds the level by any amount, and both neighbouring frames by more than
    `MAX_FORCE_RATIO`. In the closing phase, where the fingers hit the object, only the level of the hold is compared,
    with the larger `MAX_IMPACT_RATIO`. Within the hold, a frame is also found if the total forces of both neighbouring
    frames exceed its total force by more than `MAX_FORCE_RATIO`.
    """
    total, phase = force.sum(axis=1), grasp.phase
    hold = total[phase == Phase.HOLD]
    # The second largest value, because a single wrong frame of the hold would raise its own limit.
    limit = max(float(np.sort(hold)[-2:][0]) if len(hold) else 0.0, 10.0 * MIN_FORCE_N)
    neighbours = np.maximum(np.r_[0.0, total[:-1]], np.r_[total[1:], 0.0])
    is_closing = phase == Phase.CLOSING
    exceeds = total > np.where(is_closing, MAX_IMPACT_RATIO, MAX_FORCE_RATIO) * limit
    sticks_out = (total > MAX_FORCE_RATIO * neighbours) & (total > limit) & ~is_closing
    in_hold = (phase == Phase.HOLD) & (np.r_[0, phase[:-1]] == Phase.HOLD) & (np.r_[phase[1:], 0] == Phase.HOLD)
    lower = np.minimum(np.r_[0.0, total[:-1]], np.r_[total[1:], 0.0])
    is_gap = in_hold & (MAX_FORCE_RATIO * total < lower) & (lower > 10.0 * MIN_FORCE_N)
    return [
        _make_violation(
            grasp,
            frame,
            "force jump",
            None,
            f"{total[frame]:.1f} N in all, neighbouring frames {neighbours[frame]:.1f} N, hold {limit:.1f} N",
        )
        for frame in np.flatnonzero(exceeds | sticks_out | is_gap).tolist()
    ]


def _find_unrest(grasp: Grasp, force: FloatArray) -> list[Violation]:
    """Return one violation if the total force changes by more than `MAX_HOLD_CHANGE` during the hold, else none.

    The first and the last third of the hold are compared. Empty for a hold of fewer than 6 frames.
    """
    hold = np.flatnonzero(grasp.phase == Phase.HOLD)
    if len(hold) < 6:
        return []
    total, third = force[hold].sum(axis=1), len(hold) // 3
    first, last = float(np.median(total[:third])), float(np.median(total[-third:]))
    if abs(last - first) <= MAX_HOLD_CHANGE * max(first, last, 10.0 * MIN_FORCE_N):
        return []
    return [
        _make_violation(
            grasp, int(hold[-1]), "not at rest", None, f"total force {first:.1f} N, later {last:.1f} N in the hold"
        )
    ]


def _find_neighbours(dataset: GraspDataset) -> tuple[IntArray, float]:
    """Return the neighbours of each taxel on its board, i64[n, k], and the largest pitch of a board, metres.

    k is the largest number of neighbours; the index n fills the row of a taxel with fewer neighbours.
    """
    taxels, largest_pitch = dataset.taxels, 0.0
    lists: list[list[int]] = [[] for _ in range(taxels.n)]
    for address in np.unique(taxels.sensor).tolist():
        on_board = np.flatnonzero(taxels.sensor == address)
        tree = cKDTree(taxels.position[on_board])
        if len(on_board) < 2:
            continue
        pitch = float(np.median(np.asarray(tree.query(taxels.position[on_board], k=2)[0])[:, 1]))
        largest_pitch = max(largest_pitch, pitch)
        for a, b in tree.query_pairs(NEIGHBOUR_PITCHES * pitch):
            lists[on_board[a]].append(int(on_board[b]))
            lists[on_board[b]].append(int(on_board[a]))
    width = max(1, max(map(len, lists), default=1))
    return np.array([row + [taxels.n] * (width - len(row)) for row in lists], dtype=np.int64), largest_pitch


def _find_surroundings(dataset: GraspDataset) -> Iterator[tuple[IntArray, FloatArray]]:
    """Yield for each board (indices of its m taxels, i64[m]; matrix of the pairs of near taxels, f32[m, m]).

    An entry of the matrix is 1 if the centres of the two taxels are closer than `OBJECT_RADIUS_M`, else 0.
    """
    taxels = dataset.taxels
    for address in np.unique(taxels.sensor).tolist():
        on_board = np.flatnonzero(taxels.sensor == address)
        positions = taxels.position[on_board]
        distance = np.linalg.norm(positions[:, None] - positions[None], axis=2)
        yield on_board, (distance < OBJECT_RADIUS_M).astype(np.float32)


def _get_layer_m(hand: str) -> float | None:
    """Return the thickness of a packaged hand's soft layer, metres; None for an unknown hand."""
    try:
        return load_hand(hand).layer_m
    except TaxelError:
        return None
