"""`--joints`: the joint angles of a hand's robot at the command line."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from taxel.errors import TaxelError
from taxel.hand.errors import shown

HELP = "Joint angles of the hand's robot, radians, with commas between; none: all 0."


def joint_angles(text: str) -> npt.NDArray[np.float64] | None:
    """The angles [j] that a text gives; None for an empty one. Raises TaxelError for anything but numbers."""
    if not text:
        return None
    try:
        angles = np.array([float(part) for part in text.split(",")])
    except ValueError:
        angles = np.array([np.nan])
    if not np.isfinite(angles).all():
        raise TaxelError(f"--joints: expected numbers with commas between, found {shown(text)}; radians, one a joint")
    return angles
