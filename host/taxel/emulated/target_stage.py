"""A target that moves in front of the boards of an emulated skin without contact, and its true distances.

The brackets stand far apart, so that a target faces one board only. The true distances are returned to the caller, not
written to the recording: they are the data of a calibration, or the hidden answer of a check.
"""

import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from taxel.emulated.scene import EmulatedScene, format_scene
from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.sheet import build_sheet
from taxel.hand.transforms import from_rotation_vector
from taxel.hand.world import WorldSettings
from taxel.link import run_emulator, write_scene
from taxel.stream.start_script import write_start_script
from taxel.types import FloatArray

BRACKET_SPACING_M = 0.5
"""Distance between brackets: a target in front of one board is far beyond the range of the others."""

AWAY_M = 0.2
"""Distance of a target that is not in use: beyond the range of every effect (50 mm)."""

SKIN_POINTS = 5
"""Points per side of a taxel's square at which the true distance is computed."""

STEP_S = 0.005
STEP_M = 0.00025
"""Interval between two poses of a moving target, by time or by travel, whichever gives fewer poses. The emulator
interpolates the distances between skin and target linearly between two poses."""


@dataclass(frozen=True, eq=False)
class TargetMotion:
    """Motion of one target in front of one board, with k poses between which it moves linearly.

    board: name of the board. target: name of the shape. orientation: f64[4, 4], pose of the target in the frame of the
    stage (`make_stage_frame`); its height is arbitrary. taxel: index on the board of the taxel above which the target
    moves. time_s: f64[k], seconds since power-up. distance_m: f64[k], smallest distance between skin and target;
    negative: the target presses the skin. lateral_m: f64[k, 2], displacement along the surface.
    """

    board: str
    target: str
    orientation: FloatArray
    taxel: int
    time_s: FloatArray
    distance_m: FloatArray
    lateral_m: FloatArray


@dataclass(frozen=True, eq=False)
class TrueDistance:
    """True distance between the unloaded skin of a board and a target at k times.

    board: name of the board. time_s: f64[k], seconds since power-up. distance_m: f64[k], travel along the normal of the
    stage after which the target touches the skin: 0 or less for a target that presses the skin, infinite for a target
    beside the board.
    """

    board: str
    time_s: FloatArray
    distance_m: FloatArray


def compute_skin_points(hand: Hand, board: str) -> tuple[FloatArray, FloatArray]:
    """Compute 25 points of the unloaded skin over each of a board's n taxels, and the normals of the taxels.

    Returns f64[n, 25, 3] and f64[n, 3], metres, bracket frame. Raises HandGeometryError if the hand has no taxel
    positions or no layer thickness.
    """
    address, surface = hand.find_board(board).address, hand.find_board(board).kind.surface
    if surface is None or hand.layer_m is None:
        raise HandGeometryError(hand.name)
    sheet, count = build_sheet(hand, SKIN_POINTS), SKIN_POINTS**2
    rows = slice(hand.get_slice(address).start * count, hand.get_slice(address).stop * count)
    points = sheet.position[rows] + hand.layer_m * sheet.normal[rows]
    return points.reshape(-1, count, 3), surface.normal


def make_stage_frame(hand: Hand, board: str, taxel: int) -> FloatArray:
    """Make the frame f64[4, 4] of the stage above a taxel, in the bracket frame of its board.

    Its origin is on the skin above the taxel, its z axis is the outward normal, and its x axis is the taxel's distal
    direction. taxel: index on the board.
    """
    points, normals = compute_skin_points(hand, board)
    surface = hand.find_board(board).kind.surface
    assert surface is not None  # checked by compute_skin_points
    frame = np.eye(4)
    z, x = normals[taxel], surface.distal[taxel]
    frame[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    frame[:3, 3] = points[taxel].mean(axis=0)
    return frame


def compute_target_poses(hand: Hand, shape: Shape, motion: TargetMotion) -> tuple[FloatArray, FloatArray]:
    """Compute the poses f64[k, 4, 4] of a target in the frame of the bracket, and its true distances f64[k], metres.

    The target is shifted along the normal of the stage until its smallest distance from the skin points is
    `motion.distance_m`. The distance is infinite where the target has moved beside the board.
    """
    points, _ = compute_skin_points(hand, motion.board)
    frame = make_stage_frame(hand, motion.board, motion.taxel)
    rotation, axis = (frame @ motion.orientation)[:3, :3], frame[:3, 2]
    skin = points.reshape(-1, 3)
    poses = np.tile(np.eye(4), (len(motion.time_s), 1, 1))
    poses[:, :3, :3] = rotation
    beside = np.zeros(len(motion.time_s), dtype=bool)
    # Poses with the same lateral displacement share one computation of the distance to the skin.
    places, which = np.unique(motion.lateral_m, axis=0, return_inverse=True)
    for index, lateral in enumerate(places):
        rows = which.ravel() == index
        origin = frame[:3, 3] + frame[:3, :2] @ lateral + frame[:3, :3] @ motion.orientation[:3, 3]
        along = shape.ray_separation((skin - origin) @ rotation, np.broadcast_to(axis @ rotation, skin.shape)).min()
        beside[rows] = not np.isfinite(along)
        travel = motion.distance_m[rows] - (along if np.isfinite(along) else 0.0)
        poses[rows, :3, 3] = origin + travel[:, None] * axis
    return poses, np.where(beside, np.inf, motion.distance_m)


def tilt(angle_rad: float, azimuth_rad: float) -> FloatArray:
    """Make the rotation f64[4, 4] of a target that is tilted about an axis in the plane of the skin.

    azimuth_rad: direction of this axis, from the x axis of the stage.
    """
    return from_rotation_vector(angle_rad * np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), 0.0]))


def record_target_motions(
    capture: str | os.PathLike[str],
    hand: Hand,
    shapes: dict[str, Shape],
    motions: Sequence[TargetMotion],
    duration_s: float,
    settings: WorldSettings,
) -> list[TrueDistance]:
    """Record an emulated skin in front of which targets move, one after the other, and return their true distances.

    capture: file to write, in the format of `taxel record`. shapes: shapes of the targets by name. motions: in order of
    time, without overlap. duration_s: duration of the recording in virtual time. Raises `LinkError` with the message of
    the emulator.
    """
    world = format_scene(hand, EmulatedScene(shapes), settings)
    index_of = {board.name: index for index, board in enumerate(hand.boards)}
    away = np.eye(4)
    away[2, 3] = AWAY_M
    times, numbers, poses, truths = [0.0], [-1], [away[None]], []
    for motion in motions:
        dense = _resample(motion)
        in_bracket, distance = compute_target_poses(hand, shapes[motion.target], dense)
        # The brackets are placed far apart in a row, so that the target acts on one board only.
        in_bracket[:, 0, 3] += BRACKET_SPACING_M * index_of[motion.board]
        number = list(shapes).index(motion.target)
        # Records without an object (-1), 1 microsecond before and after the motion: the target appears and disappears
        # in a step.
        times += [dense.time_s[0] - 1e-6, *dense.time_s.tolist(), dense.time_s[-1] + 1e-6]
        numbers += [-1, *[number] * len(dense.time_s), -1]
        poses += [in_bracket[:1], in_bracket, in_bracket[-1:]]
        truths.append(TrueDistance(motion.board, dense.time_s, distance))
    brackets = np.tile(np.eye(4), (len(times), len(hand.boards), 1, 1))
    brackets[:, :, 0, 3] = BRACKET_SPACING_M * np.arange(len(hand.boards))
    with tempfile.TemporaryDirectory(prefix="taxel-") as name:
        scene, script = Path(name) / "scene.stimulus", Path(name) / "host.capture"
        write_scene(scene, hand.n_taxels, times, numbers, np.concatenate(poses), brackets)
        write_start_script(script)
        run_emulator(world, capture, duration_s, script, scene)
    return truths


def _resample(motion: TargetMotion) -> TargetMotion:
    """Return the motion with more poses where the target moves, at intervals of about `STEP_S` or `STEP_M`.

    Of the two intervals (time and travel), the interval that gives fewer poses is used.
    """
    times = [motion.time_s[:1]]
    moving = np.abs(np.diff(motion.distance_m)) + np.abs(np.diff(motion.lateral_m, axis=0)).sum(axis=1)
    for begin, end, travel in zip(motion.time_s[:-1], motion.time_s[1:], moving, strict=True):
        count = max(1, int(np.ceil(min((end - begin) / STEP_S, travel / STEP_M))))
        times.append(np.linspace(begin, end, count + 1)[1:])
    dense = np.concatenate(times)
    lateral = np.stack([np.interp(dense, motion.time_s, axis) for axis in motion.lateral_m.T], axis=1)
    distance = np.interp(dense, motion.time_s, motion.distance_m)
    return TargetMotion(motion.board, motion.target, motion.orientation, motion.taxel, dense, distance, lateral)
