"""How the emulated skin pushes back: the emulator's own contact (firmware/emulator/skin), called through ctypes."""

from __future__ import annotations

import ctypes
import os
import tempfile
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from taxel.errors import TaxelError
from taxel.native_library import emulator_message, load_library, redirected_stderr

LOAD_VALUES = 42
"""Of a board: force and moment (6), stiffness (6 x 6)."""


class ContactLibraryError(TaxelError):
    """The compiled contact library is missing, or refuses a world."""


class ContactLoad(NamedTuple):
    """What contact does to the boards, each in its true bracket frame about that frame's origin.

    wrench: f64[s, 6], force (N) and moment (Nm) on the board. stiffness: f64[s, 6, 6]: how the wrench falls with a
    small motion of the board against the object (translation, rotation); symmetric, positive semidefinite. touched:
    how many boards.
    """

    wrench: NDArray[np.float64]
    stiffness: NDArray[np.float64]
    touched: int


@cache
def contact_library() -> ctypes.CDLL:
    """The loaded library. Raises `ContactLibraryError` if it was not built."""
    library = load_library("taxel_contact", "the compiled contact library", ContactLibraryError)
    pointer, size = ctypes.c_void_p, ctypes.c_size_t
    library.taxel_contact_open.argtypes, library.taxel_contact_open.restype = [ctypes.c_char_p], pointer
    library.taxel_contact_close.argtypes, library.taxel_contact_close.restype = [pointer], None
    for name in ("taxel_contact_boards", "taxel_contact_taxels"):
        getattr(library, name).argtypes, getattr(library, name).restype = [pointer], size
    for name in ("taxel_contact_bracket_offset", "taxel_contact_object_offset"):
        getattr(library, name).argtypes, getattr(library, name).restype = [pointer, size, pointer], None
    library.taxel_contact_evaluate.argtypes = [pointer, ctypes.c_int, pointer, pointer, pointer, pointer]
    library.taxel_contact_evaluate.restype = ctypes.c_int
    return library


class SkinContact:
    """The contact of a world's skin with its objects. `world`: the text of `taxel.emulated.scene.scene_text`.

    Poses are those that are believed; the world's own offsets are applied inside. Use it as a context manager. Raises
    `ContactLibraryError` with the emulator's own line if it refuses the world.
    """

    def __init__(self, world: str) -> None:
        self._library = contact_library()
        self._handle = self._open(world)
        self.boards = int(self._library.taxel_contact_boards(self._handle))
        self.taxels = int(self._library.taxel_contact_taxels(self._handle))
        self._objects = sum(line.startswith("object ") for line in world.splitlines())
        self._load = np.zeros((self.boards, LOAD_VALUES))
        self._force = np.zeros(self.taxels)

    def _open(self, world: str) -> int:
        with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
            path, complaint = Path(folder) / "world.txt", Path(folder) / "stderr.txt"
            path.write_text(world)
            with redirected_stderr(complaint):
                handle = self._library.taxel_contact_open(os.fsencode(path))
            if not handle:
                raise ContactLibraryError(emulator_message(complaint.read_text(errors="replace"), str(path), world))
            return int(handle)

    def bracket_offset(self, board: int) -> NDArray[np.float64]:
        """Where a board's bracket (its place in the world file) truly is, in its believed frame, f64[4, 4]."""
        return self._offset("taxel_contact_bracket_offset", board, self.boards)

    def object_offset(self, index: int) -> NDArray[np.float64]:
        """The same for an object."""
        return self._offset("taxel_contact_object_offset", index, self._objects)

    def _offset(self, function: str, index: int, count: int) -> NDArray[np.float64]:
        self._check(0 <= index < count, f"a number from 0 to {count - 1}, found {index}")
        offset = np.eye(4)
        rows = np.zeros((3, 4))
        getattr(self._library, function)(self._handle, index, rows.ctypes.data)
        offset[:3] = rows
        return offset

    def load(self, index: int, object_pose: NDArray[np.float64], bracket_poses: NDArray[np.float64]) -> ContactLoad:
        """Contact of object `index` (-1: none) at `object_pose` [4, 4] with brackets at `bracket_poses` [s, 4, 4]."""
        touched = self._evaluate(index, object_pose, bracket_poses, None)
        return ContactLoad(self._load[:, :6].copy(), self._load[:, 6:].reshape(-1, 6, 6).copy(), touched)

    def forces(
        self, index: int, object_pose: NDArray[np.float64], bracket_poses: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Normal force on every taxel, newtons, f64[n], before anything spreads."""
        self._evaluate(index, object_pose, bracket_poses, self._force.ctypes.data)
        return self._force.copy()

    def _evaluate(
        self, index: int, object_pose: NDArray[np.float64], bracket_poses: NDArray[np.float64], force: int | None
    ) -> int:
        poses = np.ascontiguousarray(bracket_poses[:, :3, :], dtype=np.float64)
        pose = np.ascontiguousarray(object_pose[:3], dtype=np.float64)
        self._check(-1 <= index < self._objects, f"an object from -1 to {self._objects - 1}, found {index}")
        self._check(poses.shape == (self.boards, 3, 4), f"poses of {self.boards} brackets, found {bracket_poses.shape}")
        self._check(pose.shape == (3, 4), f"the pose of an object, found {object_pose.shape}")
        return int(
            self._library.taxel_contact_evaluate(
                self._handle, index, pose.ctypes.data, poses.ctypes.data, self._load.ctypes.data, force
            )
        )

    def _check(self, fits: bool, expected: str) -> None:
        """The library checks nothing."""
        if not (fits and self._handle):
            raise ValueError(f"expected {expected}" if self._handle else "expected an open contact, found a closed one")

    def close(self) -> None:
        """Free the library's memory."""
        if self._handle:
            self._library.taxel_contact_close(self._handle)
            self._handle = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
