"""Sampled placement of the hand at an object: the thesis's approaches, or any approach from the side or from above."""

from dataclasses import replace
from typing import Final

import numpy as np

from taxel.generate.solids import ObjectKind
from taxel.grasp.plan import PALM_PLACEMENTS, PalmPlacement
from taxel.grasp.shapes import Shape

# Mean values of the thesis's approaches (`taxel.grasp.plan`).
SIDE_THUMB_RAD: Final = (1.15, 0.40)
TOP_THUMB_RAD: Final = (0.50, 0.50)
SIDE_MIDDLE_M: Final = -0.008  # position of the object's middle, towards the fingertips
TOP_EDGE_M: Final = -0.030


def sample_placement(
    kind: ObjectKind, shape: Shape, top_share: float, rng: np.random.Generator
) -> tuple[str, PalmPlacement]:
    """Sample an approach of the palm to an object: name and placement, before the variation of `shift_placement`.

    top_share: probability of an approach from above, for objects that may be approached from any side. Every call
    consumes three random numbers.
    """
    choice, top, azimuth = rng.random(3).tolist()
    if kind.approaches == "thesis":
        names = [name for item, name in PALM_PLACEMENTS if item == kind.name]
        name = names[int(choice * len(names))]
        return name, PALM_PLACEMENTS[kind.name, name]
    angle = 2.0 * np.pi * azimuth
    if top < top_share:
        return "top", PalmPlacement(angle, edge_z_m=TOP_EDGE_M, thumb_rad=TOP_THUMB_RAD, top=True)
    # z axis of the palm; its x axis points at the object, its y axis upwards
    fingers = np.array([-np.sin(angle), np.cos(angle), 0.0])
    reach = float((shape.mesh()[0] @ fingers).max())
    return "side", PalmPlacement(angle, edge_z_m=SIDE_MIDDLE_M + reach, thumb_rad=SIDE_THUMB_RAD)


def shift_placement(placement: PalmPlacement, sampled: dict[str, float]) -> PalmPlacement:
    """Shift a placement of the palm by sampled values: turn_deg, reach_mm, along_mm, press_mm and thumb_deg."""
    thumb = np.radians(sampled["thumb_deg"])
    return replace(
        placement,
        azimuth_rad=placement.azimuth_rad + float(np.radians(sampled["turn_deg"])),
        edge_z_m=placement.edge_z_m + 1e-3 * sampled["reach_mm"],
        axis_y_m=placement.axis_y_m + 1e-3 * sampled["along_mm"],
        indentation_m=1e-3 * sampled["press_mm"],
        thumb_rad=(placement.thumb_rad[0] + thumb, placement.thumb_rad[1] + thumb),
    )
