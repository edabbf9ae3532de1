"""The elastic layer's contact in C (`native/`), called through ctypes: what `SoftContact` computes, and faster."""

import ctypes
from functools import cache
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from taxel.errors import TaxelError
from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand import Hand
from taxel.hand.sheet import build_sheet
from taxel.native_library import load_library
from taxel.sim.soft_contact import DEEPEST_M, PARTS, LayerLaw, SoftLoad
from taxel.types import FloatArray

NEAR_M = 0.001
"""Pieces whose layer is farther from the object are left out until their board has moved by as much against it."""

_NOBODYS = np.iinfo(np.uint32).max


class SimLibraryError(TaxelError):
    """The simulator's compiled library is missing or is not the one that this package was built with."""


class _Layer(ctypes.Structure):
    """`struct sim_layer`, with the law and the solid in it."""

    _fields_ = [
        ("boards", ctypes.c_size_t),
        ("square_pieces", ctypes.c_size_t),
        ("first", ctypes.c_void_p),
        ("position", ctypes.c_void_p),
        ("normal", ctypes.c_void_p),
        ("taxel", ctypes.c_void_p),
        ("board_size", ctypes.c_void_p),
        ("square_size_m", ctypes.c_double),
        ("thickness_m", ctypes.c_double),
        ("near_m", ctypes.c_double),
        ("deepest_m", ctypes.c_double),
        ("stiffness_n_per_m", ctypes.c_double),
        ("stiffening_m", ctypes.c_double),
        ("closing_m", ctypes.c_double),
        ("straight_m", ctypes.c_double),
        ("faces", ctypes.c_size_t),
        ("normals", ctypes.c_void_p),
        ("offsets", ctypes.c_void_p),
        ("radius", ctypes.c_double),
        ("height", ctypes.c_double),
        ("near", ctypes.c_void_p),
        ("near_count", ctypes.c_void_p),
        ("near_normals", ctypes.c_void_p),
        ("near_offsets", ctypes.c_void_p),
        ("near_faces", ctypes.c_void_p),
        ("looked", ctypes.c_void_p),
        ("slack_m", ctypes.c_void_p),
    ]


@cache
def sim_library() -> ctypes.CDLL:
    """The loaded library. Raises `SimLibraryError` if it was not built."""
    library = load_library("taxel_sim", "the simulator's compiled library", SimLibraryError)
    library.sim_layer_struct_size.restype = ctypes.c_size_t
    library.sim_layer_load.argtypes = [ctypes.c_void_p] * 6
    library.sim_layer_load.restype = None
    if library.sim_layer_struct_size() != ctypes.sizeof(_Layer):
        raise SimLibraryError(
            "the simulator's compiled library belongs to another version of the package; install taxel again "
            "(pip install .)"
        )
    return library


class _Table(NamedTuple):
    """The sheet's pieces, board after board, as the library takes them."""

    first: npt.NDArray[np.uintp]
    position: FloatArray
    normal: FloatArray
    taxel: npt.NDArray[np.uint32]
    board_size: FloatArray
    square_size_m: float


@cache
def _table(hand: Hand) -> _Table:
    sheet = build_sheet(hand, PARTS)
    order = np.argsort(sheet.board_index, kind="stable")  # a sheet's bare squares come after all taxels
    position, normal = (np.ascontiguousarray(part[order], dtype=np.float64) for part in (sheet.position, sheet.normal))
    first = np.searchsorted(sheet.board_index[order], np.arange(len(hand.boards) + 1)).astype(np.uintp)
    square = order // PARTS**2
    taxel = np.where(square < hand.n_taxels, square, _NOBODYS).astype(np.uint32)
    away = np.linalg.norm(position, axis=1)
    size = [away[begin:end].max(initial=0.0) for begin, end in pairwise(first)]
    squares = position.reshape(-1, PARTS**2, 3)
    spread = np.linalg.norm(squares - squares[:, PARTS**2 // 2, None], axis=2).max()
    return _Table(first, position, normal, taxel, np.array(size), float(spread))


class NativeContact:
    """See `taxel.sim.soft_contact.LayerContact`. `law`: of the layer under one taxel.

    Raises `SimLibraryError`, and TypeError for a shape that the library does not know.
    """

    def __init__(self, hand: Hand, shape: Shape, law: LayerLaw) -> None:
        self._call = sim_library().sim_layer_load
        self._boards, self._taxels = len(hand.boards), hand.n_taxels
        self._kept: list[npt.NDArray[Any]] = []
        table = _table(hand)
        unseen = np.full(self._boards, -1.0)
        solid = self._solid(shape)
        faces = int(solid["faces"])
        self._layer = _Layer(
            boards=self._boards,
            square_pieces=PARTS**2,
            **{name: self._keep(getattr(table, name)) for name in ("first", "position", "normal", "taxel")},
            board_size=self._keep(table.board_size),
            square_size_m=table.square_size_m,
            thickness_m=hand.layer_m or 0.0,
            near_m=NEAR_M,
            deepest_m=DEEPEST_M,
            **vars(law),
            **solid,
            near=self._keep(np.empty(len(table.position), np.uint32)),
            near_count=self._keep(np.zeros(self._boards, np.uintp)),
            near_normals=self._keep(np.empty((self._boards, faces, 3))),
            near_offsets=self._keep(np.empty((self._boards, faces))),
            near_faces=self._keep(np.zeros(self._boards, np.uintp)),
            looked=self._keep(np.zeros((self._boards, 4, 4))),
            slack_m=self._keep(unseen),
        )
        self._address = ctypes.addressof(self._layer)

    def _keep(self, array: npt.NDArray[Any]) -> int:
        """Its address, for as long as this contact lives."""
        self._kept.append(array)
        return int(array.ctypes.data)

    def _solid(self, shape: Shape) -> dict[str, float]:
        if isinstance(shape, Cylinder):
            return {"faces": 0, "radius": shape.radius, "height": shape.height}
        if isinstance(shape, ConvexPolytope):
            normals, offsets = (np.ascontiguousarray(part) for part in (shape.normals, shape.offsets))
            return {"faces": len(offsets), "normals": self._keep(normals), "offsets": self._keep(offsets)}
        raise TypeError(f"shape: expected a Cylinder or a ConvexPolytope, found {type(shape).__name__}")

    def load(self, sensor_poses: FloatArray, object_pose: FloatArray) -> SoftLoad:
        """See `LayerContact`."""
        return self._load(sensor_poses, object_pose, None)

    def taxel_forces(self, sensor_poses: FloatArray, object_pose: FloatArray) -> FloatArray:
        """See `LayerContact`."""
        force = np.zeros(self._taxels)
        self._load(sensor_poses, object_pose, force.ctypes.data)
        return force

    def _load(self, sensor_poses: FloatArray, object_pose: FloatArray, force: int | None) -> SoftLoad:
        poses = np.ascontiguousarray(sensor_poses, dtype=np.float64)
        pose = np.ascontiguousarray(object_pose, dtype=np.float64)
        if poses.shape != (self._boards, 4, 4) or pose.shape != (4, 4):  # the library checks nothing
            raise ValueError(
                f"expected poses [{self._boards}, 4, 4] of brackets and [4, 4] of an object, "
                f"found {poses.shape} and {pose.shape}"
            )
        result = SoftLoad(np.empty((self._boards, 6)), np.empty((self._boards, 6, 6)))
        wrench, stiffness = (part.ctypes.data for part in result)
        self._call(self._address, poses.ctypes.data, pose.ctypes.data, wrench, stiffness, force)
        return result
