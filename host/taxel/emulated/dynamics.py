"""Structures and functions of the emulator's C dynamics of a hand and a free object (firmware/emulator/dynamics).

The structures contain memory addresses of arrays: the code that fills them in must keep the arrays alive.
"""

import ctypes
from functools import cache
from typing import Final

import numpy as np

from taxel.emulated.contact import ContactLibraryError, load_contact_library
from taxel.types import FloatArray

OBJECT_DOF: Final = 6
JOINT_VALUES: Final = 5
"""Values of `struct joint`: lower and upper limit, angle, speed, unloaded angle of the dry friction; all f64."""

_POINTER, _SIZE, _REAL = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_double
_FRAME = _REAL * 12


class ObjectStruct(ctypes.Structure):
    """C structure `struct free_object` of firmware/emulator/dynamics/free_object.h."""

    _fields_ = [
        ("mass_kg", _REAL),
        ("gravity_m_per_s2", _REAL),
        ("centre", _REAL * 3),
        ("inertia", _REAL * 9),
        ("up", _REAL * 3),
        ("level", _REAL),
        ("stand_rate", _REAL),
        ("stand_friction", _REAL),
        ("steadying_rate", _REAL * 2),
        ("steadying_damping", _REAL * 2),
        ("vertex_count", _SIZE),
        ("vertices", _POINTER),
        ("stuck", _POINTER),
        ("pose", _FRAME),
        ("steadied_pose", _FRAME),
        ("firmness", _REAL),
    ]


class TreeStruct(ctypes.Structure):
    """C structure `struct kinematic_tree` of firmware/emulator/dynamics/kinematics.h."""

    _fields_ = [
        ("link_count", _SIZE),
        ("joint_count", _SIZE),
        ("board_count", _SIZE),
        ("parent", _POINTER),
        ("joint", _POINTER),
        ("origin", _POINTER),
        ("axis", _POINTER),
        ("board_link", _POINTER),
        ("bracket", _POINTER),
        ("mounting", _POINTER),
    ]


class HandStruct(ctypes.Structure):
    """C structure `struct hand_dynamics` of firmware/emulator/dynamics/hand_dynamics.h."""

    _fields_ = [
        ("tree", TreeStruct),
        ("joint_inertia_kg_m2", _REAL),
        ("joint_damping_nm_s", _REAL),
        ("joint_friction_nm", _REAL),
        ("joint_breakaway_rad", _REAL),
        ("joint_stop_nm_per_rad", _REAL),
        ("joint_stop_nm_s_per_rad", _REAL),
        ("longest_s", _REAL),
        ("shortest_s", _REAL),
        ("motion_m", _REAL),
        ("board_radius_m", _REAL),
        ("contact", _POINTER),
        ("object_index", ctypes.c_int32),
        ("object", ctypes.POINTER(ObjectStruct)),
        ("touched_count", ctypes.c_int32),
        ("joints", _POINTER),
        ("object_velocity", _REAL * OBJECT_DOF),
        ("wrist", _FRAME),
        ("wrist_before", _FRAME),
    ]


@cache
def load_dynamics_library() -> ctypes.CDLL:
    """Load the compiled C library that computes the dynamics of hand and object.

    Raises `ContactLibraryError` if the library is missing. Also raises it if a C structure has another size than its
    Python counterpart, because the library then belongs to another version of the package.
    """
    library = load_contact_library()
    sizes = (_SIZE * 5)()
    library.taxel_dynamics_sizes(sizes)
    if (sizes[0], sizes[1]) != (ctypes.sizeof(HandStruct), ctypes.sizeof(ObjectStruct)):
        raise ContactLibraryError(
            "the compiled contact library belongs to another version of the package; install taxel again "
            "(pip install .)"
        )
    arguments = {
        "step": [ctypes.POINTER(HandStruct), _POINTER, _REAL],
        "brackets": [ctypes.POINTER(HandStruct), _POINTER],
        "support": [ctypes.POINTER(ObjectStruct), _POINTER, _POINTER],
        "steadying": [ctypes.POINTER(ObjectStruct), _POINTER, _POINTER, _POINTER],
        "move": [ctypes.POINTER(ObjectStruct), _POINTER, _REAL],
    }
    for name, types in arguments.items():
        function = getattr(library, f"taxel_dynamics_{name}")
        function.argtypes, function.restype = types, None
    return library


@cache
def load_size_limits() -> tuple[int, int, int]:
    """Return the largest numbers of links, revolute joints and boards of a hand in the C library."""
    sizes = (_SIZE * 5)()  # the first two elements are sizes of C structures
    load_dynamics_library().taxel_dynamics_sizes(sizes)
    return sizes[2], sizes[3], sizes[4]


def view_frame(frame: ctypes.Array[ctypes.c_double]) -> FloatArray:
    """Return the three rows f64[3, 4] of a rigid transform in a structure; writing into them changes the structure."""
    return np.asarray(np.ctypeslib.as_array(frame)).reshape(3, 4)


def make_pose(frame: ctypes.Array[ctypes.c_double]) -> FloatArray:
    """Return the rigid transform in a field of a C structure (three rows of four numbers) as a new array f64[4, 4]."""
    pose = np.eye(4)
    pose[:3] = view_frame(frame)
    return pose
