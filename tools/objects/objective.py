"""Deviation of a set of object sizes from the thesis's cross-shape tables, as one number that is 0 for equality.

The cloud of each object is modelled (clouds.py) and registered to every object (match.py). The mean, RMS and largest
distances of the six pairs of different objects are compared by the logarithms of their ratios.
"""

from dataclasses import astuple, dataclass, field

import numpy as np
from clouds import BAND_MM, PALM_SHARE, ContactDistribution, build_contact_cloud, sample_unit_cube
from match import build_starting_clouds, match_clouds
from surfaces import Prism, make_box, make_cylinder, make_triangle
from thesis_tables import REAL, SIMULATED, TOP_GRASP_SHARES, CloudTable

from taxel.types import FloatArray

TABLES = ((SIMULATED, 2 / 3), (REAL, 1 / 3))
"""Tables and their weights. Simulated clouds have twice the weight, because they contain no noise, no tilted object and
no failed taxel.
"""

LARGEST_WEIGHT = 0.25
"""Weight of the largest distance relative to the mean and the RMS. It depends on one point. Chosen by judgement."""

IS_CROSS_PAIR = ~np.eye(3, dtype=bool)


@dataclass(frozen=True)
class Sizes:
    """Sizes of the three objects, mm. side: base of the triangle. leg: its other two sides."""

    width: float
    depth: float
    height: float
    radius: float
    cylinder_height: float
    side: float
    triangle_height: float
    leg: float

    def prisms(self) -> tuple[Prism, Prism, Prism]:
        """Return the three objects with these sizes as prisms, in the order of OBJECTS."""
        return (
            make_box(self.width, self.depth, self.height),
            make_cylinder(self.radius, self.cylinder_height),
            make_triangle(self.side, self.leg, self.triangle_height),
        )

    def rounded(self) -> "Sizes":
        """Return the sizes rounded to 1 mm; equal sides of a triangle stay equal."""
        return Sizes(*(float(round(size)) for size in astuple(self)))

    def circumferences(self) -> tuple[float, float, float]:
        """Return the circumferences of the three objects in mm, in the order of OBJECTS."""
        return 2 * (self.width + self.depth), 2 * np.pi * self.radius, self.side + 2 * self.leg


@dataclass(frozen=True)
class CloudSettings:
    """Settings of the cloud model. points: number of points of each cloud. seed: of their positions."""

    points: int = 128
    seed: int = 1
    band_mm: float = BAND_MM
    palm_share: float = PALM_SHARE


@dataclass(frozen=True, eq=False)
class Distances:
    """Distances after registration for one source of clouds, f64[3, 3] each, mm; rows: clouds, columns: CAD models."""

    mean: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    rms: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))
    largest: FloatArray = field(default_factory=lambda: np.zeros((3, 3)))


def compute_contact_distributions(table: CloudTable, settings: CloudSettings) -> list[ContactDistribution]:
    """Return the distribution of each object's contact points.

    The mean and standard deviation of the distance from the surface are those of the table for the cloud of an object
    and the CAD model of the same object.
    """
    return [
        ContactDistribution(share, table.mean[i, i], table.deviation[i, i], settings.band_mm, settings.palm_share)
        for i, share in enumerate(TOP_GRASP_SHARES)
    ]


def compute_distances(sizes: Sizes, settings: CloudSettings, with_own: bool = True) -> list[Distances]:
    """Compute the distances of modelled contact clouds to the three objects after the best registration.

    Returns one result for each of TABLES. with_own: also compute the distances of each cloud to its own object, which
    are otherwise 0.
    """
    prisms = sizes.prisms()
    samples = sample_unit_cube(settings.points, settings.seed)
    clouds = [
        [
            build_contact_cloud(*pair, samples)
            for pair in zip(prisms, compute_contact_distributions(table, settings), strict=True)
        ]
        for table, _ in TABLES
    ]
    results = [Distances() for _ in TABLES]
    for j, prism in enumerate(prisms):
        pairs = [(t, i) for t in range(len(TABLES)) for i in range(3) if with_own or i != j]
        starts = [build_starting_clouds(clouds[t][i], prisms[i].height, prism.height) for t, i in pairs]
        for (t, i), distances in zip(pairs, match_clouds(starts, prism), strict=True):
            results[t].mean[i, j] = distances.mean()
            results[t].rms[i, j] = np.sqrt(np.mean(distances**2))
            results[t].largest[i, j] = distances.max()
    return results


def sum_squared_log_ratios(distances: Distances, table: CloudTable) -> float:
    """Return the weighted sum of squared log ratios of the modelled distances to the distances of the thesis.

    The sum includes the six pairs of a cloud and an object to which the cloud does not belong.
    """
    terms = (
        (distances.mean, table.mean, 1.0),
        (distances.rms, table.rms, 1.0),
        (distances.largest, table.largest, LARGEST_WEIGHT),
    )
    return float(sum(weight * np.sum(np.log(a[IS_CROSS_PAIR] / b[IS_CROSS_PAIR]) ** 2) for a, b, weight in terms))


def compute_objective(sizes: Sizes, settings: CloudSettings) -> float:
    """Compute how far the modelled distances for some object sizes deviate from both distance tables of the thesis.

    The value 0.1 corresponds to a typical ratio of about 1.09.
    """
    distances = compute_distances(sizes, settings, with_own=False)
    return sum(weight * sum_squared_log_ratios(d, table) for d, (table, weight) in zip(distances, TABLES, strict=True))
