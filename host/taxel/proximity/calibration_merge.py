"""Combination of two calibrations of one skin, for example with a grounded plate and with an acrylic plate."""

from taxel.proximity.calibration import KindCalibration, ProximityCalibration
from taxel.proximity.errors import ProximityError


def merge_calibrations(first: ProximityCalibration, second: ProximityCalibration) -> ProximityCalibration:
    """Combine two calibrations: the result contains every kind of board and every target that one of them contains.

    If both contain the same target (such as a grounded plate) for the same kind of board, the response of `second` is
    used. Noise and drift of a kind of board are the larger of the two values. Raises `ProximityError` for calibrations
    of different hands.
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
