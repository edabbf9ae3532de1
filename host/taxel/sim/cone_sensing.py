"""The contact model of the thesis's simulator: a cone on every taxel, and a distance threshold for contact points.

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

__all__ = [
    "CONE_HEIGHT_M",
    "CONTACT_OFFSET_M",
    "NOMINAL_FORCE_N",
    "ConeSensing",
    "assign_nominal_force",
    "compute_base_radius",
]

CONE_HEIGHT_M = 0.001
"""Height of a cone, metres. Source: thesis, section 4.2.2: "the distance between the center of the taxel and the
contact point is supposed to be equal to one millimeter".
"""

CONTACT_OFFSET_M = 0.0002
"""Distance from a cone's tip to the object up to which the cone touches, metres. Assumed: the contact margin of the
thesis's engine, which the thesis does not state. A larger value activates more taxels.
"""

NOMINAL_FORCE_N = 2.0
"""Force assigned to an active taxel, newtons. Assumed, since the thesis has no forces; the default sensor converts the
force to a signal of 1048 counts, well above the activation threshold of 150 counts.
"""


def compute_base_radius(hand: Hand, pitches: float = 0.0) -> float:
    """Compute the radius of the base of a taxel's sensing cone, metres.

    The radius is half the diagonal of an electrode (2.12 mm for 3 mm) plus `pitches` pitches.
    """
    return hand.size_m * float(np.sqrt(2.0)) / 2 + pitches * hand.pitch_m


@dataclass(frozen=True)
class ConeSensing:
    """The contact model of the thesis: each taxel has a cone, whose tip detects a contact.

    base_radius_m: radius of a cone's base, see `compute_base_radius`. contact_offset_m: distance from a cone's tip to
    the object's surface up to which the cone touches; negative for cones that are compressed. cone_height_m: distance
    from taxel centre to tip.
    """

    base_radius_m: float
    contact_offset_m: float = CONTACT_OFFSET_M
    cone_height_m: float = CONE_HEIGHT_M

    @property
    def threshold_m(self) -> float:
        """Largest distance from the centre of a taxel to a contact point that activates the taxel, metres.

        Equal to the distance from the tip of a cone to the rim of its base (Figure 4.7): 2.35 mm for a height of 1 mm
        and a base radius of 2.12 mm.
        """
        return float(np.hypot(self.cone_height_m, self.base_radius_m))

    def find_touching_tips(
        self, hand: Hand, shape: Shape, sensor_poses: npt.ArrayLike, object_poses: npt.ArrayLike
    ) -> npt.NDArray[np.bool_]:
        """Return the taxels whose sensing cones touch the object with their tips, bool[T, n].

        sensor_poses: f64[T, s, 4, 4], brackets in the world. object_poses: f64[T, 4, 4].
        """
        poses = inverse(object_poses)[:, None] @ np.asarray(sensor_poses, dtype=np.float64)
        tips = compute_taxel_positions(hand, poses) + self.cone_height_m * compute_taxel_normals(hand, poses)
        return np.asarray(shape.signed_distance(tips) <= self.contact_offset_m)

    def find_active(
        self,
        hand: Hand,
        shape: Shape,
        sensor_poses: npt.ArrayLike,
        object_poses: npt.ArrayLike,
        contact_points: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    ) -> npt.NDArray[np.bool_]:
        """Find the active taxels, bool[T, n]: those with a contact point within `threshold_m` of their centre.

        The contact points are the tips of the touching cones and the c points `contact_points` of the physics engine:
        index of the time frame int[c], and position f64[c, 3] in the world, metres; None: only the tips.
        """
        poses = np.asarray(sensor_poses, dtype=np.float64)
        touching = self.find_touching_tips(hand, shape, poses, object_poses)
        centres = compute_taxel_positions(hand, poses)
        tips = centres + self.cone_height_m * compute_taxel_normals(hand, poses)
        frame, point = np.zeros(0, dtype=np.intp), np.zeros((0, 3))
        if contact_points is not None:
            frame, point = np.asarray(contact_points[0], dtype=np.intp), np.asarray(contact_points[1], dtype=np.float64)
        result = np.zeros(touching.shape, dtype=bool)
        for index in np.union1d(np.flatnonzero(touching.any(axis=1)), frame):
            points = np.concatenate([tips[index, touching[index]], point[frame == index]])
            # cKDTree excludes its bound; the factor includes a point exactly at the threshold.
            distance, _ = cKDTree(points).query(centres[index], distance_upper_bound=self.threshold_m * (1 + 1e-9))
            result[index] = np.isfinite(distance)
        return result


def assign_nominal_force(active: npt.NDArray[np.bool_], force_n: float = NOMINAL_FORCE_N) -> FloatArray:
    """Return contact forces f64[T, n], newtons: `force_n` on the active taxels bool[T, n], 0 on all others."""
    return np.where(active, force_n, 0.0)
