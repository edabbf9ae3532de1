"""The plan of an indentation campaign: objects, mount, straight approaches to a fixed skin, order and repeats."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from taxel.campaign.setup import Setup
from taxel.grasp.objects import GraspObject
from taxel.grasp.timeline import Timeline
from taxel.hand import Hand
from taxel.types import FloatArray


@dataclass(frozen=True)
class IndenterMount:
    """Springs that hold the object at the centre of its bounding box.

    n_per_m: stiffness along each axis. nm_per_rad: rotational stiffness about each axis. The default values are chosen:
    20 N compress the springs by 7 mm, ten times the deflection of a skin, so that the exact position of the mount is
    uncritical; 0.1 Nm rotate the object by 0.7 degrees, so that a face aligns itself with the skin.
    """

    n_per_m: float = 3000.0
    nm_per_rad: float = 8.0


@dataclass(frozen=True, eq=False)
class IndentationApproach:
    """One way to press an object into the skin.

    Attributes:
        object: name of the object.
        name: such as "press_1"; the number is independent of the boards and the object.
        boards: names of the one or two boards that are loaded.
        direction: unit vector f64[3], world, along which the object moves.
        touch_pose: f64[4, 4], world: nominal pose of the object at first contact, with the mount unloaded.
        held_pose: f64[4, 4], world: planned pose of the object in the hold.
        force_n: force of the mount's spring along `direction` in the hold, newtons.
    """

    object: str
    name: str
    boards: tuple[str, ...]
    direction: FloatArray
    touch_pose: FloatArray
    held_pose: FloatArray
    force_n: float


@dataclass(frozen=True, eq=False)
class PlannedIndentation:
    """One indentation of a plan.

    id: unique; the alphabetical order of the ids is the order of execution. iteration: number of earlier indentations
    of the same approach in the plan. session: number of its session, from 0.
    """

    id: str
    approach: IndentationApproach
    iteration: int
    session: int


@dataclass(frozen=True, eq=False)
class IndentationPlan:
    """Indentations of a hand whose boards do not move.

    Attributes:
        hand: the hand that wears the skin.
        bracket_poses: f64[s, 4, 4], world: nominal poses of the brackets on the rig.
        objects: objects that are pressed into the skin, by name.
        approaches: ways to press an object into the skin; each occurs in every session.
        indentations: in the order of execution.
        timeline: the phases of one indentation.
        mount: springs that carry the object.
    """

    hand: Hand
    bracket_poses: FloatArray
    objects: Mapping[str, GraspObject]
    approaches: tuple[IndentationApproach, ...]
    indentations: tuple[PlannedIndentation, ...]
    timeline: Timeline
    mount: IndenterMount = field(default_factory=IndenterMount)

    @cached_property
    def setup(self) -> Setup:
        """Hand and objects of the plan, in the form that grasp campaigns use."""
        return Setup(self.hand, self.objects)

    def centre(self, name: str) -> FloatArray:
        """Return the point of an object at which the mount holds it, f64[3], metres, in the object frame."""
        return np.asarray(self.objects[name].shape.bounds.mean(axis=0))

    def describe(self) -> str:
        """Return a short description with a digest of the plan, for the generator attribute of a dataset.

        Equal plans give equal descriptions.
        """
        digest = hashlib.sha256(repr((self.hand.name, self.timeline, self.mount)).encode())
        digest.update(self.bracket_poses.tobytes())
        for item in self.objects.values():
            digest.update(item.name.encode() + item.shape.mesh()[0].tobytes())
        for approach in self.approaches:
            digest.update(f"{approach.object} {approach.name} {approach.force_n!r}".encode())
            digest.update(approach.direction.tobytes() + approach.touch_pose.tobytes())
        digest.update(" ".join(indentation.id for indentation in self.indentations).encode())
        return f"indentation plan {digest.hexdigest()[:12]}"


def order_indentations(
    approaches: tuple[IndentationApproach, ...], sessions: int, repeats: int, rng: np.random.Generator
) -> tuple[PlannedIndentation, ...]:
    """Make the indentations of a plan in order of execution: every approach `repeats` times per session, shuffled."""
    iterations = dict.fromkeys((approach.name for approach in approaches), 0)
    per_session, session_digits = len(approaches) * repeats, len(str(sessions - 1))
    indentations = []
    for session in range(sessions):
        for position, index in enumerate(rng.permutation(per_session).tolist()):
            approach = approaches[index % len(approaches)]
            iteration = iterations[approach.name]
            iterations[approach.name] += 1
            position_text = f"{position:0{len(str(per_session - 1))}d}"
            name = f"s{session:0{session_digits}d}_{position_text}_{approach.name}_{iteration}"
            indentations.append(PlannedIndentation(name, approach, iteration, session))
    return tuple(indentations)
