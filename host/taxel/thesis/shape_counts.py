"""Numbers of clouds whose shape is identified."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Final

WHOLE_CLOUDS: Final = "whole clouds"
SINGLE_APPROACHES: Final = "single approaches"


@dataclass(frozen=True)
class ShapeCount:
    """Number of clouds of one object whose shape is identified, real and simulated clouds together.

    group: `WHOLE_CLOUDS` or `SINGLE_APPROACHES`. models: number of candidate models. object: printed name of the
    object. identified: number of clouds whose best model is the object. total: number of all clouds.
    """

    group: str
    models: int
    object: str
    identified: int
    total: int

    def to_json(self) -> dict[str, Any]:
        """Convert the count to JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> "ShapeCount":
        """Create a count from the values of `to_json`. Raises TypeError."""
        return cls(**values)
