"""ROS message of the target in front of one board."""

import math
from typing import Any

from taxel.proximity import ProximityEstimate, Range

MESSAGE_TYPE = "taxel_msgs/Proximity"


def make_proximity_message(estimate: ProximityEstimate, header: dict[str, Any]) -> dict[str, Any]:
    """Make a taxel_msgs/Proximity message of an estimate. header: frame of the bracket and time of the scan."""
    return {
        "header": header,
        "address": estimate.address,
        "name": estimate.board,
        "ready": estimate.is_ready,
        "present": estimate.present,
        "contact": estimate.contact,
        "distance_m": _list_values(estimate.distance_m),
        "speed_m_s": _list_values(estimate.speed_m_s),
        "contact_soon": estimate.contact_soon,
        "horizon_s": estimate.horizon_s,
        "time_to_contact_s": _list_values(estimate.time_to_contact_s),
        "taxel": -1 if estimate.centre is None else estimate.centre,
        "target": estimate.target or "",
        "targets": list(estimate.targets),
        "probabilities": list(estimate.targets.values()),
    }


def _list_values(value: Range | None) -> list[float]:
    """Return median, lower and upper limit of an estimate; three NaN without an estimate."""
    return [math.nan] * 3 if value is None else [value.median, value.low, value.high]
