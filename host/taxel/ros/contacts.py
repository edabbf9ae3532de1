"""ROS messages of the baseline, the active taxels and the contact cloud."""

from typing import Any

import numpy as np

from taxel.hand import Hand
from taxel.ros.tf_tree import make_header
from taxel.signal import ActivationFrame, BaselineResult
from taxel.types import FloatArray

_FLOAT32, _UINT32, _UINT8 = 7, 6, 2  # constants of sensor_msgs/PointField
POINT = np.dtype(
    {
        "names": ["x", "y", "z", "normal_x", "normal_y", "normal_z", "drop", "taxel", "address"],
        "formats": ["<f4"] * 7 + ["<u4", "u1"],
        "itemsize": 36,
    }
)
"""One point of the contact cloud. x, y, z: metres, in the frame of the cloud. normal_x, normal_y, normal_z: outward
unit normal. drop: signal, counts. taxel: index on the hand's taxel axis. address: I2C address of the board.
"""
_TYPES = {"f": _FLOAT32, "u": _UINT32}


def make_point_fields() -> list[dict[str, Any]]:
    """Describe the fields of `POINT`, a point of the contact cloud, as sensor_msgs/PointField messages."""
    messages = []
    for name, (dtype, offset, *_) in (POINT.fields or {}).items():
        datatype = _UINT8 if dtype.itemsize == 1 else _TYPES[dtype.kind]
        messages.append({"name": name, "offset": int(offset), "datatype": datatype, "count": 1})
    return messages


_POINT_FIELDS = make_point_fields()


def make_activations_message(
    hand: Hand, activation: ActivationFrame, cycle: int, threshold: float, time_ns: int
) -> dict[str, Any]:
    """Make a taxel_msgs/Activations message with the active taxels of one poll cycle.

    cycle: number of the cycle. threshold: signal above which a taxel is active, counts. time_ns: Unix time.
    """
    taxels = np.flatnonzero(activation.active)
    measured = activation.signal_counts[~activation.missing]
    return {
        "header": make_header(time_ns, ""),
        "cycle": cycle,
        "threshold_counts": threshold,
        "active_count": len(taxels),
        "missing_count": int(activation.missing.sum()),
        "largest_drop": float(measured.max()) if len(measured) else 0.0,
        "taxel": taxels,
        "address": hand.sensor[taxels],
        "drop": activation.signal_counts[taxels],
    }


def make_contact_cloud_message(
    hand: Hand, activation: ActivationFrame, positions: FloatArray, normals: FloatArray, head: dict[str, Any]
) -> dict[str, Any]:
    """Make a sensor_msgs/PointCloud2 message with a point for each active taxel.

    positions: f64[n, 3], centres of all taxels, metres. normals: f64[n, 3], outward unit normals. head: std_msgs/Header
    with the coordinate frame of positions and normals.
    """
    taxels = np.flatnonzero(activation.active)
    points = np.zeros(len(taxels), dtype=POINT)
    for axis, name in enumerate("xyz"):
        points[name] = positions[taxels, axis]
        points[f"normal_{name}"] = normals[taxels, axis]
    points["drop"] = activation.signal_counts[taxels]
    points["taxel"] = taxels
    points["address"] = hand.sensor[taxels]
    return {
        "header": head,
        "height": 1,
        "width": len(points),
        "fields": _POINT_FIELDS,
        "is_bigendian": False,
        "point_step": POINT.itemsize,
        "row_step": POINT.itemsize * len(points),
        "data": points.tobytes(),
        "is_dense": True,
    }


def make_baseline_message(baseline: BaselineResult, samples: int, time_ns: int) -> dict[str, Any]:
    """Make a taxel_msgs/Baseline message. samples: number of scans that the baseline averages."""
    return {
        "header": make_header(time_ns, ""),
        "samples": samples,
        "mean": baseline.mean,
        "noise": baseline.noise,
        "disturbed": baseline.disturbed,
    }
