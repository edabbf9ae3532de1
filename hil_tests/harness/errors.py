"""What can be wrong with a rig."""

from taxel.errors import TaxelError


class RigError(TaxelError):
    """A rig file or a device of a rig. One line: what, what was expected, what was found, what to do."""
