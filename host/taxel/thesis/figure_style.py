"""Colours, empty figures and axes that all figures of the thesis share."""

from typing import Any, Final

from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM, SPREAD

COLOURS: Final = {REAL: "#d9772b", SIM: "#5d3a9b", FILTERED: "#c9a227", CLEANED: "#3d8f5f", SPREAD: "#1f5fa8"}
EDGE, PALE, INK, INACTIVE = "#9aa1ad", 0.35, "#1b1d22", "#8a92a0"


def new_figure(width: float, height: float) -> Any:
    """Create an empty matplotlib figure. width, height: inches."""
    from matplotlib.figure import Figure  # the import takes a second, which other commands need not wait for

    return Figure(figsize=(width, height), layout="constrained")


def remove_frame(axis: Any) -> None:
    """Remove the upper and right border of a matplotlib axis, and reduce the size of its tick labels."""
    axis.spines[["top", "right"]].set_visible(False)
    axis.tick_params(labelsize=8)
