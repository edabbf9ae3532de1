"""The thesis's data treatment (5.6.2): the force filter's and the statistical outlier filter's settings for each shape.

`taxel.cloud` applies them to clouds of points; the gap's report applies them to probabilities of being active.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

FORCE_FILTER_COUNTS: Final = 190.0
"""The thesis's force filter, for all its shapes (section 5.6.2): counts, since 150 of the same scale takes no point."""


@dataclass(frozen=True)
class Sor:
    """neighbours: points whose mean distance counts, the point itself one of them, as in CloudCompare; None: a quarter
    of the cloud. deviations: above the mean.
    """

    neighbours: float | None
    deviations: float

    @property
    def in_words(self) -> str:
        """For reports."""
        return f"{'a quarter' if self.neighbours is None else f'{self.neighbours:g}'} / {self.deviations:g}"

    def count(self, points: int) -> int:
        """Neighbours in a cloud of so many points."""
        return round(0.25 * points) if self.neighbours is None else round(self.neighbours)


OTHER_SOR: Final = Sor(20.0, 2.0)
"""For shapes that the thesis did not grasp: those of its cylinder, which lower the RMS of all three (Tables
I-4 to I-6)."""

SOR_OF: Final = {"rectang": Sor(20.0, 1.0), "cylind": Sor(20.0, 2.0), "triang": Sor(None, 2.0)}
"""By the beginning of an object's name, Table 5.4. The triangular prism's 716 are a quarter of its 2866 points."""


def sor_of(name: str) -> Sor:
    """The thesis's choice for an object's shape."""
    return next((rule for start, rule in SOR_OF.items() if name.lower().startswith(start)), OTHER_SOR)
