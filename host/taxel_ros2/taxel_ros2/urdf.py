"""Print the URDF of a hand with the brackets of its boards: `ros2 run taxel_ros2 skin_urdf original`."""

import sys

from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.ros.tf_tree import FrameTree


def main() -> int:
    """Print the URDF of the hand that the only command-line argument names, and return the exit status.

    0: printed; 1: invalid hand, with a one-line message; 2: wrong number of arguments.
    """
    if len(sys.argv) != 2:
        print("skin_urdf: expected the name or file of a hand description, such as original", file=sys.stderr)
        return 2
    try:
        print(FrameTree(load_hand(sys.argv[1])).urdf)
    except TaxelError as error:
        print(f"skin_urdf: {error}", file=sys.stderr)
        return 1
    return 0
