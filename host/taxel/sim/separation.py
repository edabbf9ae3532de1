"""Separation of every taxel from the object, along the taxel's normal."""

import numpy as np
import numpy.typing as npt

from taxel.errors import TaxelError
from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.kinematics import compute_taxel_normals, compute_taxel_positions
from taxel.hand.sheet import Sheet
from taxel.hand.transforms import inverse
from taxel.types import BoolArray, FloatArray

__all__ = ["MAX_INDENTATION_M", "MISS_M", "LayerThicknessError", "compute_separations", "get_layer_thickness"]

MISS_M = 0.05
"""Separation stored where the normal misses the object or the object is farther away, metres. Source: the dataset
format.
"""

MAX_INDENTATION_M = 0.003
"""Largest indentation that is treated as contact, metres: 1.5 times the 2 mm layer of the hand (chosen). A taxel
surface deeper inside the object entered through another side, such as the flank of a wrapped board.
"""


class LayerThicknessError(TaxelError, ValueError):
    """The description of a hand gives no thickness of the soft layer. Attribute: hand, name of the hand."""

    def __init__(self, hand: str) -> None:
        """Create the error for a hand description without the thickness of the soft layer; hand: its name."""
        super().__init__(hand)
        self.hand = hand

    def _format_message(self) -> str:
        return f"hand {self.hand!r}: its description gives no layer thickness; add layer_m to [taxel], such as 0.002"


def compute_separations(
    hand: Hand | Sheet,
    shape: Shape,
    sensor_poses: npt.ArrayLike,
    object_poses: npt.ArrayLike,
    max_indentation_m: float = MAX_INDENTATION_M,
) -> FloatArray:
    """Compute the distance from each taxel's surface to the object along the outward normal, f64[T, n], metres.

    The distance is negative for an indented taxel, and `MISS_M` where the normal misses the object or the object is
    farther away. The surface lies `hand.layer_m` above the electrode. The ray starts at the electrode, so that a
    surface inside the object is detected; an indentation above `max_indentation_m` is treated as a miss.

    sensor_poses: brackets in the world, f64[T, s, 4, 4]. object_poses: f64[T, 4, 4]. Raises HandGeometryError if
    the hand's description gives no positions, LayerThicknessError if it gives no layer.
    """
    layer = get_layer_thickness(hand)
    poses, objects = np.asarray(sensor_poses, dtype=np.float64), np.asarray(object_poses, dtype=np.float64)
    moved = _find_motion(poses, objects)
    points, directions = _transform_taxels(hand, poses[moved], objects[moved])
    result = shape.ray_separation(points, directions) - layer
    result = np.where(result < -max_indentation_m, MISS_M, np.minimum(result, MISS_M))
    # A frame without motion gets the result of the latest frame with motion.
    return np.asarray(result[np.cumsum(moved) - 1])


def _find_motion(sensor_poses: FloatArray, object_poses: FloatArray) -> BoolArray:
    """Return the frames in which a board or the object has moved since the frame before, bool[T].

    The first frame is true. Separations are computed only for these frames, so that a hand at rest costs no time.
    """
    moved = np.ones(len(object_poses), dtype=bool)
    boards = (sensor_poses[1:] != sensor_poses[:-1]).any(axis=(1, 2, 3))
    moved[1:] = boards | (object_poses[1:] != object_poses[:-1]).any(axis=(1, 2))
    return moved


def get_layer_thickness(hand: Hand | Sheet) -> float:
    """Return the thickness of the soft layer over the electrodes, metres.

    Raises LayerThicknessError if the hand description does not state it.
    """
    if hand.layer_m is None:
        raise LayerThicknessError(hand.name)
    return hand.layer_m


def _transform_taxels(
    hand: Hand | Sheet, sensor_poses: npt.ArrayLike, object_poses: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Compute electrode centres and outward normals of all taxels in the object's frame, f64[T, n, 3] each."""
    poses = inverse(object_poses)[:, None] @ np.asarray(sensor_poses, dtype=np.float64)
    return compute_taxel_positions(hand, poses), compute_taxel_normals(hand, poses)
