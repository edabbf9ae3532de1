"""Fields of the report that only its page uses."""

from __future__ import annotations

from typing import Any

import numpy as np

from taxel.gap.data.pair import Pair
from taxel.gap.features.features import FeatureLayout, SessionMeans
from taxel.gap.features.metric import compute_terms
from taxel.types import FloatArray


def build_page_fields(
    pair: Pair, layout: FeatureLayout, real: SessionMeans, before: FloatArray, after: FloatArray
) -> dict[str, Any]:
    """Return the fields of the report that the HTML page shows, by name.

    The fields are: taxels and boards, excess of each taxel, numbers of grasps, gap by object and by board, and
    limitations of the data (`losses`).

    before, after: mean features of the simulator without and with the effects of the verdict, f64[C, F, n] (C
    conditions, F features, n taxels), counts.
    """
    before_terms, after_terms = compute_terms(real, before, layout), compute_terms(real, after, layout)
    names = pair.object_names
    object_index = np.array([names.index(item) for item, _ in pair.conditions], dtype=np.intp)
    sensor = pair.groups.sensor

    def compute_rms(squares: FloatArray) -> float:
        """Return the gap in counts from weighted squared differences [conditions, features, taxels], counts^2; 0
        without data.
        """
        return float(np.sqrt(max(squares.sum(axis=1).mean(), 0.0))) if squares.size else 0.0

    return {
        "taxels": {"sensor": pair.taxels.sensor.tolist(), "tx": pair.taxels.tx.tolist(), "rx": pair.taxels.rx.tolist()},
        "sensors": [
            {"address": int(address), "name": name, "kind": kind}
            for address, name, kind in zip(pair.sensors.address, pair.sensors.name, pair.sensors.kind, strict=True)
        ],
        "taxel_excess": {
            "before": before_terms.excess.sum(axis=1).mean(axis=0).tolist(),
            "after": after_terms.excess.sum(axis=1).mean(axis=0).tolist(),
        },
        "counts": {
            "real": {"grasps": len(pair.real), "sessions": len(pair.sessions)},
            "sim": {"grasps": len(pair.sim)},
            "cells": len(pair.conditions),
        },
        "by_object": [
            {
                "name": name,
                "before": compute_rms(before_terms.gap2[object_index == k]),
                "after": compute_rms(after_terms.gap2[object_index == k]),
                "floor": compute_rms(before_terms.floor2[object_index == k]),
            }
            for k, name in enumerate(names)
        ],
        "by_sensor": [
            {
                "address": int(address),
                "name": pair.sensors.name[k],
                "before": compute_rms(before_terms.gap2[:, :, sensor == k]),
                "after": compute_rms(after_terms.gap2[:, :, sensor == k]),
                "floor": compute_rms(before_terms.floor2[:, :, sensor == k]),
            }
            for k, address in enumerate(pair.sensors.address.tolist())
        ],
        "losses": list(pair.losses),
    }
