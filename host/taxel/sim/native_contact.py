"""The contact of the elastic layer in C (`native/`), called through ctypes: `SoftContact` in less time."""

import ctypes
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand import Hand
from taxel.hand.sheet import build_sheet
from taxel.sim.sim_library import ReferencedArrays, check_structure, load_sim_library
from taxel.sim.soft_contact import MAX_DEPTH_M, MIN_SLOPE, SPRINGS_PER_SIDE, LayerFriction, LayerLaw, SoftLoad
from taxel.types import FloatArray

NEAR_M = 0.001
"""Search distance, metres: pieces farther from the object are ignored until their board has moved by this distance
relative to the object. The value changes the computing time, not the result.
"""

_NO_TAXEL = np.iinfo(np.uint32).max


class _Layer(ctypes.Structure):
    """C structure `struct sim_layer` of native/layer_contact.h: the layer with its force law and the touching solid."""

    _fields_ = [
        ("boards", ctypes.c_size_t),
        ("square_pieces", ctypes.c_size_t),
        ("first", ctypes.c_void_p),
        ("position", ctypes.c_void_p),
        ("normal", ctypes.c_void_p),
        ("half_sides", ctypes.c_void_p),
        ("area_share", ctypes.c_void_p),
        ("taxel", ctypes.c_void_p),
        ("board_size", ctypes.c_void_p),
        ("square_size_m", ctypes.c_double),
        ("piece_size_m", ctypes.c_double),
        ("thickness_m", ctypes.c_double),
        ("near_m", ctypes.c_double),
        ("max_depth_m", ctypes.c_double),
        ("min_slope", ctypes.c_double),
        ("stiffness_n_per_m", ctypes.c_double),
        ("stiffening_m", ctypes.c_double),
        ("closing_m", ctypes.c_double),
        ("solid_m", ctypes.c_double),
        ("straight_m", ctypes.c_double),
        ("friction_coefficient", ctypes.c_double),
        ("shear_stiffness_n_per_m", ctypes.c_double),
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
        ("search_pose", ctypes.c_void_p),
        ("slack_m", ctypes.c_void_p),
        ("clearance_m", ctypes.c_void_p),
        ("anchor", ctypes.c_void_p),
        ("touched", ctypes.c_void_p),
    ]


_PIECE_ARRAYS = ("first", "position", "normal", "half_sides", "area_share", "taxel")
"""Arrays of a `_PieceTable` to which `_Layer` points."""


class _PieceTable(NamedTuple):
    """Pieces of a sheet sorted by board, in the memory layout of the library.

    p pieces, s boards, lengths in metres. first: index of the first piece of each board, [s + 1]. position, normal:
    f64[p, 3], bracket frame. half_sides: f64[p, 2, 3], half of each side of a piece, bracket frame. area_share: f64[p],
    area relative to that of the force law. taxel: u32[p], `_NO_TAXEL` for a piece of the margin, which has no
    electrode. board_size: f64[s], largest distance of a point of a piece from the bracket's origin. square_size_m:
    largest distance of a piece from the middle of its square. piece_size_m: largest distance of a point of a piece from
    the middle of the piece.
    """

    first: npt.NDArray[np.uintp]
    position: FloatArray
    normal: FloatArray
    half_sides: FloatArray
    area_share: FloatArray
    taxel: npt.NDArray[np.uint32]
    board_size: FloatArray
    square_size_m: float
    piece_size_m: float


@cache
def _build_table(hand: Hand) -> _PieceTable:
    """Build the table of the square pieces of a hand's sheet, sorted by board.

    The result is cached, because all grasps of a hand use the same table.
    """
    sheet = build_sheet(hand, SPRINGS_PER_SIDE)
    order = np.argsort(
        sheet.board_index, kind="stable"
    )  # a sheet numbers squares without an electrode after all taxels
    position, normal = (np.ascontiguousarray(part[order], dtype=np.float64) for part in (sheet.position, sheet.normal))
    half_sides = np.ascontiguousarray(sheet.half_sides[order])
    area_share = np.ascontiguousarray(sheet.area_share[order])
    first = np.searchsorted(sheet.board_index[order], np.arange(len(hand.boards) + 1)).astype(np.uintp)
    square = order // SPRINGS_PER_SIDE**2
    taxel = np.where(square < hand.n_taxels, square, _NO_TAXEL).astype(np.uint32)
    piece_size = float(np.linalg.norm(sheet.size, axis=1).max()) / 2
    radius = np.linalg.norm(position, axis=1) + piece_size
    board_size = [radius[begin:end].max(initial=0.0) for begin, end in pairwise(first)]
    squares = position.reshape(-1, SPRINGS_PER_SIDE**2, 3)
    square_size = np.linalg.norm(squares - squares[:, SPRINGS_PER_SIDE**2 // 2, None], axis=2).max()
    sizes = np.array(board_size), float(square_size), piece_size
    return _PieceTable(first, position, normal, half_sides, area_share, taxel, *sizes)


class NativeContact:
    """Contact of the soft layer with a solid (`taxel.sim.soft_contact.LayerContact`), computed in C.

    law: force law of the layer on one taxel. friction: of the layer's surface on the solid; None: `LayerFriction()`.
    address: of the C structure `struct sim_layer`, valid as long as this object.
    Raises `SimLibraryError`, and TypeError for a shape that the library does not support.
    """

    def __init__(self, hand: Hand, shape: Shape, law: LayerLaw, friction: LayerFriction | None = None) -> None:
        """Prepare the contact of the hand's dielectric layer with a solid for the C library.

        hand: the skin, whose taxels are divided into square columns. shape: the touching solid. law: force law of the
        layer on one taxel. friction: of the layer's surface on the solid. The C structure points into NumPy arrays,
        which this object keeps alive. Raises SimLibraryError if the library is missing, and TypeError for a shape that
        the library does not support.
        """
        library = load_sim_library()
        check_structure(library, "sim_layer", _Layer)
        self._call = library.sim_layer_load
        self._boards, self._taxels = len(hand.boards), hand.n_taxels
        self._arrays = ReferencedArrays()
        table = _build_table(hand)
        self._clearances_m = np.zeros(self._boards)
        solid = self._describe_solid(shape)
        faces = int(solid["faces"])
        friction = friction or LayerFriction()
        self._layer = _Layer(
            boards=self._boards,
            square_pieces=SPRINGS_PER_SIDE**2,
            **{name: self._arrays.add(getattr(table, name)) for name in _PIECE_ARRAYS},
            board_size=self._arrays.add(table.board_size),
            square_size_m=table.square_size_m,
            piece_size_m=table.piece_size_m,
            thickness_m=hand.layer_m or 0.0,
            near_m=NEAR_M,
            max_depth_m=MAX_DEPTH_M,
            min_slope=MIN_SLOPE,
            **vars(law),
            friction_coefficient=friction.coefficient,
            shear_stiffness_n_per_m=friction.stiffness_n_per_m,
            **solid,
            near=self._arrays.add(np.empty(len(table.position), np.uint32)),
            near_count=self._arrays.add(np.zeros(self._boards, np.uintp)),
            near_normals=self._arrays.add(np.empty((self._boards, faces, 3))),
            near_offsets=self._arrays.add(np.empty((self._boards, faces))),
            near_faces=self._arrays.add(np.zeros(self._boards, np.uintp)),
            search_pose=self._arrays.add(np.zeros((self._boards, 4, 4))),
            slack_m=self._arrays.add(np.full(self._boards, -1.0)),  # below 0: a search is due
            clearance_m=self._arrays.add(self._clearances_m),
            anchor=self._arrays.add(np.zeros((len(table.position), 3))),
            touched=self._arrays.add(np.zeros(len(table.position))),
        )
        self.address = ctypes.addressof(self._layer)

    def _describe_solid(self, shape: Shape) -> dict[str, float]:
        """Return the fields of the C structure `_Layer` that describe the shape of the touching solid.

        Raises TypeError for a shape that is neither a cylinder nor a convex polytope.
        """
        if isinstance(shape, Cylinder):
            return {"faces": 0, "radius": shape.radius, "height": shape.height}
        if isinstance(shape, ConvexPolytope):
            normals, offsets = (np.ascontiguousarray(part) for part in (shape.normals, shape.offsets))
            return {"faces": len(offsets), "normals": self._arrays.add(normals), "offsets": self._arrays.add(offsets)}
        raise TypeError(f"shape: expected a Cylinder or a ConvexPolytope, found {type(shape).__name__}")

    def compute_load(self, sensor_poses: FloatArray, object_pose: FloatArray, advance: bool = False) -> SoftLoad:
        """Compute the contact load on every board: wrench and stiffness, world frame, about each bracket's origin.

        sensor_poses: f64[s, 4, 4], brackets in the world. object_pose: f64[4, 4], world. advance: store where the
        columns stick to the object.
        """
        return self._compute(sensor_poses, object_pose, None, advance)

    def get_clearances(self) -> FloatArray:
        """Return a lower bound of the distance of each board's layer from the solid at the last load, f64[s], m.

        0 before the first load.
        """
        return self._clearances_m.copy()

    def compute_taxel_forces(self, sensor_poses: FloatArray, object_pose: FloatArray) -> FloatArray:
        """Compute the contact force on each taxel, f64[n], newtons.

        sensor_poses: f64[s, 4, 4], brackets in the world. object_pose: f64[4, 4], world.
        """
        force = np.zeros(self._taxels)
        self._compute(sensor_poses, object_pose, force.ctypes.data, advance=False)
        return force

    def _compute(self, sensor_poses: FloatArray, object_pose: FloatArray, force: int | None, advance: bool) -> SoftLoad:
        """Compute the load on the boards with the C library.

        sensor_poses: f64[s, 4, 4] and object_pose: f64[4, 4], world. force: address of the f64[n] to which taxel forces
        are written, or None. advance: store where the columns stick to the object.
        """
        poses = np.ascontiguousarray(sensor_poses, dtype=np.float64)
        pose = np.ascontiguousarray(object_pose, dtype=np.float64)
        if poses.shape != (self._boards, 4, 4) or pose.shape != (4, 4):  # the library does not check its arguments
            raise ValueError(
                f"expected poses [{self._boards}, 4, 4] of brackets and [4, 4] of an object, "
                f"found {poses.shape} and {pose.shape}"
            )
        result = SoftLoad(np.empty((self._boards, 6)), np.empty((self._boards, 6, 6)))
        wrench, stiffness = (part.ctypes.data for part in result)
        self._call(self.address, poses.ctypes.data, pose.ctypes.data, wrench, stiffness, force, int(advance))
        return result
