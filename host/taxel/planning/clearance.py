"""Distances between bodies at a posture, and collision checks of straight segments in joint space with a bound."""

from collections import deque
from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np

from taxel.planning.bodies import BodyModel
from taxel.types import FloatArray, IndexArray

FLOOR_SHARE: Final = 0.5
"""Share of the required clearance that is guaranteed between the samples of a segment (chosen).

Between samples the distance is bounded, not measured. A larger share needs more samples near obstacles, a share of 0
guarantees only the absence of contact.
"""

_NO_PAIRS: Final = np.zeros(0, dtype=np.intp)


@dataclass(frozen=True)
class Collision:
    """A pair of bodies nearer than required.

    pair: index of the pair in the body model. distance_m: distance, negative if the bodies overlap. share: place on the
    checked segment, from 0 (start) to 1 (end).
    """

    pair: int
    distance_m: float
    share: float = 0.0


class Clearances:
    """Distances of the pairs of a body model. Not thread-safe.

    bodies: the model. count: number of evaluated postures (a measure of the effort).
    """

    def __init__(self, bodies: BodyModel) -> None:
        """Create the distance computation of a body model."""
        self.bodies = bodies
        self.count = 0
        self._model, self._data = bodies.model, mujoco.MjData(bodies.model)
        pairs = bodies.pairs
        self._first, self._second = bodies.geom_ids[pairs[:, 0]], bodies.geom_ids[pairs[:, 1]]
        # The table is the only plane; it is the second body of its pairs, because surroundings come last.
        self._has_plane = bodies.is_plane[pairs[:, 1]]
        self._radii = bodies.radius[pairs[:, 0]] + np.where(self._has_plane, 0.0, bodies.radius[pairs[:, 1]])
        self.all_pairs: IndexArray = np.arange(len(pairs))

    def measure(self, angles: FloatArray, limit_m: FloatArray, pairs: IndexArray | None = None) -> FloatArray:
        """Measure the distances of pairs at joint angles f64[j], metres, each at most up to its limit.

        Returns f64[k]; a negative value is the depth of an overlap. limit_m: f64[k]; a result equal to or above its
        limit is only a lower bound of the distance. pairs: int[k], indices of the pairs; None: all pairs.
        """
        self.count += 1
        pairs = self.all_pairs if pairs is None else pairs
        self._data.qpos[:] = angles
        mujoco.mj_kinematics(self._model, self._data)
        position, first, second = self._data.geom_xpos, self._first[pairs], self._second[pairs]
        difference = position[first] - position[second]
        length = np.sqrt(np.einsum("ij,ij->i", difference, difference))
        result = np.where(self._has_plane[pairs], difference[:, 2], length) - self._radii[pairs]
        for k in np.flatnonzero(result < limit_m).tolist():
            result[k] = mujoco.mj_geomDistance(
                self._model, self._data, int(first[k]), int(second[k]), max(float(limit_m[k]), 0.0), None
            )
        return np.asarray(result)

    def find_collision(self, angles: FloatArray, required_m: FloatArray) -> Collision | None:
        """Find the pair that is farthest below its required distance f64[p] at a posture f64[j]; None if there is none.

        required_m: metres.
        """
        distance = self.measure(angles, required_m)
        deficit = required_m - distance
        worst = int(np.argmax(deficit))
        return Collision(worst, float(distance[worst])) if deficit[worst] > 0 else None

    def check_segment(
        self, start: FloatArray, end: FloatArray, required_m: FloatArray, floor_m: FloatArray | None = None
    ) -> Collision | None:
        """Return the first collision found on a straight segment between two postures f64[j]; None if it is free.

        required_m: distance f64[p] at every sample, metres. floor_m: distance f64[p] that is guaranteed between the
        samples, below `required_m`; None: `FLOOR_SHARE` of it. Method: along the segment the distance of a pair changes
        at most by the sum over the joints of lever arm times angle. An interval is free if, by this bound from both of
        its ends, no distance falls below `floor_m`; otherwise the distances in its middle are measured.
        """
        floor = FLOOR_SHARE * required_m if floor_m is None else floor_m
        step = end - start
        motion = self.bodies.reach @ np.abs(step)
        pairs = np.flatnonzero(motion > 0)
        if not len(pairs):
            return self.find_collision(start, required_m)
        required, floor, motion = required_m[pairs], floor[pairs], motion[pairs]
        limit = np.maximum(required, floor + motion / 2)
        ends = []
        for share in (0.0, 1.0):
            distance = self.measure(start + share * step, limit, pairs)
            ends.append(distance)
            if (worst := _find_worst(distance, required)) is not None:
                return Collision(int(pairs[worst]), float(distance[worst]), share)
        open_intervals = deque([(0.0, 1.0, ends[0], ends[1], np.arange(len(pairs)))])
        while open_intervals:  # breadth first, so that a collision is found before details are resolved
            low, high, at_low, at_high, subset = open_intervals.popleft()
            is_open = (at_low + at_high - motion[subset] * (high - low)) / 2 < floor[subset]
            if not is_open.any():
                continue
            subset, at_low, at_high = subset[is_open], at_low[is_open], at_high[is_open]
            middle = (low + high) / 2
            # From this distance in the middle on, the bound shows that both halves of the interval are free.
            limit = 2 * floor[subset] + motion[subset] * (high - low) / 2 - np.minimum(at_low, at_high)
            distance = self.measure(start + middle * step, np.maximum(required[subset], limit), pairs[subset])
            if (worst := _find_worst(distance, required[subset])) is not None:
                return Collision(int(pairs[subset[worst]]), float(distance[worst]), middle)
            open_intervals.append((low, middle, at_low, distance, subset))
            open_intervals.append((middle, high, distance, at_high, subset))
        return None


def _find_worst(distance: FloatArray, required: FloatArray) -> int | None:
    """Find the index of the distance farthest below its required value; None if all are large enough."""
    deficit = required - distance
    worst = int(np.argmax(deficit))
    return worst if deficit[worst] > 0 else None
