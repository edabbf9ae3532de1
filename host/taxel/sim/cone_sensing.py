"""Contact as the thesis's simulator saw it: a cone on every taxel, contact points, and a threshold on their distance.

Source: thesis, section 4.2.2 and Figure 4.7. The dielectric is a pattern of rigid cones, one on each taxel, so that a
large area touches in many points. A contact point activates every taxel whose centre is nearer than the distance from
the cone's tip to the rim of its base; a base enlarged beyond the taxel activates its neighbours too and imitates how
contact spreads through the dielectric (section 5.6.2).
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.kinematics import compute_taxel_normals, compute_taxel_positions
from taxel.hand.transforms import inverse
from taxel.types import FloatArray

__all__ = ["CONE_HEIGHT_M", "CONTACT_OFFSET_M", "NOMINAL_FORCE_N", "ConeSensing", "base_radius", "nominal_forces"]

CONE_HEIGHT_M = 0.001
"""Thesis, section 4.2.2: "the distance between the center of the taxel and the contact point is supposed to be equal to
one millimeter"."""

CONTACT_OFFSET_M = 0.0002
"""How near a cone's tip counts as touching. The engine's own margin, which the thesis does not give; assumed."""

NOMINAL_FORCE_N = 2.0
"""Put on an active taxel: 1048 counts by the default sensor, far above 150. Assumed: the thesis has no forces."""


def base_radius(hand: Hand, pitches: float = 0.0) -> float:
    """Radius of a cone's base, metres: half an electrode's diagonal (2.12 mm for 3 mm), and so many pitches more."""
    return hand.size_m * float(np.sqrt(2.0)) / 2 + pitches * hand.pitch_m


@dataclass(frozen=True)
class ConeSensing:
    """The thesis's contact filter.

    base_radius_m: of the cones, see `base_radius`. contact_offset_m: distance from a cone's tip to the object's surface
    up to which it touches; may be negative, for cones that are pressed flat. cone_height_m: from taxel centre to tip.
    """

    base_radius_m: float
    contact_offset_m: float = CONTACT_OFFSET_M
    cone_height_m: float = CONE_HEIGHT_M

    @property
    def threshold_m(self) -> float:
        """Distance from tip to rim (Figure 4.7): 2.35 mm for a height of 1 mm and a base of 2.12 mm."""
        return float(np.hypot(self.cone_height_m, self.base_radius_m))

    def tips_in_contact(
        self, hand: Hand, shape: Shape, sensor_poses: npt.ArrayLike, object_poses: npt.ArrayLike
    ) -> npt.NDArray[np.bool_]:
        """Which cones touch the object, bool[T, n]. sensor_poses: f64[T, s, 4, 4]; object_poses: f64[T, 4, 4]."""
        poses = inverse(object_poses)[:, None] @ np.asarray(sensor_poses, dtype=np.float64)
        tips = compute_taxel_positions(hand, poses) + self.cone_height_m * compute_taxel_normals(hand, poses)
        return np.asarray(shape.signed_distance(tips) <= self.contact_offset_m)

    def active(
        self,
        hand: Hand,
        shape: Shape,
        sensor_poses: npt.ArrayLike,
        object_poses: npt.ArrayLike,
        contact_points: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    ) -> npt.NDArray[np.bool_]:
        """Active taxels, bool[T, n]: those within `threshold_m` of a contact point.

        Contact points are the tips of the cones that touch, and `contact_points`: the engine's own, frame [c] and
        position f64[c, 3] in the world, metres; None: none.
        """
        poses = np.asarray(sensor_poses, dtype=np.float64)
        touching = self.tips_in_contact(hand, shape, poses, object_poses)
        centres = compute_taxel_positions(hand, poses)
        tips = centres + self.cone_height_m * compute_taxel_normals(hand, poses)
        frame, point = np.zeros(0, dtype=np.intp), np.zeros((0, 3))
        if contact_points is not None:
            frame, point = np.asarray(contact_points[0], dtype=np.intp), np.asarray(contact_points[1], dtype=np.float64)
        result = np.zeros(touching.shape, dtype=bool)
        for index in np.union1d(np.flatnonzero(touching.any(axis=1)), frame):
            points = np.concatenate([tips[index, touching[index]], point[frame == index]])
            distance, _ = cKDTree(points).query(centres[index], distance_upper_bound=self.threshold_m * (1 + 1e-9))
            result[index] = np.isfinite(distance)
        return result


def nominal_forces(active: npt.NDArray[np.bool_], force_n: float = NOMINAL_FORCE_N) -> FloatArray:
    """Contact forces f64[T, n] for active taxels bool[T, n]: `force_n` on each, so that the sensor sees them too."""
    return np.where(active, force_n, 0.0)
