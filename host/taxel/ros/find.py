"""Finding a ROS: its Python packages, also where a virtual environment does not look."""

from __future__ import annotations

import glob
import importlib
import sys
from pathlib import Path
from typing import Any

from taxel.errors import TaxelError

PLACES = ("/opt/ros/*/lib/python3/dist-packages", "/usr/lib/python3/dist-packages")
"""Where ROS 1 keeps its Python packages: its own releases, and Debian's. They are plain Python, which any
Python 3 takes.
"""

NO_ROS = (
    "no ROS found: neither rclpy (ROS 2) nor rospy (ROS 1) can be imported; source your ROS first "
    "(. /opt/ros/DISTRO/setup.bash), or on Debian: apt-get install ros-core python3-rospy"
)


class RosError(TaxelError):
    """No ROS, or one that does not do what is needed."""


def import_ros1() -> Any:
    """The module rospy. Its place goes to the end of the path, so that the environment's own packages come first.

    Raises RosError if there is none.
    """
    try:
        return importlib.import_module("rospy")
    except ImportError:
        pass
    places = [place for pattern in PLACES for place in sorted(glob.glob(pattern)) if (Path(place) / "rospy").is_dir()]
    sys.path += [place for place in places if place not in sys.path]
    try:
        return importlib.import_module("rospy")
    except ImportError as error:
        if places:
            raise RosError(
                f"{places[0]}: rospy is there and cannot be imported ({error}); install what it needs"
            ) from None
        raise RosError(NO_ROS) from None


def import_ros2() -> Any:
    """The module rclpy. Raises RosError if there is none."""
    try:
        return importlib.import_module("rclpy")
    except ImportError:
        raise RosError(NO_ROS) from None


def ros_version() -> int:
    """2 if rclpy can be imported, else 1 if rospy can. Raises RosError if neither."""
    try:
        import_ros2()
        return 2
    except RosError:
        import_ros1()
        return 1
