"""Time limits of the hand control from ROS."""

from typing import Final

HOLD_AFTER_S: Final = 0.2
"""Time without a valid command after which the hand holds its measured position, seconds: 20 periods of a publisher at
100 Hz. A larger value moves the hand longer on an outdated command; a smaller one holds on every delay of the network.
"""

STOP_AFTER_S: Final = 2.0
"""Time without a valid command after which the motors are switched off, seconds."""
