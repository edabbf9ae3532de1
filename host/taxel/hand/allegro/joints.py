"""Order, names and ranges of the sixteen joints of the right Allegro hand.

Joint j (0 at the palm, 3 at the tip) of finger k has index ``4 * k + j`` on the last axis of every array.
"""

from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.types import FloatArray

FINGERS: Final = ("index", "middle", "pinkie", "thumb")
JOINTS_PER_FINGER: Final = 4
JOINT_COUNT: Final = len(FINGERS) * JOINTS_PER_FINGER
JOINT_NAMES: Final = tuple(f"{finger}_{j}" for finger in FINGERS for j in range(JOINTS_PER_FINGER))

# Joint ranges, radians. Source: public model of the hand (MuJoCo Menagerie, wonik_allegro, right hand).
_FINGER_RANGE = ((-0.47, 0.47), (-0.196, 1.61), (-0.174, 1.709), (-0.227, 1.618))
_THUMB_RANGE = ((0.263, 1.396), (-0.105, 1.163), (-0.189, 1.644), (-0.162, 1.719))
_RANGE: FloatArray = np.array(3 * _FINGER_RANGE + _THUMB_RANGE)
_RANGE.setflags(write=False)

JOINT_MIN_RAD: Final = _RANGE[:, 0]
JOINT_MAX_RAD: Final = _RANGE[:, 1]


def check_joint_values(name: str, values: npt.ArrayLike) -> FloatArray:
    """Return a copy of `values` as f64[16]. Raises ValueError for another shape or a value that is not finite."""
    array = np.array(values, dtype=np.float64)
    if array.shape != (JOINT_COUNT,):
        raise ValueError(f"{name}: expected {JOINT_COUNT} values, one per joint, found shape {array.shape}")
    if not np.isfinite(array).all():
        index = int(np.flatnonzero(~np.isfinite(array))[0])
        raise ValueError(f"{name}: expected finite values, found {array[index]} for {JOINT_NAMES[index]}")
    return array
