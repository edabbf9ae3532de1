"""Distance and approach speed of a target before it touches the skin."""

from taxel.proximity.calibration import KindCalibration, ProximityCalibration, TargetResponse, calibrate
from taxel.proximity.calibration_file import format_calibration, read_calibration, write_calibration
from taxel.proximity.errors import CalibrationFileError, ProximityError
from taxel.proximity.estimate import ProximityEstimate, Range
from taxel.proximity.estimator import BoardEstimator
from taxel.proximity.hold_signals import collect_holds
from taxel.proximity.holds import Hold, format_holds, read_holds
from taxel.proximity.watch import ProximityWatch, open_watch

__all__ = [
    "BoardEstimator",
    "CalibrationFileError",
    "Hold",
    "KindCalibration",
    "ProximityCalibration",
    "ProximityError",
    "ProximityEstimate",
    "ProximityWatch",
    "Range",
    "TargetResponse",
    "calibrate",
    "collect_holds",
    "format_calibration",
    "format_holds",
    "open_watch",
    "read_calibration",
    "read_holds",
    "write_calibration",
]
