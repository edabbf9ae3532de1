"""Filter settings of the data treatment of the thesis (5.6.2) for each shape.

`taxel.cloud` applies these filters to clouds of points; the report of `taxel gap` applies them to probabilities of
activity.
"""

from dataclasses import dataclass
from typing import Final

FORCE_FILTER_COUNTS: Final = 190.0
"""Threshold of the thesis's force filter for all its shapes (section 5.6.2), counts. The threshold is compared with the
signal: 150 counts, the threshold of an active taxel, would remove no point."""


@dataclass(frozen=True)
class OutlierFilter:
    """Settings of statistical outlier removal.

    neighbours: number of points in a neighbourhood, the point itself included, as in CloudCompare; None: a quarter of
    the cloud. deviations: permitted mean distance to the neighbours, in standard deviations above the average.
    """

    neighbours: float | None
    deviations: float

    @property
    def description(self) -> str:
        """The settings of the outlier filter in reports: number of neighbours / number of standard deviations."""
        return f"{'a quarter' if self.neighbours is None else f'{self.neighbours:g}'} / {self.deviations:g}"

    def count_neighbours(self, points: int) -> int:
        """Return the outlier filter's number of neighbours for a cloud of `points` points."""
        return round(0.25 * points) if self.neighbours is None else round(self.neighbours)


DEFAULT_OUTLIER_FILTER: Final = OutlierFilter(20.0, 2.0)
"""Settings for shapes that are not in the thesis: those of its cylinder, which lower the RMS of all three shapes of the
thesis (Tables I-4 to I-6)."""

OUTLIER_FILTERS: Final = {
    "rectang": OutlierFilter(20.0, 1.0),
    "cylind": OutlierFilter(20.0, 2.0),
    "triang": OutlierFilter(None, 2.0),
}
"""Settings of Table 5.4 by the first letters of the object's name. The 716 neighbours of the triangular prism are a
quarter of its 2866 points."""


def get_outlier_filter(name: str) -> OutlierFilter:
    """Return the settings of the outlier filter that the thesis used for an object with this name."""
    matches = (item for start, item in OUTLIER_FILTERS.items() if name.lower().startswith(start))
    return next(matches, DEFAULT_OUTLIER_FILTER)
