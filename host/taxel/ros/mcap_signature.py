"""Recognition of an MCAP file or a ROS 1 bag by its first bytes, without the libraries that read them."""

import os

from taxel.input_files import open_regular_file

SIGNATURE = b"\x89MCAP0\r\n"
"""First bytes of every MCAP file (mcap.dev/spec, Magic)."""

BAG_SIGNATURE = b"#ROSBAG V"
"""First bytes of every ROS 1 bag (wiki.ros.org/Bags/Format)."""


def is_mcap(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins with the MCAP signature; False for a file that cannot be read."""
    return _has_signature(path, SIGNATURE)


def is_ros1_bag(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins with the signature of a ROS 1 bag; False for a file that cannot be read."""
    return _has_signature(path, BAG_SIGNATURE)


def _has_signature(path: str | os.PathLike[str], signature: bytes) -> bool:
    """Whether a file begins with `signature`; False for a file that cannot be read."""
    try:
        with open_regular_file(path) as file:
            return file.read(len(signature)) == signature
    except OSError:
        return False
