"""Errors of the estimation of distances."""

from taxel.errors import FieldError, TaxelError


class ProximityError(TaxelError):
    """A calibration or a stream does not permit the estimation of distances; the message states the remedy."""


class CalibrationFileError(FieldError, ProximityError):
    """A CSV file of holds or a calibration file contains an invalid value."""
