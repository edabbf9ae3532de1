"""Search of a collision-free path in joint space: RRT-Connect with several goals, then shortcuts.

OMPL (the planner library of MoveIt) has no package for Python 3.14 and none for aarch64, and its Python interface
checks an edge at fixed samples; the bound of `Clearances.check_segment` replaces those samples here.

Source: Kuffner and LaValle, RRT-Connect: an efficient approach to single-query path planning, ICRA 2000.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.types import FloatArray

STEP_RAD: Final = 1.0
"""Largest length of an edge of the trees, radians (chosen): the check of an edge subdivides it where necessary."""

SHORTCUTS: Final = 40
"""Number of random shortcuts that are tried (chosen); more of them change the duration of a plan by a few per cent."""

IsFree = Callable[[FloatArray, FloatArray], bool]
"""Returns whether the straight segment between two postures is free of collisions."""


@dataclass(frozen=True, eq=False)
class SearchSpace:
    """Range and conditions of a search.

    lower, upper: smallest and largest joint angles, f64[n] radians. is_free: check of a segment. compute_cost: cost of
    the path through postures f64[k, n]; a shortcut must lower it.
    """

    lower: FloatArray
    upper: FloatArray
    is_free: IsFree
    compute_cost: Callable[[FloatArray], float]


class _Tree:
    """Tree of postures; a root has the parent -1."""

    def __init__(self, roots: Sequence[FloatArray]) -> None:
        """Create a tree with the given roots."""
        self.postures = list(roots)
        self.parents = [-1] * len(roots)

    def find_nearest(self, posture: FloatArray) -> int:
        """Find the index of the nearest node."""
        return int(np.argmin(np.sum((np.stack(self.postures) - posture) ** 2, axis=1)))

    def add(self, posture: FloatArray, parent: int) -> int:
        """Add a posture f64[n] as a node and return its index. parent: index of the node that its edge leads to."""
        self.postures.append(posture)
        self.parents.append(parent)
        return len(self.postures) - 1

    def trace(self, index: int) -> list[FloatArray]:
        """Return the postures from a node to its root."""
        path = []
        while index >= 0:
            path.append(self.postures[index])
            index = self.parents[index]
        return path


def find_path(
    start: FloatArray, goals: Sequence[FloatArray], space: SearchSpace, rng: np.random.Generator, iterations: int
) -> FloatArray | None:
    """Find a path f64[k, n] from `start` f64[n] to one of `goals`; None if the search finds none.

    Method: RRT-Connect. A tree from the start and a tree from all goals grow in turn: one tree extends towards a random
    posture, the other then towards the new node, until the trees meet.

    iterations: largest number of random postures. The ends are copied exactly. Every edge is free by
    `space.is_free`. The straight segments are tried first, in the order of `goals`.
    """
    for goal in goals:
        if space.is_free(start, goal):
            return np.stack([start, goal])
    trees, is_swapped = (_Tree([start]), _Tree(goals)), False  # is_swapped: the tree from the goals grows first
    for _ in range(iterations):
        target = space.lower + rng.uniform(size=len(start)) * (space.upper - space.lower)
        growing, other = trees[is_swapped], trees[not is_swapped]
        if (node := _extend(growing, target, space)) is not None:
            met = _connect(other, growing.postures[node], space)
            if met is not None:
                halves = growing.trace(node), other.trace(met)
                from_start, from_goal = halves[::-1] if is_swapped else halves
                return np.stack([*reversed(from_start), *from_goal[1:]])
        is_swapped = not is_swapped
    return None


def _extend(tree: _Tree, target: FloatArray, space: SearchSpace) -> int | None:
    """Extend a tree by one edge towards a posture; return the new node, or None if the edge is blocked."""
    nearest = tree.find_nearest(target)
    step = target - tree.postures[nearest]
    length = float(np.linalg.norm(step))
    posture = target if length <= STEP_RAD else tree.postures[nearest] + step * (STEP_RAD / length)
    return tree.add(posture, nearest) if space.is_free(tree.postures[nearest], posture) else None


def _connect(tree: _Tree, target: FloatArray, space: SearchSpace) -> int | None:
    """Extend a tree towards a posture until it is reached; return its node, or None if an edge is blocked."""
    while (node := _extend(tree, target, space)) is not None:
        if tree.postures[node] is target:
            return node
    return None


def shorten_path(path: FloatArray, space: SearchSpace, rng: np.random.Generator) -> FloatArray:
    """Shorten a path f64[k, n] by straight shortcuts; the ends are unchanged, and the cost never increases."""
    path = _skip_waypoints(path, space)
    for _ in range(SHORTCUTS if len(path) > 2 else 0):
        # Two random places on the path: index of a waypoint plus share of the segment behind it.
        places = np.sort(rng.uniform(0, len(path) - 1, size=2))
        first, last = int(places[0]), int(places[1])
        if first == last:
            continue
        begin = path[first] + (places[0] - first) * (path[first + 1] - path[first])
        end = path[last] + (places[1] - last) * (path[last + 1] - path[last])
        shorter = np.stack([*path[: first + 1], begin, end, *path[last + 1 :]])
        if space.compute_cost(shorter) < space.compute_cost(path) and space.is_free(begin, end):
            path = shorter
    return _skip_waypoints(path, space)


def _skip_waypoints(path: FloatArray, space: SearchSpace) -> FloatArray:
    """Remove waypoints that a free straight segment can skip at no higher cost; longest segments are tried first."""
    kept, index = [path[0]], 0
    while index < len(path) - 1:
        following = index + 1
        for candidate in range(len(path) - 1, index + 1, -1):
            direct = np.stack([path[index], path[candidate]])
            is_cheaper = space.compute_cost(direct) <= space.compute_cost(path[index : candidate + 1])
            if is_cheaper and space.is_free(path[index], path[candidate]):
                following = candidate
                break
        index = following
        kept.append(path[index])
    return np.stack(kept)
