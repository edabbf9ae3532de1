"""Fields of the report that only its page uses."""

from __future__ import annotations

from typing import Any

import numpy as np

from taxel.gap.data.pair import Pair
from taxel.gap.features.features import Layout, SessionMeans
from taxel.gap.features.metric import terms
from taxel.types import FloatArray


def page_fields(
    pair: Pair, layout: Layout, real: SessionMeans, before: FloatArray, after: FloatArray
) -> dict[str, Any]:
    """The fields by name: taxels and boards, excess of each taxel, numbers of grasps, gap by object and by board.

    before, after: mean features of the simulator without and with the effects of the verdict, f64[C, F, n], counts.
    """
    first, second = terms(real, before, layout), terms(real, after, layout)
    names = pair.object_names
    of_object = np.array([names.index(item) for item, _ in pair.conditions], dtype=np.intp)
    sensor = pair.groups.sensor

    def rms(part: FloatArray) -> float:
        return float(np.sqrt(max(part.sum(axis=1).mean(), 0.0))) if part.size else 0.0

    return {
        "taxels": {"sensor": pair.taxels.sensor.tolist(), "tx": pair.taxels.tx.tolist(), "rx": pair.taxels.rx.tolist()},
        "sensors": [
            {"address": int(address), "name": name, "kind": kind}
            for address, name, kind in zip(pair.sensors.address, pair.sensors.name, pair.sensors.kind, strict=True)
        ],
        "taxel_excess": {
            "before": first.excess.sum(axis=1).mean(axis=0).tolist(),
            "after": second.excess.sum(axis=1).mean(axis=0).tolist(),
        },
        "counts": {
            "real": {"grasps": len(pair.real), "sessions": len(pair.sessions)},
            "sim": {"grasps": len(pair.sim)},
            "cells": len(pair.conditions),
        },
        "by_object": [
            {
                "name": name,
                "before": rms(first.gap2[of_object == k]),
                "after": rms(second.gap2[of_object == k]),
                "floor": rms(first.floor2[of_object == k]),
            }
            for k, name in enumerate(names)
        ],
        "by_sensor": [
            {
                "address": int(address),
                "name": pair.sensors.name[k],
                "before": rms(first.gap2[:, :, sensor == k]),
                "after": rms(second.gap2[:, :, sensor == k]),
                "floor": rms(first.floor2[:, :, sensor == k]),
            }
            for k, address in enumerate(pair.sensors.address.tolist())
        ],
        "losses": list(pair.losses),
    }
