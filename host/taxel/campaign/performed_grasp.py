"""Grasps of the emulated hand: the motion of hand and object, which does not depend on the effects of the skin."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from taxel.campaign.attempts import Attempt, perform_attempts
from taxel.campaign.failure import make_grasp_check
from taxel.campaign.free_object import FreeObject
from taxel.campaign.hand_in_contact import HandInContact
from taxel.campaign.motion import Motion, simulate_grasp_motion
from taxel.campaign.session_world import format_session_world
from taxel.campaign.settings import OFFSETS, EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.campaign.variation import sample_grasp_variation
from taxel.emulated.contact import SkinContact
from taxel.grasp.controller import GraspController
from taxel.grasp.plan import PlannedGrasp
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class PerformedGrasp:
    """A planned grasp and the attempt that the campaign keeps."""

    planned: PlannedGrasp
    attempt: Attempt[Motion]

    @property
    def motion(self) -> Motion:
        """True motion of hand and object in the kept attempt."""
        return self.attempt.motion


class GraspMemory:
    """Performed grasps that several campaigns with the same setup share.

    Campaigns that differ only in the effects of the skin have the same motions. A motion takes several times as long to
    compute as the counts of the skin during this motion.
    """

    def __init__(self) -> None:
        """Create an empty memory."""
        self._grasps: dict[str, PerformedGrasp] = {}

    def list_missing(self, plan: Iterable[PlannedGrasp], settings: EmulatedSettings) -> list[PlannedGrasp]:
        """List the planned grasps that are not stored as a campaign with these settings performs them."""
        return [planned for planned in plan if _describe_motion(planned, settings) not in self._grasps]

    def get(self, planned: PlannedGrasp, settings: EmulatedSettings) -> PerformedGrasp:
        """Return a planned grasp as a campaign with these settings performs it. Raises KeyError if it is missing."""
        return self._grasps[_describe_motion(planned, settings)]

    def add(self, grasp: PerformedGrasp, settings: EmulatedSettings) -> None:
        """Store a grasp that was performed with the given settings."""
        self._grasps[_describe_motion(grasp.planned, settings)] = grasp


def select_mechanical_settings(settings: EmulatedSettings) -> EmulatedSettings:
    """Return the settings that determine the motion of a grasp; all other settings have fixed values.

    The effects of the skin and the noise are removed, and the I2C clock and the baud rate have their default values,
    because they change only the counts. The displacements of brackets and objects remain, because they change the
    contact.
    """
    offsets = tuple(line for line in settings.effects if line.split()[0] in OFFSETS)
    return replace(
        settings,
        effects=offsets,
        noise_counts=0.0,
        scl_hz=EmulatedSettings.scl_hz,
        baud=EmulatedSettings.baud,
    )


def _describe_motion(planned: PlannedGrasp, settings: EmulatedSettings) -> str:
    """Return a text that is equal for grasps with equal motions."""
    return f"{planned!r} {select_mechanical_settings(settings)!r}"


def perform_grasp(setup: Setup, planned: PlannedGrasp, settings: EmulatedSettings) -> PerformedGrasp:
    """Simulate one grasp of the emulated hand, and repeat it with another variation if it fails.

    Only the kept attempt becomes part of the session: repeated attempts do not lengthen the session. Raises
    `TaxelError` with a one-line message, for example for an unreachable pose.
    """
    mechanical = select_mechanical_settings(settings)
    check = make_grasp_check(setup, planned)
    with SkinContact(format_session_world(setup, mechanical, planned.session)) as contact:
        attempt = perform_attempts(
            lambda sample: _simulate_motion(setup, planned, mechanical, contact, sample),
            lambda motion: check.find_failure(*motion.select_hold(mechanical.timeline)),
            lambda number: sample_grasp_variation(mechanical.seed, planned.id, number),
            mechanical.max_attempts,
        )
    return PerformedGrasp(planned, attempt)


def _simulate_motion(
    setup: Setup, planned: PlannedGrasp, settings: EmulatedSettings, contact: SkinContact, sample: FloatArray
) -> Motion:
    """Simulate hand and object in one attempt of a grasp. sample: unit samples f64[7] of the variation."""
    approach, item = setup.approach(planned), setup.objects[planned.object]
    offset, grip = settings.variation.for_object(planned.object).apply(sample)
    true_pose = setup.object_pose(planned.object) @ offset
    timeline = settings.timeline

    def wrist_at(times_s: FloatArray) -> FloatArray:
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
