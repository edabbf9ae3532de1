"""Error of the hardware-in-the-loop harness."""

from taxel.errors import TaxelError


class RigError(TaxelError):
    """A rig file, a driver or a device of a rig cannot be used.

    The text is one line that names the file or the port and the field, the expected value, the value found, and what
    to do.
    """
