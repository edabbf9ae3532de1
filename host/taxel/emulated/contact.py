"""Contact forces and stiffness of the emulated skin, computed by the emulator's C library (firmware/emulator/skin)."""

import ctypes
import os
import tempfile
from functools import cache
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np

from taxel.errors import TaxelError
from taxel.native_library import emulator_message, load_library, redirected_stderr
from taxel.types import FloatArray

VALUES_PER_BOARD = 43
"""Values of a board's load: force and moment (6), then stiffness (6 x 6)."""


class ContactLibraryError(TaxelError):
    """The compiled contact library is missing, or it rejects a world file."""


class ContactLoad(NamedTuple):
    """Load of the contact on each of s boards, in the board's true bracket frame, about the origin of that frame.

    wrench: f64[s, 6], force (N) and moment (N m) on the board. stiffness: f64[s, 6, 6], negative derivative of the
    wrench with respect to a small motion (translation in m, rotation in rad) of the board relative to the object;
    symmetric, positive semidefinite. clearance_m: f64[s], lower bound of the distance between skin and object.
    touched_board_count: number of boards in contact.
    """

    wrench: FloatArray
    stiffness: FloatArray
    clearance_m: FloatArray
    touched_board_count: int


@cache
def load_contact_library() -> ctypes.CDLL:
    """Load the compiled C library that computes contact forces. Raises `ContactLibraryError` if it was not built."""
    library = load_library("taxel_contact", "the compiled contact library", ContactLibraryError)
    pointer, size = ctypes.c_void_p, ctypes.c_size_t
    library.taxel_contact_open.argtypes, library.taxel_contact_open.restype = [ctypes.c_char_p], pointer
    library.taxel_contact_close.argtypes, library.taxel_contact_close.restype = [pointer], None
    for name in ("taxel_contact_boards", "taxel_contact_taxels"):
        getattr(library, name).argtypes, getattr(library, name).restype = [pointer], size
    library.taxel_contact_bracket_offset.argtypes = [pointer, size, pointer]
    library.taxel_contact_bracket_offset.restype = None
    library.taxel_contact_set_friction.argtypes = [pointer, ctypes.c_double]
    library.taxel_contact_set_friction.restype = ctypes.c_int
    library.taxel_contact_evaluate.argtypes = [pointer, ctypes.c_int, pointer, pointer, pointer, pointer, ctypes.c_int]
    library.taxel_contact_evaluate.restype = ctypes.c_int
    return library


class SkinContact:
    """Contact of the skin of a world with the objects of that world.

    The methods take nominal poses of objects and brackets; the library applies the offsets of the world file. Use an
    instance as a context manager.

    Args:
        world: text of a world file, as `taxel.emulated.scene.format_scene` returns it.

    Raises:
        ContactLibraryError: the library is missing, or it rejects the world with the emulator's message.
    """

    def __init__(self, world: str) -> None:
        """Load the emulator's contact model of a skin. world: text of a world file with boards and objects.

        Raises `ContactLibraryError` if the library rejects the world.
        """
        self._library = load_contact_library()
        self._handle = self._open(world)
        self.board_count = int(self._library.taxel_contact_boards(self._handle))
        self.taxel_count = int(self._library.taxel_contact_taxels(self._handle))
        self._object_count = sum(line.startswith("object ") for line in world.splitlines())
        self._load = np.zeros((self.board_count, VALUES_PER_BOARD))
        self._force = np.zeros(self.taxel_count)

    def _open(self, world: str) -> int:
        """Open the world (text of a world file) in the contact library and return its handle.

        Raises `ContactLibraryError` if the library rejects the world.
        """
        with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
            path, stderr_path = Path(folder) / "world.txt", Path(folder) / "stderr.txt"
            path.write_text(world)
            with redirected_stderr(stderr_path):
                handle = self._library.taxel_contact_open(os.fsencode(path))
            if not handle:
                raise ContactLibraryError(emulator_message(stderr_path.read_text(errors="replace"), str(path), world))
            return int(handle)

    def get_bracket_offset(self, board: int) -> FloatArray:
        """Return the true pose f64[4, 4] of a board's bracket in its nominal frame. board: index in the world file."""
        self._check(0 <= board < self.board_count, f"an index from 0 to {self.board_count - 1}, found {board}")
        offset = np.eye(4)
        rows = np.zeros((3, 4))
        self._library.taxel_contact_bracket_offset(self._handle, board, rows.ctypes.data)
        offset[:3] = rows
        return offset

    def set_friction(self, coefficient: float) -> None:
        """Set the friction coefficient between skin and objects, and clear the points where the skin sticks to them.

        coefficient: 0: no friction, as after opening. Raises MemoryError.
        """
        self._check(0.0 <= coefficient < np.inf, f"a friction coefficient of at least 0, found {coefficient}")
        if self._library.taxel_contact_set_friction(self._handle, coefficient):
            raise MemoryError

    def get_handle(self, index: int) -> int:
        """Return the address of the contact in memory, for C functions that evaluate the contact themselves.

        index: number of the object that these functions will use; -1: no object. The index is only checked here,
        because the C functions treat an index out of range as no object. Raises ValueError for such an index, and for a
        closed contact.
        """
        self._check(-1 <= index < self._object_count, f"an object from -1 to {self._object_count - 1}, found {index}")
        return self._handle

    def compute_load(
        self, index: int, object_pose: FloatArray, bracket_poses: FloatArray, advance: bool = False
    ) -> ContactLoad:
        """Compute the contact load of an object on all boards: forces, moments and stiffness.

        index: number of the object in the world file; -1: no object. object_pose: f64[4, 4], bracket_poses: f64[s, 4,
        4], nominal. advance: move the points where the skin sticks to the object, which must be done once per time
        step. Raises ValueError for an index out of range or an array of another shape.
        """
        touched = self._evaluate(index, object_pose, bracket_poses, None, advance)
        # Columns of the load of a board: force and moment (0 to 5), stiffness (6 to 41), clearance (42).
        stiffness = self._load[:, 6:42].reshape(-1, 6, 6).copy()
        return ContactLoad(self._load[:, :6].copy(), stiffness, self._load[:, 42].copy(), touched)

    def compute_forces(self, index: int, object_pose: FloatArray, bracket_poses: FloatArray) -> FloatArray:
        """Compute the normal force on each taxel in newtons, f64[n], before any effect of the skin.

        index: number of the object in the world file; -1: no object. object_pose: f64[4, 4], bracket_poses: f64[s, 4,
        4], nominal.
        """
        self._evaluate(index, object_pose, bracket_poses, self._force.ctypes.data, advance=False)
        return self._force.copy()

    def _evaluate(
        self, index: int, object_pose: FloatArray, bracket_poses: FloatArray, force: int | None, advance: bool
    ) -> int:
        """Compute the contact load of all boards into `self._load`; return the number of boards in contact.

        index: number of the object; -1: no object. object_pose: f64[4, 4]. bracket_poses: f64[s, 4, 4]. force: memory
        address for the taxel forces; None: not computed. advance: move the points where the skin sticks to the object.
        """
        poses = np.ascontiguousarray(bracket_poses[:, :3, :], dtype=np.float64)
        pose = np.ascontiguousarray(object_pose[:3], dtype=np.float64)
        self._check(-1 <= index < self._object_count, f"an object from -1 to {self._object_count - 1}, found {index}")
        self._check(
            poses.shape == (self.board_count, 3, 4),
            f"poses of {self.board_count} brackets, found {bracket_poses.shape}",
        )
        self._check(pose.shape == (3, 4), f"the pose of an object, found {object_pose.shape}")
        return int(
            self._library.taxel_contact_evaluate(
                self._handle, index, pose.ctypes.data, poses.ctypes.data, self._load.ctypes.data, force, int(advance)
            )
        )

    def _check(self, is_valid: bool, expected: str) -> None:
        """Raise ValueError unless an argument is valid and the contact is open; the C library checks no argument.

        expected: what is expected and what is found, for the message.
        """
        if not (is_valid and self._handle):
            raise ValueError(f"expected {expected}" if self._handle else "expected an open contact, found a closed one")

    def close(self) -> None:
        """Release the memory of the contact library. Further calls do nothing."""
        if self._handle:
            self._library.taxel_contact_close(self._handle)
            self._handle = 0

    def __enter__(self) -> Self:
        """Return the contact model itself; it is closed at the end of the `with` block."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Release the memory of the contact library at the end of a `with` block."""
        self.close()
