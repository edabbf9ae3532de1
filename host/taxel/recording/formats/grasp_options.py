"""Properties of a grasp that a recording does not contain and a grasp dataset requires."""

from dataclasses import dataclass

from taxel.hand.errors import format_value
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_format import BASELINE_FRAMES

UNKNOWN_OBJECT = "unknown"
"""Object name of a recording without a given object. The dataset stores a triangle of 1 micrometre as its mesh."""


@dataclass(frozen=True)
class GraspOptions:
    """Object, approach, session and baseline length of the grasp that is made from a recording.

    object: name of an object of the thesis, or "unknown". approach: any name. Both names are without commas, quotes
    and slashes. baseline_frames: number of first rows in phase 0 (nothing touches the skin); later rows are phase hold.

    Raises DatasetError for a name with one of these characters.
    """

    object: str = UNKNOWN_OBJECT
    approach: str = "recording"
    session: int = 0
    baseline_frames: int = BASELINE_FRAMES

    def __post_init__(self) -> None:
        """Check that object and approach are printable names without commas, quotes and slashes; raise DatasetError."""
        for name in ("object", "approach"):
            value = getattr(self, name)
            if not value.isprintable() or not value or set(value) & set(',"/'):
                raise DatasetError(
                    f"--{name}", "name", "one without commas, quotes and slashes", format_value(value), "rename it"
                )
