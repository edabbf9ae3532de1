"""One session on the emulated hand: one mounting of the skin, one power-up, and the grasps in their order."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.attempts import Attempt, perform_attempts
from taxel.campaign.failure import make_grasp_check
from taxel.campaign.free_object import FreeObject
from taxel.campaign.hand_in_contact import HandInContact
from taxel.campaign.motion import Motion, simulate_grasp_motion
from taxel.campaign.poll_cycles import PollCycles, group_by_poll_cycle
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.campaign.variation import make_small_motion, sample_grasp_variation
from taxel.emulated.contact import SkinContact
from taxel.emulated.scene import EmulatedScene, format_scene
from taxel.grasp.controller import GraspController
from taxel.grasp.plan import PlannedGrasp
from taxel.grasp.timeline import Phase
from taxel.hand import Hand
from taxel.hand.world import WorldSettings
from taxel.link import run_emulator, write_scene
from taxel.recording.grasp_format import NO_FAILURE
from taxel.recording.grasp_record import GraspRecord
from taxel.skin import open_skin
from taxel.stream.start_script import write_start_script

LEAD_IN_S = 4.0
"""Time from power-up to the first grasp; by then the hub has found every board and has read each clock twice."""

_SESSION_STREAM = 1


@dataclass(frozen=True, eq=False)
class _PerformedGrasp:
    """A planned grasp and the attempt that the campaign keeps."""

    planned: PlannedGrasp
    attempt: Attempt[Motion]

    @property
    def motion(self) -> Motion:
        """True motion of hand and object in the kept attempt."""
        return self.attempt.motion


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


def run_session(setup: Setup, plan: Sequence[PlannedGrasp], settings: EmulatedSettings) -> list[GraspRecord]:
    """Perform the grasps of one session on the emulated hand and return their records in the same order.

    The records depend only on the settings, the session and its grasps. Raises `TaxelError` with a one-line message,
    for example for an unreachable pose or a world file that the emulator rejects.
    """
    text = format_session_world(setup, settings, plan[0].session)
    with SkinContact(text) as contact:
        grasps = [_perform_grasp(setup, planned, settings, contact) for planned in plan]
    cycles = _run_session_skin(setup, grasps, text, settings)
    return [_make_record(setup, grasp, cycles, index, settings) for index, grasp in enumerate(grasps)]


def check_world(setup: Setup, settings: EmulatedSettings) -> None:
    """Raise `ContactLibraryError` if the emulator rejects the effects of the settings."""
    with SkinContact(format_session_world(setup, settings, 0)):
        pass


def format_session_world(setup: Setup, settings: EmulatedSettings, session: int) -> str:
    """Format the emulator's world file of one session, in which every bracket is mounted with its own random offset."""
    world = WorldSettings(
        seed=int(np.random.SeedSequence([settings.seed, session]).generate_state(1)[0]),
        parts_seed=settings.seed,
        scl_hz=settings.scl_hz,
        baud=settings.baud,
        noise_counts=settings.noise_counts,
        effects=settings.world_effect_lines(),
    )
    return format_scene(setup.hand, _make_scene(setup, settings, session), world)


def _make_scene(setup: Setup, settings: EmulatedSettings, session: int) -> EmulatedScene:
    """Make the scene of a session on the emulated hand: shapes of the objects, and offsets of brackets and objects.

    Each bracket has a random offset, because the boards are mounted anew before each session; an offset of this bracket
    in the settings is added to it.
    """
    rng = np.random.default_rng([settings.seed, _SESSION_STREAM, session])
    variation = settings.variation
    metres, radians = variation.remount_m, variation.remount_rad
    brackets = {board.name: _sample_motion(rng, metres, radians) for board in setup.hand.boards}
    for name, offset in settings.offsets("bracket_offset").items():
        brackets[name] = offset @ brackets[setup.hand.find_board(name).name]
    shapes = {name: item.shape for name, item in setup.objects.items()}
    return EmulatedScene(shapes, brackets, settings.offsets("object_offset"))


def _sample_motion(rng: np.random.Generator, metres: float, radians: float) -> NDArray[np.float64]:
    """Sample a random small motion f64[4, 4]. metres, radians: standard deviations per axis."""
    rotation = rng.normal(size=3)
    return make_small_motion(rng.normal(size=3), rotation, metres, radians)


def _perform_grasp(
    setup: Setup, planned: PlannedGrasp, settings: EmulatedSettings, contact: SkinContact
) -> _PerformedGrasp:
    """Simulate one grasp of the emulated hand, and repeat it with another variation if it fails.

    contact: computes the contact loads. Returns the true motion of hand and object in the kept attempt. Only the kept
    attempts become part of the session, whose duration is therefore that of its plan.
    """
    check = make_grasp_check(setup, planned)
    attempt = perform_attempts(
        lambda sample: _simulate_motion(setup, planned, settings, contact, sample),
        lambda motion: check.find_failure(*motion.select_hold(settings.timeline)),
        lambda number: sample_grasp_variation(settings.seed, planned.id, number),
        settings.max_attempts,
    )
    return _PerformedGrasp(planned, attempt)


def _simulate_motion(
    setup: Setup,
    planned: PlannedGrasp,
    settings: EmulatedSettings,
    contact: SkinContact,
    sample: NDArray[np.float64],
) -> Motion:
    """Simulate hand and object in one attempt of a grasp. sample: unit samples f64[7] of the variation."""
    approach, item = setup.approach(planned), setup.objects[planned.object]
    offset, grip = settings.variation.for_object(planned.object).apply(sample)
    true_pose = setup.object_pose(planned.object) @ offset
    timeline = settings.timeline

    def wrist_at(times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Compute the wrist poses f64[k, 4, 4], world, at k times f64[k], seconds since the start of the grasp."""
        return setup.wrist_poses(setup.arm_angles(planned, timeline, times_s))

    dynamics = HandInContact(
        setup.hand,
        setup.wrist_robot,
        contact,
        list(setup.objects).index(planned.object),
        FreeObject(item.shape, true_pose),
        wrist_at(np.zeros(1))[0],
        approach.open_angles,
    )
    controller = GraspController(approach, timeline, grip)
    return simulate_grasp_motion(dynamics, controller, timeline, wrist_at)


def _run_session_skin(
    setup: Setup, grasps: Sequence[_PerformedGrasp], world: str, settings: EmulatedSettings
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
    setup: Setup, grasp: _PerformedGrasp, cycles: PollCycles, index: int, settings: EmulatedSettings
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
