"""The errors of the frame buffer: each prints as one line and carries its data."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence

from taxel.errors import TaxelError

__all__ = [
    "DisconnectedFramesError",
    "ExtrapolationError",
    "FrameConflictError",
    "FrameError",
    "FrameLoopError",
    "UnknownFrameError",
]

_MAX_KNOWN = 8  # frames that an error lists


class FrameError(TaxelError):
    """The base of all errors of a `FrameBuffer`."""


class UnknownFrameError(FrameError, LookupError):
    """A frame that the buffer does not have; carries `frame` and `known`."""

    def __init__(self, frame: str, known: Iterable[str]) -> None:
        self.frame, self.known = frame, tuple(sorted(known))
        super().__init__(frame, self.known)

    def __str__(self) -> str:
        near = difflib.get_close_matches(self.frame[:64], self.known, n=1)
        if near:
            return f"frames: no frame {self.frame!r}; did you mean {near[0]!r}?"
        if not self.known:
            return f"frames: no frame {self.frame!r}; the buffer is empty, set a transform first"
        more = ", ..." if len(self.known) > _MAX_KNOWN else ""
        return f"frames: no frame {self.frame!r}; known are {', '.join(self.known[:_MAX_KNOWN])}{more}"


class DisconnectedFramesError(FrameError, LookupError):
    """Two frames in different trees; carries `target`, `source`, `target_root` and `source_root`."""

    def __init__(self, target: str, source: str, target_root: str, source_root: str) -> None:
        super().__init__(target, source, target_root, source_root)
        self.target, self.source = target, source
        self.target_root, self.source_root = target_root, source_root

    def __str__(self) -> str:
        return (
            f"frames: expected {self.target!r} and {self.source!r} in one tree, found the roots {self.target_root!r} "
            f"and {self.source_root!r}; set a transform that joins them"
        )


class ExtrapolationError(FrameError, LookupError):
    """A time at which a transform is not known; carries `time_s`, `first_s`, `last_s`, `parent` and `child`."""

    def __init__(self, time_s: float, first_s: float, last_s: float, parent: str, child: str) -> None:
        super().__init__(time_s, first_s, last_s, parent, child)
        self.time_s, self.first_s, self.last_s = time_s, first_s, last_s
        self.parent, self.child = parent, child

    def __str__(self) -> str:
        if self.time_s > self.last_s:
            remedy = f"{self.time_s - self.last_s:.6g} s too late; wait for it or ask for an earlier time"
        else:
            remedy = f"{self.first_s - self.time_s:.6g} s too early; ask for a later time or keep a longer history"
        return (
            f"frames: {self.parent!r} to {self.child!r}: expected a time from {self.first_s!r} to {self.last_s!r} s, "
            f"found {self.time_s!r} s, {remedy}"
        )


class FrameLoopError(FrameError, ValueError):
    """A transform that would make a frame its own ancestor; carries `parent`, `child` and `path`, child to parent."""

    def __init__(self, parent: str, child: str, path: Sequence[str]) -> None:
        super().__init__(parent, child, tuple(path))
        self.parent, self.child, self.path = parent, child, tuple(path)

    def __str__(self) -> str:
        below = " > ".join(repr(frame) for frame in self.path)
        return (
            f"frames: {self.parent!r} to {self.child!r}: expected a parent that is not below its child, "
            f"found {below}; swap the two or invert the transform"
        )


class FrameConflictError(FrameError, ValueError):
    """A second parent, or a static frame that moves; carries `child`, `held` and `offered`, such as "static in 'a'"."""

    def __init__(self, child: str, held: str, offered: str) -> None:
        super().__init__(child, held, offered)
        self.child, self.held, self.offered = child, held, offered

    def __str__(self) -> str:
        return (
            f"frames: {self.child!r}: expected one parent, {self.held} as set before, found {self.offered}; "
            "give the frame another name or start a new buffer"
        )
