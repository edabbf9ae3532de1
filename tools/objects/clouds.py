"""Model of an accumulated contact cloud: the points at which the hand touches an upright prism on a table.

Side grasps touch the whole circumference over a range of heights. Top grasps touch the top face with the palm and the
upper part of the sides with the fingers. The bottom is not touched. The points are outside the surface at a random
distance, because the taxels have a dielectric layer and also detect contacts beside them.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc
from surfaces import Circle, Polygon, Prism

from taxel.types import FloatArray

BAND_MM = 100.0
"""Height range that a side grasp touches, around the middle of the object, mm: about four fingers of an Allegro hand.
Assumed; a larger value makes the heights of the objects matter more.
"""

REACH_MM = 60.0
"""Distance below the top face that the fingers of a top grasp touch, mm. Assumed."""

PALM_SHARE = 0.5
"""Share of the points of a top grasp that are on the top face. Assumed."""


@dataclass(frozen=True)
class ContactDistribution:
    """Distribution of the points of a cloud.

    top_share: share of points from top grasps, 0 to 1. offset_mm, std_mm: mean and standard deviation of the distance
    outside the surface. band_mm, palm_share: see `BAND_MM` and `PALM_SHARE`.
    """

    top_share: float
    offset_mm: float
    std_mm: float
    band_mm: float = BAND_MM
    palm_share: float = PALM_SHARE


def sample_unit_cube(n: int, seed: int) -> FloatArray:
    """Return n quasi-random points (Sobol) of the four-dimensional unit cube, f64[n, 4].

    The same seed gives the same points, so a cloud changes smoothly with the sizes of its object. The coordinates are
    at least 1e-4 from 0 and 1, where the normal quantile of `build_contact_cloud` is infinite.
    """
    samples = qmc.Sobol(4, seed=seed).random_base2(int(np.ceil(np.log2(n))))[:n]
    return np.clip(np.asarray(samples, dtype=np.float64), 1e-4, 1 - 1e-4)


def build_contact_cloud(prism: Prism, distribution: ContactDistribution, samples: FloatArray) -> FloatArray:
    """Return the contact points f64[n, 3] of a modelled hand on a prism, mm.

    samples: f64[n, 4], result of `sample_unit_cube`: place on the outline, height, kind of grasp, distance from the
    surface.
    """
    on_top = samples[:, 2] < distribution.top_share * distribution.palm_share
    from_top = samples[:, 2] < distribution.top_share
    curve, normal = prism.profile.evaluate(samples[:, 0])
    band = min(distribution.band_mm, prism.height)
    side_z = (prism.height - band) / 2 + band * samples[:, 1]
    reach_z = prism.height - min(REACH_MM, prism.height) * samples[:, 1]

    surface = np.column_stack([curve, np.where(from_top, reach_z, side_z)])
    surface[on_top, :2] = _sample_face(prism, samples[on_top])
    surface[on_top, 2] = prism.height
    outward = np.column_stack([normal, np.zeros(len(samples))])
    outward[on_top] = (0.0, 0.0, 1.0)
    distance = distribution.offset_mm + distribution.std_mm * ndtri(samples[:, 3])
    return surface + outward * distance[:, None]


def _sample_face(prism: Prism, samples: FloatArray) -> FloatArray:
    """Return points f64[n, 2] on the top face of a prism, uniformly distributed. samples: f64[n, 4], numbers in (0, 1).

    Points of the outline are scaled towards the centre by the root of a uniform number.
    """
    profile = prism.profile
    if isinstance(profile, Circle):
        curve, _ = profile.evaluate(samples[:, 0])
    else:
        assert isinstance(profile, Polygon)
        curve = _sample_curve_by_area(profile, samples[:, 0])
    return curve * np.sqrt(samples[:, 1])[:, None]


def _sample_curve_by_area(profile: Polygon, u: FloatArray) -> FloatArray:
    """Return the outline points f64[n, 2] that belong to the uniform numbers u f64[n].

    The sector from the first corner to the outline point, seen from the centre, has the share u of the polygon's area,
    so equal intervals of u are sectors of equal area.
    """
    starts, ends = profile.corners, np.roll(profile.corners, -1, axis=0)
    areas = np.cumsum(starts[:, 0] * ends[:, 1] - starts[:, 1] * ends[:, 0])
    swept = u * areas[-1]
    index = np.minimum(np.searchsorted(areas, swept, side="right"), len(areas) - 1)
    before = np.concatenate([[0.0], areas[:-1]])[index]
    part = (swept - before) / (areas[index] - before)
    return np.asarray(starts[index] + (ends - starts)[index] * part[:, None])
