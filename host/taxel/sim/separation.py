"""How far every taxel's surface is from the object: along its normal, and in all directions."""

import numpy as np
import numpy.typing as npt

from taxel.errors import TaxelError
from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.kinematics import compute_taxel_normals, compute_taxel_positions
from taxel.hand.sheet import Sheet
from taxel.hand.transforms import inverse
from taxel.types import FloatArray

__all__ = ["DEEPEST_M", "MISS_M", "LayerThicknessError", "distances", "layer_thickness", "separations"]

MISS_M = 0.05
"""Separation where the normal misses or the object is farther, metres. Source: the dataset format."""

DEEPEST_M = 0.003
"""Deepest press that is one, metres: half as much again as the hand's layer of 2 mm. A surface farther inside the
object got there through another side, as that of a wrapped board's flank does."""


class LayerThicknessError(TaxelError, ValueError):
    """A hand whose description does not say how thick the soft layer is. Attribute: hand, its name."""

    def __init__(self, hand: str) -> None:
        super().__init__(hand)
        self.hand = hand

    def __str__(self) -> str:
        return f"hand {self.hand!r}: its description gives no layer thickness; add layer_m to [taxel], as 0.002"


def separations(
    hand: Hand | Sheet,
    shape: Shape,
    sensor_poses: npt.ArrayLike,
    object_poses: npt.ArrayLike,
    deepest_m: float = DEEPEST_M,
) -> FloatArray:
    """Metres from each taxel's surface to the object along the outward normal, f64[T, n]; negative: pressed in.

    The surface lies `hand.layer_m` above the electrode. The ray starts at the electrode, so that a surface inside the
    object is seen; deeper than `deepest_m` counts as a miss. `MISS_M` where the normal misses or the object is farther.

    sensor_poses: brackets in the world, f64[T, s, 4, 4]. object_poses: f64[T, 4, 4]. Raises HandGeometryError if
    the hand's description gives no positions, LayerThicknessError if it gives no layer.
    """
    layer = layer_thickness(hand)
    poses, objects = np.asarray(sensor_poses, dtype=np.float64), np.asarray(object_poses, dtype=np.float64)
    moved = _moved(poses, objects)
    points, directions = _in_object(hand, poses[moved], objects[moved])
    result = shape.ray_separation(points, directions) - layer
    result = np.where(result < -deepest_m, MISS_M, np.minimum(result, MISS_M))
    return np.asarray(result[np.cumsum(moved) - 1])


def _moved(sensor_poses: FloatArray, object_poses: FloatArray) -> npt.NDArray[np.bool_]:
    """Frames in which anything stands elsewhere than in the frame before, bool[T]: a hand that waits costs nothing."""
    moved = np.ones(len(object_poses), dtype=bool)
    boards = (sensor_poses[1:] != sensor_poses[:-1]).any(axis=(1, 2, 3))
    moved[1:] = boards | (object_poses[1:] != object_poses[:-1]).any(axis=(1, 2))
    return moved


def distances(hand: Hand | Sheet, shape: Shape, sensor_poses: npt.ArrayLike, object_poses: npt.ArrayLike) -> FloatArray:
    """Euclidean distance from each taxel's surface to the object, metres, f64[T, n]; negative inside.

    Arguments and errors as for `separations`.
    """
    points, directions = _in_object(hand, sensor_poses, object_poses)
    return shape.signed_distance(points + layer_thickness(hand) * directions)


def layer_thickness(hand: Hand | Sheet) -> float:
    """Thickness of the soft layer over the electrodes, metres. Raises LayerThicknessError if not described."""
    if hand.layer_m is None:
        raise LayerThicknessError(hand.name)
    return hand.layer_m


def _in_object(
    hand: Hand | Sheet, sensor_poses: npt.ArrayLike, object_poses: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Electrode centres and outward normals in the object's frame, each f64[T, n, 3]."""
    poses = inverse(object_poses)[:, None] @ np.asarray(sensor_poses, dtype=np.float64)
    return compute_taxel_positions(hand, poses), compute_taxel_normals(hand, poses)
