"""Recognition of an MCAP file by its first bytes, without the mcap package."""

import os

SIGNATURE = b"\x89MCAP0\r\n"
"""First bytes of every MCAP file (mcap.dev/spec, Magic)."""


def is_mcap(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins with the MCAP signature; False for a file that cannot be read."""
    try:
        with open(path, "rb") as file:
            return file.read(len(SIGNATURE)) == SIGNATURE
    except OSError:
        return False
