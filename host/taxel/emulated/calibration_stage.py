"""An emulated calibration session: a flat plate is held at known distances in front of boards of an emulated skin."""

import os
from collections.abc import Sequence
from types import MappingProxyType
from typing import Final

import numpy as np

from taxel.emulated.target_stage import TargetMotion, make_stage_frame, record_target_motions
from taxel.grasp.shapes import ConvexPolytope
from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.transforms import from_rotation_vector
from taxel.hand.world import WorldSettings
from taxel.proximity.holds import REST, Hold
from taxel.types import FloatArray

DISTANCES_MM: Final = (0.3, 0.6, 1.0, 1.5, 2.0, 2.7, 3.5, 4.5, 6.0, 8.0, 10.5, 14.0)
HOLD_S: Final = 2.0
REST_S: Final = 6.0
MOVE_S: Final = 0.5
LEAD_IN_S: Final = 4.0
"""Time from power-up to the first hold; by then the hub has found every board and has read each clock twice."""

PLATE_M: Final = (0.14, 0.14, 0.02)
"""Sides of the plate: it covers the largest board."""

EFFECTS: Final = MappingProxyType(
    {
        "grounded": "proximity conductor share=0.2 reach_m=0.004",
        "acrylic": "proximity dielectric share=0.2 reach_m=0.004 permittivity=3 thickness_m=0.003",
    }
)
"""Effect line of the emulator for each target: a metal plate at ground, and 3 mm of acrylic glass."""


def plan_calibration(hand: Hand, boards: Sequence[str], target: str) -> tuple[list[TargetMotion], list[Hold]]:
    """Plan a calibration session: the plate is held in front of each board at `DISTANCES_MM`, from far to near.

    Before and after each board there is a rest without the plate. target: material of the plate, a key of `EFFECTS`.
    Returns the motions of the plate, and all holds and rests with their times and distances.
    """
    motions, holds, now = [], [], LEAD_IN_S
    for name in boards:
        holds.append(Hold(now, now + REST_S, name, REST, None))
        now += REST_S + MOVE_S
        times, distances = [], []
        for millimetres in reversed(DISTANCES_MM):
            times += [now, now + HOLD_S]
            distances += [1e-3 * millimetres] * 2
            # The hold is 0.1 s shorter at both ends, as a margin to the motions before and after it.
            holds.append(Hold(now + 0.1, now + HOLD_S - 0.1, name, target, 1e-3 * millimetres))
            now += HOLD_S + MOVE_S
        taxel = find_middle_taxel(hand, name)
        orientation, lateral = align_to_board(hand, name, taxel), np.zeros((len(times), 2))
        motions.append(TargetMotion(name, "plate", orientation, taxel, np.array(times), np.array(distances), lateral))
        now += MOVE_S
        holds.append(Hold(now, now + REST_S, name, REST, None))
        now += REST_S
    return motions, holds


def record_calibration(
    capture: str | os.PathLike[str], hand: Hand, boards: Sequence[str], target: str, settings: WorldSettings
) -> list[Hold]:
    """Record an emulated calibration session and return its holds and rests.

    capture: file to write. target: material of the plate, a key of `EFFECTS`. settings: settings of the world file,
    whose effects contain the response to this material. Raises `LinkError`.
    """
    motions, holds = plan_calibration(hand, boards, target)
    shapes = {"plate": ConvexPolytope.box(*PLATE_M)}
    record_target_motions(capture, hand, dict(shapes), motions, holds[-1].end_s + MOVE_S, settings)
    return holds


def find_middle_taxel(hand: Hand, board: str) -> int:
    """Return the index on its board of a taxel near the middle of the board with nearly the mean normal.

    Raises HandGeometryError if the hand has no taxel positions.
    """
    surface = hand.find_board(board).kind.surface
    if surface is None:
        raise HandGeometryError(hand.name)
    # Compromise: 1 mm of distance from the middle counts as much as 0.01 in the cosine of the angle to the mean normal.
    aside = np.linalg.norm(surface.position - surface.position.mean(axis=0), axis=1)
    return int(np.argmax(surface.normal @ surface.normal.mean(axis=0) - 10.0 * aside))


def align_to_board(hand: Hand, board: str, taxel: int) -> FloatArray:
    """Compute the rotation f64[4, 4] from the normal of a taxel to the mean normal of its board.

    The stage is the emulated device that holds the target above the taxel; the rotation is expressed in its frame
    (`make_stage_frame`, z axis along the taxel's normal). taxel: index on the board.
    """
    surface = hand.find_board(board).kind.surface
    if surface is None:
        raise HandGeometryError(hand.name)
    mean = surface.normal.mean(axis=0)
    local = make_stage_frame(hand, board, taxel)[:3, :3].T @ (mean / np.linalg.norm(mean))
    axis = np.cross([0.0, 0.0, 1.0], local)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-9:
        return np.eye(4)
    return from_rotation_vector(axis / sine * np.arctan2(sine, local[2]))
