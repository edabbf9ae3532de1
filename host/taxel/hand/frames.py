"""Named coordinate frames in a tree, looked up at any time: the data structure behind ROS's tf2, without ROS.

Reference for the behaviour: T. Foote, "tf: The transform library", TePRA 2013.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from taxel.hand.frame_errors import (
    DisconnectedFramesError,
    ExtrapolationError,
    FrameConflictError,
    FrameError,
    FrameLoopError,
    UnknownFrameError,
)
from taxel.hand.frame_history import TransformHistory
from taxel.hand.transforms import check_rigid, inverse
from taxel.types import FloatArray

__all__ = ["HISTORY_S", "FrameBuffer"]

HISTORY_S = 10.0  # seconds kept of each moving transform; the default of tf2


@dataclass(frozen=True, eq=False)
class _Edge:
    """What joins a frame to its parent: one fixed transform, or a history."""

    parent: str
    motion: FloatArray | TransformHistory

    def __str__(self) -> str:
        return _role(self.parent, static=not isinstance(self.motion, TransformHistory))


class FrameBuffer:
    """Transforms between named frames, each known over the last `history_s` seconds.

    A frame appears with the first transform that names it. Each has one parent, and a transform is either static or
    moving for good. Between two stamps positions are interpolated linearly and rotations spherically; outside the
    stamps nothing is guessed. A single stamp is known at that time only.

    Not thread safe: a thread that sets while another looks up needs a lock of the caller's.

    history_s: seconds, above 0. Raises ValueError for another.

    >>> buffer = FrameBuffer()
    >>> buffer.set_static("hand", "palm", np.eye(4))
    >>> buffer.lookup("hand", "palm").shape
    (4, 4)
    """

    def __init__(self, history_s: float = HISTORY_S) -> None:
        if not (math.isfinite(history_s) and history_s > 0):
            raise ValueError(f"history_s: expected a finite number of seconds above 0, found {history_s}")
        self.history_s = float(history_s)
        self._edges: dict[str, _Edge] = {}
        self._frames: set[str] = set()

    def set_transform(self, parent: str, child: str, transform: npt.ArrayLike, stamp_s: float) -> bool:
        """Tell where `child` is in `parent` at a time; stamps may come in any order.

        transform: f64[4, 4], maps points in `child` to `parent`. stamp_s: seconds; a second transform of the same
        stamp replaces the first. Returns False where the stamp is older than the history and was not kept.

        Raises FrameLoopError, FrameConflictError (a second parent, or a static child), ValueError for a transform
        that is not rigid, a stamp that is not finite or an empty name.
        """
        if not math.isfinite(stamp_s):
            raise ValueError(f"stamp_s: expected a finite number of seconds, found {stamp_s}")
        matrix = self._checked(parent, child, transform, static=False)
        edge = self._edges.get(child)
        history = edge.motion if edge else TransformHistory(self.history_s)
        assert isinstance(history, TransformHistory)  # _checked refuses a static child
        self._join(parent, child, history)
        return history.add(float(stamp_s), matrix)

    def set_static(self, parent: str, child: str, transform: npt.ArrayLike) -> None:
        """Tell where `child` is in `parent` at all times; a later call replaces the transform.

        transform: f64[4, 4]. Raises as `set_transform` does; a moving child is a FrameConflictError.
        """
        self._join(parent, child, self._checked(parent, child, transform, static=True))

    def lookup(self, target: str, source: str, time_s: float | None = None) -> FloatArray:
        """The transform f64[4, 4] that maps points in `source` to `target`.

        time_s: seconds; None is the latest time at which every moving transform between the two is known.

        Raises UnknownFrameError, DisconnectedFramesError, ExtrapolationError.
        """
        up, down = self._paths(target, source)
        time = self._latest_common(up + down) if time_s is None else float(time_s)
        return inverse(self._product(down, time)) @ self._product(up, time)

    def lookup_many(self, target: str, sources: Sequence[str], times_s: npt.ArrayLike) -> FloatArray:
        """The transforms f64[T, n, 4, 4] that map points in each of n `sources` to `target` at times f64[T].

        Every moving transform is read once for all times. Raises as `lookup` does, for the first time outside.
        """
        times = np.asarray(times_s, dtype=np.float64)
        if times.ndim != 1:
            raise ValueError(f"times_s: expected shape [T], found {times.shape}")
        read: dict[str, FloatArray] = {}

        def motion(frame: str) -> FloatArray:
            if frame not in read:
                read[frame] = self._motion(frame, times)
            return read[frame]

        result = np.empty((times.size, len(sources), 4, 4))
        for index, source in enumerate(sources):
            up, down = self._paths(target, source)
            result[:, index] = inverse(_product(down, motion)) @ _product(up, motion)
        return result

    def can_transform(self, target: str, source: str, time_s: float | None = None) -> bool:
        """Whether `lookup` would answer."""
        try:
            up, down = self._paths(target, source)
            time = self._latest_common(up + down) if time_s is None else float(time_s)
            for frame in up + down:
                self._check_time(frame, np.array(time))
        except FrameError:
            return False
        return True

    def latest_common_time(self, target: str, source: str) -> float | None:
        """The time that `lookup` takes by default, seconds; None where nothing between the two moves."""
        up, down = self._paths(target, source)
        time = self._latest_common(up + down)
        return None if math.isinf(time) else time

    def frames(self) -> tuple[str, ...]:
        """All frames, in alphabetical order."""
        return tuple(sorted(self._frames))

    def parent_of(self, frame: str) -> str | None:
        """The parent of a frame, None for a root. Raises UnknownFrameError."""
        self._check_known(frame)
        edge = self._edges.get(frame)
        return edge.parent if edge else None

    def chain(self, target: str, source: str) -> tuple[str, ...]:
        """The frames from `target` to `source` through the tree, both included.

        Raises UnknownFrameError, DisconnectedFramesError.
        """
        up, down = self._paths(target, source)
        ends = up or down  # the last of either is a child of the frame where the two ways meet
        meeting = self._edges[ends[-1]].parent if ends else target
        return (*down, meeting, *reversed(up))

    def _checked(self, parent: str, child: str, transform: npt.ArrayLike, *, static: bool) -> FloatArray:
        for name in (parent, child):
            if not (name and name.isprintable()):
                raise ValueError(f"frame: expected a printable name, found {name!r}")
        matrix = np.array(transform, dtype=np.float64)
        if matrix.shape != (4, 4):
            raise ValueError(f"transform: expected shape [4, 4], found {matrix.shape}")
        check_rigid(matrix)
        edge = self._edges.get(child)
        if edge and str(edge) != _role(parent, static=static):
            raise FrameConflictError(child, str(edge), _role(parent, static=static))
        if not edge:
            above = self._ancestors(parent) if parent in self._frames else [parent]
            if child in above:
                raise FrameLoopError(parent, child, above[above.index(child) :: -1])
        return matrix

    def _join(self, parent: str, child: str, motion: FloatArray | TransformHistory) -> None:
        self._edges[child] = _Edge(parent, motion)
        self._frames |= {parent, child}

    def _check_known(self, frame: str) -> None:
        if frame not in self._frames:
            raise UnknownFrameError(frame, self._frames)

    def _ancestors(self, frame: str) -> list[str]:
        """The frame, its parent, and so on to the root."""
        self._check_known(frame)
        path = [frame]
        while path[-1] in self._edges:
            path.append(self._edges[path[-1]].parent)
        return path

    def _paths(self, target: str, source: str) -> tuple[list[str], list[str]]:
        """The frames from source and from target up to, without, the first ancestor that both have."""
        down, up = self._ancestors(target), self._ancestors(source)
        if down[-1] != up[-1]:
            raise DisconnectedFramesError(target, source, down[-1], up[-1])
        shared = 0
        while shared < min(len(up), len(down)) and up[-1 - shared] == down[-1 - shared]:
            shared += 1
        return up[: len(up) - shared], down[: len(down) - shared]

    def _latest_common(self, path: Iterable[str]) -> float:
        """The oldest of the newest stamps; infinity where nothing moves."""
        motions = [self._edges[frame].motion for frame in path]
        return min((m.last_s for m in motions if isinstance(m, TransformHistory)), default=math.inf)

    def _check_time(self, frame: str, times: FloatArray) -> None:
        edge = self._edges[frame]
        if isinstance(edge.motion, TransformHistory):
            first, last = edge.motion.first_s, edge.motion.last_s
            outside = ~((times >= first) & (times <= last))  # so that NaN is outside too
            if outside.any():
                raise ExtrapolationError(float(times[outside][0]), first, last, edge.parent, frame)

    def _motion(self, frame: str, times: FloatArray) -> FloatArray:
        """Where the frame is in its parent at times f64[...]: f64[..., 4, 4], or f64[4, 4] if static."""
        self._check_time(frame, times)
        motion = self._edges[frame].motion
        return motion.at(times) if isinstance(motion, TransformHistory) else motion

    def _product(self, path: list[str], time: float) -> FloatArray:
        return _product(path, lambda frame: self._motion(frame, np.array(time)))


def _product(path: list[str], motion: Callable[[str], FloatArray]) -> FloatArray:
    """The transform from the first frame of a path to the parent of its last; its batch is that of `motion`."""
    result: FloatArray = np.eye(4)
    for frame in path:
        result = motion(frame) @ result
    return result


def _role(parent: str, *, static: bool) -> str:
    return f"{'static' if static else 'moving'} in {parent!r}"
