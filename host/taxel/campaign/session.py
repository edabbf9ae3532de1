"""One session on the emulated hand: one mounting of the skin, one power-up, its grasps one after another."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.hand_in_contact import HandInContact, Mount
from taxel.campaign.motion import Motion, move
from taxel.campaign.rows import Rows, rows_of
from taxel.campaign.scatter import hand_draw, shift
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.emulated.contact import SkinContact
from taxel.emulated.scene import Scene, scene_text
from taxel.grasp.controller import GraspController
from taxel.grasp.objects import MOUNT_STIFFNESS_N_PER_M, MOUNT_STIFFNESS_NM_PER_RAD
from taxel.grasp.plan import PlannedGrasp
from taxel.grasp.timeline import Phase
from taxel.hand import Hand
from taxel.hand.world import WorldSettings
from taxel.link import run_emulator, write_scene
from taxel.recording.grasp_record import GraspRecord
from taxel.skin import open_skin
from taxel.stream.start_script import write_start_script

LEAD_IN_S = 4.0
"""From power to the first grasp: every board is found and its clock has been read twice."""

_SESSION_STREAM = 1


@dataclass(frozen=True, eq=False)
class _Made:
    """A grasp that was made, and what moved."""

    planned: PlannedGrasp
    motion: Motion


class Moved(NamedTuple):
    """What moves in one session. time_s: f64[k], since power-up; number: [k], which object of the world is there;
    object_poses: f64[k, 4, 4]; bracket_poses: f64[k, s, 4, 4], as they are believed to be; both in the world.
    """

    time_s: NDArray[np.float64]
    number: NDArray[np.intp]
    object_poses: NDArray[np.float64]
    bracket_poses: NDArray[np.float64]


def run_session(setup: Setup, plan: Sequence[PlannedGrasp], settings: EmulatedSettings) -> list[GraspRecord]:
    """Make the grasps of one session, in order. The seed, the session and the grasp decide everything.

    Raises `TaxelError` of one line: a pose out of reach, or a world that the emulator refuses.
    """
    text = session_world(setup, settings, plan[0].session)
    with SkinContact(text) as contact:
        made = [_make(setup, planned, settings, contact) for planned in plan]
    rows = _emulate(setup, made, text, settings)
    return [_record(setup, grasp, rows, place, settings) for place, grasp in enumerate(made)]


def check_world(setup: Setup, settings: EmulatedSettings) -> None:
    """Raises `ContactLibraryError` for effects that the emulator refuses."""
    with SkinContact(session_world(setup, settings, 0)):
        pass


def session_world(setup: Setup, settings: EmulatedSettings, session: int) -> str:
    """The text of the world in which one session takes place: its brackets are mounted anew."""
    world = WorldSettings(
        seed=int(np.random.SeedSequence([settings.seed, session]).generate_state(1)[0]),
        parts_seed=settings.seed,
        scl_hz=settings.scl_hz,
        baud=settings.baud,
        noise_counts=settings.noise_counts,
        effects=settings.world_effects(),
    )
    return scene_text(setup.hand, _scene(setup, settings, session), world)


def _scene(setup: Setup, settings: EmulatedSettings, session: int) -> Scene:
    """Where the brackets are this time: each mounting puts them a little elsewhere."""
    rng = np.random.default_rng([settings.seed, _SESSION_STREAM, session])
    scatter = settings.scatter
    metres, radians = scatter.remount_m, scatter.remount_rad
    brackets = {board.name: _drawn_shift(rng, metres, radians) for board in setup.hand.boards}
    for name, offset in settings.offsets("bracket_offset").items():
        brackets[name] = offset @ brackets[setup.hand.board_named(name).name]
    shapes = {name: item.shape for name, item in setup.objects.items()}
    return Scene(shapes, brackets, settings.offsets("object_offset"))


def _drawn_shift(rng: np.random.Generator, metres: float, radians: float) -> NDArray[np.float64]:
    turn = rng.normal(size=3)
    return shift(rng.normal(size=3), turn, metres, radians)


def _make(setup: Setup, planned: PlannedGrasp, settings: EmulatedSettings, contact: SkinContact) -> _Made:
    approach, item = setup.approach(planned), setup.objects[planned.object]
    offset, grip = settings.scatter.of(planned.object).moved(hand_draw(settings.seed, planned.id))
    true_pose = setup.object_pose(planned.object) @ offset
    timeline = settings.timeline

    def wrist_at(times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        return setup.wrist_poses(setup.arm_angles(planned, timeline, times_s))

    dynamics = HandInContact(
        setup.hand,
        setup.wrist_robot,
        contact,
        list(setup.objects).index(planned.object),
        true_pose,
        Mount(MOUNT_STIFFNESS_N_PER_M, MOUNT_STIFFNESS_NM_PER_RAD, item.shape.height / 2.0),
        wrist_at(np.zeros(1))[0],
        approach.open_angles,
    )
    return _Made(planned, move(dynamics, GraspController(approach, timeline, grip), timeline, wrist_at))


def _emulate(setup: Setup, made: Sequence[_Made], world: str, settings: EmulatedSettings) -> Rows:
    """Everything that moved, through the emulated skin, to the frames that a host decodes."""
    names = list(setup.objects)
    parts = []
    for place, grasp in enumerate(made):
        (begin, end), motion = _span(settings, place), grasp.motion
        # The first and the last record hold before and after: between two grasps nothing moves.
        held = np.r_[0, : len(motion.time_s), -1]
        number = np.full(len(held), names.index(grasp.planned.object))
        times = np.r_[begin, begin + motion.time_s, end]
        parts.append(Moved(times, number, motion.object_poses[held], motion.bracket_poses[held]))
    return emulate(setup.hand, world, parts, _span(settings, len(made) - 1)[1] + 0.1)


def _span(settings: EmulatedSettings, place: int) -> tuple[float, float]:
    """When a grasp of the session begins and ends; the end is the next one's beginning to the last bit."""
    length = settings.timeline.duration_s
    return LEAD_IN_S + place * length, LEAD_IN_S + (place + 1) * length


def emulate(hand: Hand, world: str, moved: Sequence[Moved], duration_s: float) -> Rows:
    """Run the emulated skin of `world` for `duration_s` while its objects move; what a host decodes.

    moved: parts of the session, one after another. Raises `LinkError` with the emulator's own line.
    """
    with tempfile.TemporaryDirectory(prefix="taxel-") as name:
        folder = Path(name)
        scene, script, capture = folder / "scene.stimulus", folder / "host.capture", folder / "skin.capture"
        write_scene(scene, hand.n_taxels, *(np.concatenate(arrays) for arrays in zip(*moved, strict=True)))
        write_start_script(script)
        run_emulator(world, capture, duration_s, script, scene)
        with open_skin(f"file:{capture}", hand) as skin:
            return rows_of(hand, skin)


def _record(setup: Setup, grasp: _Made, rows: Rows, place: int, settings: EmulatedSettings) -> GraspRecord:
    timeline = settings.timeline
    begin, end = _span(settings, place)
    own = rows.between(begin, end)
    since = own.time_s - begin
    phase = timeline.phase_at(since)
    joints = np.hstack([setup.arm_angles(grasp.planned, timeline, since), grasp.motion.joints.at(since)])
    hold = joints[phase == Phase.HOLD]
    held = hold.mean(axis=0) if len(hold) else joints[-1]
    return GraspRecord(
        object=grasp.planned.object,
        approach=grasp.planned.approach,
        iteration=grasp.planned.iteration,
        session=grasp.planned.session,
        timestamp=own.time_s,
        phase=phase,
        raw_counts=own.raw_counts,
        valid=own.valid,
        sensor_pose=setup.kinematics.sensor_poses(held),
        object_pose=setup.object_pose(grasp.planned.object),
        sensor_time=own.sensor_time,
        joint_position=joints,
    )
