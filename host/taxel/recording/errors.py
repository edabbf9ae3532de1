"""What can go wrong with a recording."""

from taxel.errors import TaxelError


class RecordingError(TaxelError):
    """A recording cannot be found, read, laid over a hand or replayed."""
