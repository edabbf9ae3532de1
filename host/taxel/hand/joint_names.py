"""Names of the sixteen joints of the Allegro hand in ROS messages and in the robot descriptions."""

from typing import Final

ROS_JOINT_NAMES: Final = tuple(f"joint_{index}.0" for index in range(16))
"""Names of the joints in the messages of the manufacturer's ROS driver, in the order of the driver."""

ROBOT_JOINT_NAMES: Final = tuple(f"{finger}_j{joint}" for finger in ("ff", "mf", "rf", "th") for joint in range(4))
"""Names of the same joints in the packaged robot descriptions."""
