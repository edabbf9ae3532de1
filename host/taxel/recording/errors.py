"""What can go wrong with a recording."""

from taxel.errors import FieldError, TaxelError


class RecordingError(TaxelError):
    """A recording cannot be found, read, laid over a hand or replayed."""


class DatasetError(FieldError, RecordingError):
    """A grasp dataset that cannot be read, or cannot be written as asked; field: the HDF5 path."""
