"""Errors of the estimation of distances."""

from taxel.errors import FieldError, TaxelError


class ProximityError(TaxelError):
    """A calibration or a stream does not permit the estimation of distances; the text states the remedy."""


class CalibrationFileError(FieldError, ProximityError):
    """A file of holds or a calibration file has a value that is not valid."""
