"""A model of an accumulated contact cloud: where the hand touches an upright prism on a table.

Side grasps touch the whole circumference over a band of height; top grasps touch the top face with the palm and
the upper part of the sides with the fingers; nothing touches the bottom. The points lie outside the surface by
an offset with scatter, for the taxels carry a dielectric and read beyond the contact.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc
from surfaces import Circle, Polygon, Prism

from taxel.types import FloatArray

BAND_MM = 100.0
"""Width of the band a side grasp covers, at mid height: about four fingers of an Allegro hand. Assumed."""

REACH_MM = 60.0
"""How far below the top face the fingers of a top grasp touch. Assumed."""

PALM_SHARE = 0.5
"""Share of the points of a top grasp that lie on the top face. Assumed."""


@dataclass(frozen=True)
class Touch:
    """How a cloud is spread.

    top_share: points from top grasps, 0 to 1. offset_mm, scatter_mm: mean and deviation beyond the surface.
    """

    top_share: float
    offset_mm: float
    scatter_mm: float
    band_mm: float = BAND_MM
    palm_share: float = PALM_SHARE


def unit_samples(n: int, seed: int) -> FloatArray:
    """Evenly spread random numbers in (0, 1), f64[n, 4]. Kept over a search, they make clouds change smoothly."""
    drawn = qmc.Sobol(4, seed=seed).random_base2(int(np.ceil(np.log2(n))))[:n]
    return np.clip(np.asarray(drawn, dtype=np.float64), 1e-4, 1 - 1e-4)


def contact_cloud(prism: Prism, touch: Touch, samples: FloatArray) -> FloatArray:
    """Contact points, f64[n, 3], mm, of the samples, f64[n, 4], from `unit_samples`."""
    on_top = samples[:, 2] < touch.top_share * touch.palm_share
    from_top = samples[:, 2] < touch.top_share
    flat, normal = prism.profile.at(samples[:, 0])
    band = min(touch.band_mm, prism.height)
    side_z = (prism.height - band) / 2 + band * samples[:, 1]
    reach_z = prism.height - min(REACH_MM, prism.height) * samples[:, 1]

    surface = np.column_stack([flat, np.where(from_top, reach_z, side_z)])
    surface[on_top, :2] = _inside(prism, samples[on_top])
    surface[on_top, 2] = prism.height
    outward = np.column_stack([normal, np.zeros(len(samples))])
    outward[on_top] = (0.0, 0.0, 1.0)
    beyond = touch.offset_mm + touch.scatter_mm * ndtri(samples[:, 3])
    return surface + outward * beyond[:, None]


def _inside(prism: Prism, samples: FloatArray) -> FloatArray:
    """Points spread evenly over the profile's area: the curve shrunk towards the centroid by a square root."""
    profile = prism.profile
    if isinstance(profile, Circle):
        flat, _ = profile.at(samples[:, 0])
    else:
        assert isinstance(profile, Polygon)
        flat = _by_area(profile, samples[:, 0])
    return flat * np.sqrt(samples[:, 1])[:, None]


def _by_area(profile: Polygon, u: FloatArray) -> FloatArray:
    """Curve points whose triangles with the centre sweep area, not arc length, evenly."""
    starts, ends = profile.corners, np.roll(profile.corners, -1, axis=0)
    areas = np.cumsum(starts[:, 0] * ends[:, 1] - starts[:, 1] * ends[:, 0])
    swept = u * areas[-1]
    index = np.minimum(np.searchsorted(areas, swept, side="right"), len(areas) - 1)
    before = np.concatenate([[0.0], areas[:-1]])[index]
    part = (swept - before) / (areas[index] - before)
    return np.asarray(starts[index] + (ends - starts)[index] * part[:, None])
