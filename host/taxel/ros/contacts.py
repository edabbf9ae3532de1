"""Baseline, active taxels and the contact cloud as messages."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from taxel.hand import Hand
from taxel.ros.tree import header
from taxel.signal import ActivationFrame, BaselineResult

_FLOAT32, _UINT32, _UINT8 = 7, 6, 2  # sensor_msgs/PointField
POINT = np.dtype(
    {
        "names": ["x", "y", "z", "normal_x", "normal_y", "normal_z", "drop", "taxel", "address"],
        "formats": ["<f4"] * 7 + ["<u4", "u1"],
        "itemsize": 36,
    }
)
"""A point of the contact cloud. Metres and the normal in the cloud's frame; `drop`: counts below the baseline; `taxel`:
index on the hand's taxel axis; `address`: of its board.
"""
_TYPES = {"f": _FLOAT32, "u": _UINT32}


def point_fields() -> list[dict[str, Any]]:
    """The fields of a point as sensor_msgs/PointField messages."""
    found = []
    for name, (dtype, offset, *_) in (POINT.fields or {}).items():
        datatype = _UINT8 if dtype.itemsize == 1 else _TYPES[dtype.kind]
        found.append({"name": name, "offset": int(offset), "datatype": datatype, "count": 1})
    return found


_POINT_FIELDS = point_fields()


def activations(hand: Hand, felt: ActivationFrame, cycle: int, threshold: float, time_ns: int) -> dict[str, Any]:
    """A taxel_msgs/Activations of one cycle."""
    taxels = np.flatnonzero(felt.active)
    known = felt.signal_counts[~felt.missing]
    return {
        "header": header(time_ns, ""),
        "cycle": cycle,
        "threshold_counts": threshold,
        "active_count": len(taxels),
        "missing_count": int(felt.missing.sum()),
        "largest_drop": float(known.max()) if len(known) else 0.0,
        "taxel": taxels,
        "address": hand.sensor[taxels],
        "drop": felt.signal_counts[taxels],
    }


def contact_cloud(
    hand: Hand,
    felt: ActivationFrame,
    positions: npt.NDArray[np.float64],
    normals: npt.NDArray[np.float64],
    head: dict[str, Any],
) -> dict[str, Any]:
    """A sensor_msgs/PointCloud2 of the active taxels, at `positions` f64[n, 3] with `normals` f64[n, 3]."""
    taxels = np.flatnonzero(felt.active)
    points = np.zeros(len(taxels), dtype=POINT)
    for axis, name in enumerate("xyz"):
        points[name] = positions[taxels, axis]
        points[f"normal_{name}"] = normals[taxels, axis]
    points["drop"] = felt.signal_counts[taxels]
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


def baseline_message(baseline: BaselineResult, samples: int, time_ns: int) -> dict[str, Any]:
    """A taxel_msgs/Baseline."""
    return {
        "header": header(time_ns, ""),
        "samples": samples,
        "mean": baseline.mean,
        "noise": baseline.noise,
        "disturbed": baseline.disturbed,
    }
