"""From a simulated motion to what every taxel feels, at the level that is asked for."""

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import build_sheet
from taxel.sim.closing import GraspMotion
from taxel.sim.cone_sensing import CONTACT_OFFSET_M, ConeSensing, base_radius, nominal_forces
from taxel.sim.coupled_layer import press_coupled_layer
from taxel.sim.layer import STIFFNESS_N_PER_M, press_layer
from taxel.sim.separation import layer_thickness, separations
from taxel.sim.soft_contact import LayerLaw
from taxel.types import FloatArray

PARTS = 2
"""Springs along each side of a taxel: an edge that passes between two taxels' centres presses both."""

Level = Literal["layer", "rigid", "coupled", "cones"]
LEVELS: tuple[Level, ...] = ("layer", "rigid", "coupled", "cones")


@dataclass(frozen=True)
class Sensing:
    """How contact becomes force on taxels.

    level: "layer", an elastic layer of uncoupled springs that bears while the bodies move, `law` (the default);
    "rigid", rigid boards, and afterwards the approach and two tilts of each at which uncoupled springs make MuJoCo's
    net force and moments; "coupled", the same with springs that pull on each other; "cones", the thesis's own: contact
    points against taxel centres. stiffness_n_per_m: of the springs under one taxel where they are linear.
    cone_offset_m: how near a cone's tip touches. cone_pitches: how far the cones' bases reach beyond their own taxels,
    to imitate contact propagation.
    """

    level: Level = "layer"
    law: LayerLaw = field(default_factory=LayerLaw)
    stiffness_n_per_m: float = STIFFNESS_N_PER_M
    cone_offset_m: float = CONTACT_OFFSET_M
    cone_pitches: float = 0.0


class Sensed(NamedTuple):
    """contact_force: f64[T, n], newtons. separation: f64[T, n], metres."""

    contact_force: FloatArray
    separation: FloatArray


def sense(hand: Hand, shape: Shape, motion: GraspMotion, sensing: Sensing) -> Sensed:
    """What every taxel of `hand` feels of an object of `shape` during `motion`.

    With cones a taxel is active or not: an active one carries `NOMINAL_FORCE_N`, and separations are those of the
    rigid geometry. A motion of rigid boards, such as somebody else's rollout, is sensed at level "rigid" where "layer"
    is asked for. With cones the tips are at the layer's surface, which is what the rigid boards touch with: the
    thesis's cones are as high as its layer.
    """
    poses, objects = motion.sensor_poses, motion.object_pose
    if sensing.level == "layer" and motion.taxel_force is not None:
        return Sensed(motion.taxel_force, separations(hand, shape, poses, objects))
    if sensing.level == "cones":
        cones = ConeSensing(base_radius(hand, sensing.cone_pitches), sensing.cone_offset_m, layer_thickness(hand))
        points = (motion.contacts.sample, motion.contacts.position)
        active = cones.active(hand, shape, poses, objects, points)
        return Sensed(nominal_forces(active), separations(hand, shape, poses, objects))
    if sensing.level == "coupled":
        coupled = press_coupled_layer(hand, shape, poses, objects, motion.wrench, sensing.stiffness_n_per_m)
        return Sensed(coupled.contact_force, coupled.separation)
    return _sense_layer(hand, shape, motion, sensing.stiffness_n_per_m)


def _sense_layer(hand: Hand, shape: Shape, motion: GraspMotion, stiffness_n_per_m: float) -> Sensed:
    """The uncoupled layer, `PARTS` x `PARTS` springs a taxel; the bare margin bears its part, which nothing feels."""
    pieces = PARTS * PARTS
    result = press_layer(
        build_sheet(hand, PARTS),
        shape,
        motion.sensor_poses,
        motion.object_pose,
        motion.wrench,
        stiffness_n_per_m / pieces,
    )
    frames = len(result.contact_force)
    force = result.contact_force[:, : hand.n_taxels * pieces].reshape(frames, hand.n_taxels, pieces).sum(axis=2)
    return Sensed(force, separations(hand, shape, result.rest_poses, motion.object_pose))
