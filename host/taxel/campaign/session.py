"""One session on the emulated hand: one mounting of the skin, one power-up, and the grasps in their order."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.performed_grasp import PerformedGrasp
from taxel.campaign.poll_cycles import PollCycles, group_by_poll_cycle
from taxel.campaign.session_world import format_session_world
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.grasp.timeline import Phase
from taxel.hand import Hand
from taxel.link import run_emulator, write_scene
from taxel.recording.grasp_format import NO_FAILURE
from taxel.recording.grasp_record import GraspRecord
from taxel.skin import open_skin
from taxel.stream.start_script import write_start_script

LEAD_IN_S = 4.0
"""Time from power-up to the first grasp; by then the hub has found every board and has read each clock twice."""


class SceneMotion(NamedTuple):
    """Motion of the scene (one object and all boards) in a part of a session, at k times.

    time_s: f64[k], seconds since power-up. number: intp[k], index of the present object in the world file.
    object_poses: f64[k, 4, 4], world. bracket_poses: f64[k, s, 4, 4] of the s boards' brackets, world, nominal: without
    the offsets of their mounting.
    """

    time_s: NDArray[np.float64]
    number: NDArray[np.intp]
    object_poses: NDArray[np.float64]
    bracket_poses: NDArray[np.float64]


def run_session(setup: Setup, grasps: Sequence[PerformedGrasp], settings: EmulatedSettings) -> list[GraspRecord]:
    """Run the emulated skin during the grasps of one session and return their records in the same order.

    grasps: performed grasps of one session (`perform_grasp`). The records depend only on the settings, the session and
    its grasps. Raises `TaxelError` with a one-line message, for example for a world file that the emulator rejects.
    """
    text = format_session_world(setup, settings, grasps[0].planned.session)
    cycles = _run_session_skin(setup, grasps, text, settings)
    return [_make_record(setup, grasp, cycles, index, settings) for index, grasp in enumerate(grasps)]


def _run_session_skin(
    setup: Setup, grasps: Sequence[PerformedGrasp], world: str, settings: EmulatedSettings
) -> PollCycles:
    """Run the emulated skin during all grasps of a session and return the frames that a host decodes, by poll cycle.

    world: text of the emulator's world file.
    """
    names = list(setup.objects)
    parts = []
    for index, grasp in enumerate(grasps):
        (begin, end), motion = _compute_grasp_interval(settings, index), grasp.motion
        # The scene is static between two grasps: the first and the last record are repeated at both ends.
        rows = np.r_[0, : len(motion.time_s), -1]
        number = np.full(len(rows), names.index(grasp.planned.object))
        times = np.r_[begin, begin + motion.time_s, end]
        parts.append(SceneMotion(times, number, motion.object_poses[rows], motion.bracket_poses[rows]))
    # 0.1 s longer than the last grasp, so that the capture contains all its frames.
    return run_emulated_skin(setup.hand, world, parts, _compute_grasp_interval(settings, len(grasps) - 1)[1] + 0.1)


def _compute_grasp_interval(settings: EmulatedSettings, index: int) -> tuple[float, float]:
    """Compute start and end of a grasp, seconds since power-up. index: number of the grasp in its session, from 0.

    The end is bit-identical to the start of the next grasp.
    """
    length = settings.timeline.duration_s
    return LEAD_IN_S + index * length, LEAD_IN_S + (index + 1) * length


def run_emulated_skin(hand: Hand, world: str, motions: Sequence[SceneMotion], duration_s: float) -> PollCycles:
    """Run the emulated skin for `duration_s` seconds with a moving scene; return the frames that a host decodes.

    world: text of the emulator's world file. motions: motions of the scene in consecutive parts of the session. Raises
    `LinkError` with the message of the emulator.
    """
    with tempfile.TemporaryDirectory(prefix="taxel-") as name:
        folder = Path(name)
        scene, script, capture = folder / "scene.stimulus", folder / "host.capture", folder / "skin.capture"
        write_scene(scene, hand.n_taxels, *(np.concatenate(arrays) for arrays in zip(*motions, strict=True)))
        write_start_script(script)
        run_emulator(world, capture, duration_s, script, scene)
        with open_skin(f"file:{capture}", hand) as skin:
            return group_by_poll_cycle(hand, skin)


def _make_record(
    setup: Setup, grasp: PerformedGrasp, cycles: PollCycles, index: int, settings: EmulatedSettings
) -> GraspRecord:
    """Make the dataset record of one grasp from the frames of its session.

    cycles: frames of the whole session. index: number of the grasp in the session, from 0.
    """
    timeline = settings.timeline
    begin, end = _compute_grasp_interval(settings, index)
    recorded = cycles.between(begin, end)
    elapsed = recorded.time_s - begin
    phase = timeline.find_phases(elapsed)
    arm, fingers = setup.arm_angles(grasp.planned, timeline, elapsed), grasp.motion.joints.interpolate(elapsed)
    joints = np.hstack([arm, fingers])
    hold = joints[phase == Phase.HOLD]
    hold_angles = hold.mean(axis=0) if len(hold) else joints[-1]
    return GraspRecord(
        object=grasp.planned.object,
        approach=grasp.planned.approach,
        iteration=grasp.planned.iteration,
        session=grasp.planned.session,
        timestamp=recorded.time_s,
        phase=phase,
        raw_counts=recorded.raw_counts,
        valid=recorded.valid,
        sensor_pose=setup.kinematics.compute_sensor_poses(hold_angles),
        object_pose=setup.object_pose(grasp.planned.object),
        sensor_time=recorded.sensor_time,
        joint_position=joints,
        attempts=grasp.attempt.attempts,
        failure=grasp.attempt.failure or NO_FAILURE,
    )
