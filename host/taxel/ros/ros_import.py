"""Import of rospy (ROS 1) or rclpy (ROS 2), also from the system folders that a virtual environment does not search."""

import glob
import importlib
import sys
from pathlib import Path
from typing import Any

from taxel.errors import TaxelError

SYSTEM_FOLDERS = ("/opt/ros/*/lib/python3/dist-packages", "/usr/lib/python3/dist-packages")
"""Glob patterns of the folders in which ROS 1 installs its Python packages: the ROS releases, and Debian's packages.
The packages are pure Python, so any Python 3 can import them.
"""

NO_ROS = (
    "no ROS found: neither rclpy (ROS 2) nor rospy (ROS 1) can be imported; source your ROS first "
    "(. /opt/ros/DISTRO/setup.bash), or on Debian: apt-get install ros-core python3-rospy"
)


class RosError(TaxelError):
    """Error: ROS is not installed, or lacks something that a node needs."""


def import_ros1() -> Any:
    """Import and return the module rospy. Raises RosError if rospy is not installed or cannot be imported.

    The folder of rospy is appended to the end of `sys.path`, so that packages of the environment take precedence.
    """
    try:
        return importlib.import_module("rospy")
    except ImportError:
        pass
    folders = [
        path for pattern in SYSTEM_FOLDERS for path in sorted(glob.glob(pattern)) if (Path(path) / "rospy").is_dir()
    ]
    sys.path += [path for path in folders if path not in sys.path]
    try:
        return importlib.import_module("rospy")
    except ImportError as error:
        if folders:
            raise RosError(
                f"{folders[0]}: rospy is installed but cannot be imported ({error}); install the missing package"
            ) from None
        raise RosError(NO_ROS) from None


def import_ros2() -> Any:
    """Import and return the module rclpy. Raises RosError if rclpy cannot be imported."""
    try:
        return importlib.import_module("rclpy")
    except ImportError:
        raise RosError(NO_ROS) from None


def find_ros_version() -> int:
    """Return 2 if rclpy can be imported, else 1 if rospy can be imported. Raises RosError if neither can."""
    try:
        import_ros2()
        return 2
    except RosError:
        import_ros1()
        return 1
