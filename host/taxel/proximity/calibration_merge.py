"""Combination of two calibrations of one skin, such as of a grounded plate and of an acrylic plate."""

from taxel.proximity.calibration import KindCalibration, ProximityCalibration
from taxel.proximity.errors import ProximityError


def merge_calibrations(first: ProximityCalibration, second: ProximityCalibration) -> ProximityCalibration:
    """Combine kinds and targets; where both have a target of a kind, the second one applies.

    Noise and drift are the larger ones of both. Raises `ProximityError` for calibrations of two hands.
    """
    if first.hand != second.hand:
        raise ProximityError(
            f"calibrations of hand '{first.hand}' and of hand '{second.hand}' cannot be combined; calibrate again"
        )
    kinds = dict(first.kinds)
    for name, kind in second.kinds.items():
        known = kinds.get(name)
        if known is None:
            kinds[name] = kind
            continue
        noise = max(known.noise_counts, kind.noise_counts)
        drift = max(known.drift_counts, kind.drift_counts)
        kinds[name] = KindCalibration(noise, drift, {**known.targets, **kind.targets})
    return ProximityCalibration(first.hand, kinds)
