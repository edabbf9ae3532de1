"""How far a set of object sizes is from the thesis's cross-shape tables: one number, 0 at best.

The cloud of each object is modelled (clouds.py), matched to every object (match.py), and the mean, RMS and largest
distance of the six pairs of different objects are compared as logarithms of ratios.
"""

from dataclasses import astuple, dataclass, field

import numpy as np
from clouds import BAND_MM, PALM_SHARE, Touch, contact_cloud, unit_samples
from match import match, starts_of
from surfaces import Prism, box, cylinder, triangle
from thesis_tables import REAL, SIMULATED, TOP_GRASP_SHARES, CloudTable

from taxel.types import FloatArray

TABLES = ((SIMULATED, 2 / 3), (REAL, 1 / 3))
"""Simulated clouds count twice: no noise, tilted object or lost taxel is in them."""

LARGEST_WEIGHT = 0.25
"""One point decides the largest distance, so it counts a quarter of the mean or the RMS."""

CROSS = ~np.eye(3, dtype=bool)


@dataclass(frozen=True)
class Sizes:
    """Sizes of the three objects, mm. side: of the triangle's base; leg: its other two sides."""

    width: float
    depth: float
    height: float
    radius: float
    cylinder_height: float
    side: float
    triangle_height: float
    leg: float

    def prisms(self) -> tuple[Prism, Prism, Prism]:
        """The objects in OBJECTS order."""
        return (
            box(self.width, self.depth, self.height),
            cylinder(self.radius, self.cylinder_height),
            triangle(self.side, self.leg, self.triangle_height),
        )

    def rounded(self) -> "Sizes":
        """The same to 1 mm; a triangle with equal sides keeps them equal."""
        return Sizes(*(float(round(size)) for size in astuple(self)))

    def circumferences(self) -> tuple[float, float, float]:
        """Lengths round the three objects, mm, in OBJECTS order."""
        return 2 * (self.width + self.depth), 2 * np.pi * self.radius, self.side + 2 * self.leg


@dataclass(frozen=True)
class Setting:
    """What the cloud model assumes. points: of each cloud; seed: of their places."""

    points: int = 128
    seed: int = 1
    band_mm: float = BAND_MM
    palm_share: float = PALM_SHARE


@dataclass(frozen=True, eq=False)
class Distances:
    """Matched distances of one source of clouds: f64[3, 3] each, mm, clouds by CAD models."""

    mean: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    rms: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    largest: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))


def touches_of(table: CloudTable, setting: Setting) -> list[Touch]:
    """How each object is touched. Offset and scatter are the table's mean and deviation against the own model."""
    return [
        Touch(share, table.mean[i, i], table.deviation[i, i], setting.band_mm, setting.palm_share)
        for i, share in enumerate(TOP_GRASP_SHARES)
    ]


def distances(sizes: Sizes, setting: Setting, own: bool = True) -> list[Distances]:
    """Match the clouds of each of TABLES to the three objects; the lowest RMS counts. own: the own pairs too."""
    prisms = sizes.prisms()
    samples = unit_samples(setting.points, setting.seed)
    clouds = [
        [contact_cloud(*pair, samples) for pair in zip(prisms, touches_of(table, setting), strict=True)]
        for table, _ in TABLES
    ]
    results = [Distances() for _ in TABLES]
    for j, prism in enumerate(prisms):
        pairs = [(t, i) for t in range(len(TABLES)) for i in range(3) if own or i != j]
        starts = [starts_of(clouds[t][i], prisms[i].height, prism.height) for t, i in pairs]
        for (t, i), found in zip(pairs, match(starts, prism), strict=True):
            results[t].mean[i, j] = found.mean()
            results[t].rms[i, j] = np.sqrt(np.mean(found**2))
            results[t].largest[i, j] = found.max()
    return results


def disagreement(ours: Distances, table: CloudTable) -> float:
    """Sum of squared log ratios over the six cross pairs, the largest distance with less weight."""
    terms = (
        (ours.mean, table.mean, 1.0),
        (ours.rms, table.rms, 1.0),
        (ours.largest, table.largest, LARGEST_WEIGHT),
    )
    return float(sum(weight * np.sum(np.log(a[CROSS] / b[CROSS]) ** 2) for a, b, weight in terms))


def objective(sizes: Sizes, setting: Setting) -> float:
    """The weighted disagreement with both tables. 0.1 is a typical ratio of about 1.09."""
    ours = distances(sizes, setting, own=False)
    return sum(weight * disagreement(d, table) for d, (table, weight) in zip(ours, TABLES, strict=True))
