"""Force and separation of every taxel during a simulated motion, with one of five contact models."""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import build_sheet
from taxel.sim.closing import GraspMotion
from taxel.sim.cone_sensing import CONTACT_OFFSET_M, ConeSensing, assign_nominal_force, compute_base_radius
from taxel.sim.coupled_layer import press_coupled_layer
from taxel.sim.layer import STIFFNESS_N_PER_M, press_layer
from taxel.sim.original_sensing import OriginalRules, sense_messages
from taxel.sim.separation import compute_separations, get_layer_thickness
from taxel.sim.soft_contact import LayerLaw
from taxel.types import FloatArray

SPRINGS_PER_SIDE = 2
"""Springs along each side of a taxel (chosen): an edge that passes between the centres of two taxels loads both."""

Level = Literal["layer", "rigid", "coupled", "cones", "original"]
LEVELS: tuple[Level, ...] = ("layer", "rigid", "coupled", "cones")
"""Contact models that apply to every hand and every motion."""
GRASP_LEVELS: tuple[Level, ...] = (*LEVELS, "original")
"""Contact models of simulated grasps: "original" needs messages of contact sensors and the hand `original`."""


@dataclass(frozen=True)
class Sensing:
    """Model that converts contact into forces on taxels.

    level: "layer" (default), an elastic layer of uncoupled springs with the force law `law`, which bears the load while
    the bodies move; "rigid", rigid boards, and afterwards the approach and two tilts of each board at which uncoupled
    linear springs balance MuJoCo's net force and moments; "coupled", as "rigid" with springs that a membrane couples;
    "cones", the model of the thesis: contact points within a distance of taxel centres; "original", the contact plug-in
    of the original simulator with the rules `original`, for the hand `original` (see `taxel.sim.original_sensing`).
    stiffness_n_per_m: of the linear springs under one taxel. cone_offset_m: distance from a cone's tip to the object up
    to which the cone touches. cone_pitches: extension of the cones' bases beyond their taxels, in pitches, which
    imitates contact propagation.
    """

    level: Level = "layer"
    law: LayerLaw = field(default_factory=LayerLaw)
    stiffness_n_per_m: float = STIFFNESS_N_PER_M
    cone_offset_m: float = CONTACT_OFFSET_M
    cone_pitches: float = 0.0
    original: OriginalRules = field(default_factory=OriginalRules)


class SensedContact(NamedTuple):
    """Contact of all taxels.

    contact_force: f64[T, n], newtons. separation: f64[T, n], metres. signal_force: f64[T, n], newtons, force from which
    the sensor's counts follow, where it differs from `contact_force`; None: `contact_force`.
    """

    contact_force: FloatArray
    separation: FloatArray
    signal_force: FloatArray | None = None


def sense(hand: Hand, shape: Shape, motion: GraspMotion, sensing: Sensing) -> SensedContact:
    """Compute force and separation of every taxel of `hand` on an object of shape `shape` during `motion`.

    `Sensing` describes the contact models ("levels"). With level "cones" an active taxel carries `NOMINAL_FORCE_N`, any
    other taxel carries no force, and the separations are those of the rigid geometry. The tips of the cones lie on the
    surface of the layer, because the cones of the thesis are as high as the layer. For a motion of rigid boards, such
    as an imported rollout, level "layer" is evaluated as "rigid". Raises ValueError for level "original" if the motion
    has no messages of contact sensors.
    """
    poses, objects = motion.sensor_poses, motion.object_pose
    if sensing.level == "layer" and motion.taxel_force is not None:
        return SensedContact(motion.taxel_force, compute_separations(hand, shape, poses, objects))
    if sensing.level == "original":
        if motion.messages is None:
            raise ValueError("level 'original': expected a motion with messages of contact sensors, found none")
        contact = sense_messages(hand, poses, motion.time_s, motion.messages, sensing.original)
        separation = compute_separations(hand, shape, poses, objects)
        return SensedContact(contact.force_n, separation, assign_nominal_force(contact.active))
    if sensing.level == "cones":
        cones = ConeSensing(
            compute_base_radius(hand, sensing.cone_pitches), sensing.cone_offset_m, get_layer_thickness(hand)
        )
        points = (motion.contacts.sample, motion.contacts.position)
        active = cones.find_active(hand, shape, poses, objects, points)
        return SensedContact(assign_nominal_force(active), compute_separations(hand, shape, poses, objects))
    if sensing.level == "coupled":
        coupled = press_coupled_layer(hand, shape, poses, objects, motion.wrench, sensing.stiffness_n_per_m)
        return SensedContact(coupled.contact_force, coupled.separation)
    return _sense_layer(hand, shape, motion, sensing.stiffness_n_per_m)


def _sense_layer(hand: Hand, shape: Shape, motion: GraspMotion, stiffness_n_per_m: float) -> SensedContact:
    """Compute the taxel forces and separations of the uncoupled layer with `SPRINGS_PER_SIDE`^2 springs per taxel.

    The margin of the sheet without electrodes bears its share of the load, which no taxel senses. stiffness_n_per_m:
    stiffness of the layer over one taxel.
    """
    pieces = SPRINGS_PER_SIDE**2
    result = press_layer(
        build_sheet(hand, SPRINGS_PER_SIDE),
        shape,
        motion.sensor_poses,
        motion.object_pose,
        motion.wrench,
        stiffness_n_per_m,
    )
    frames = len(result.contact_force)
    force = result.contact_force[:, : hand.n_taxels * pieces].reshape(frames, hand.n_taxels, pieces).sum(axis=2)
    return SensedContact(force, compute_separations(hand, shape, result.rest_poses, motion.object_pose))
