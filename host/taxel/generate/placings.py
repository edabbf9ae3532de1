"""How the hand meets an object that was drawn: the thesis's approaches, or any from the side or from above."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from taxel.generate.solids import ObjectKind
from taxel.grasp.plan import PLACINGS, Placing
from taxel.grasp.shapes import Shape

# Between the figures of the thesis's approaches (`taxel.grasp.plan`).
SIDE_THUMB_RAD: Final = (1.15, 0.40)
TOP_THUMB_RAD: Final = (0.50, 0.50)
SIDE_MIDDLE_M: Final = -0.008  # of the object, towards the fingertips
TOP_EDGE_M: Final = -0.030


def drawn_placing(kind: ObjectKind, shape: Shape, top_share: float, rng: np.random.Generator) -> tuple[str, Placing]:
    """Name and figures of an approach, before anything is added to them. Takes three draws."""
    which, top, azimuth = rng.random(3).tolist()
    if kind.approaches == "thesis":
        names = [name for item, name in PLACINGS if item == kind.name]
        name = names[int(which * len(names))]
        return name, PLACINGS[kind.name, name]
    angle = 2.0 * np.pi * azimuth
    if top < top_share:
        return "top", Placing(angle, edge_z_m=TOP_EDGE_M, thumb_rad=TOP_THUMB_RAD, top=True)
    fingers = np.array([-np.sin(angle), np.cos(angle), 0.0])  # the palm's z: its x looks at the object, its y is up
    reach = float((shape.mesh()[0] @ fingers).max())
    return "side", Placing(angle, edge_z_m=SIDE_MIDDLE_M + reach, thumb_rad=SIDE_THUMB_RAD)


def moved(placing: Placing, drawn: dict[str, float]) -> Placing:
    """The placing with what was drawn: turn_deg, reach_mm, along_mm, press_mm and thumb_deg."""
    thumb = np.radians(drawn["thumb_deg"])
    return replace(
        placing,
        azimuth_rad=placing.azimuth_rad + float(np.radians(drawn["turn_deg"])),
        edge_z_m=placing.edge_z_m + 1e-3 * drawn["reach_mm"],
        axis_y_m=placing.axis_y_m + 1e-3 * drawn["along_mm"],
        press_m=1e-3 * drawn["press_mm"],
        thumb_rad=(placing.thumb_rad[0] + thumb, placing.thumb_rad[1] + thumb),
    )
