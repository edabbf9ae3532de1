"""Errors of recordings and grasp datasets."""

from taxel.errors import FieldError, TaxelError


class RecordingError(TaxelError):
    """A recording does not exist, cannot be read, does not fit a hand, or cannot be replayed."""


class DatasetError(FieldError, RecordingError):
    """A grasp dataset cannot be read or written. The attribute `field` is the HDF5 path."""
