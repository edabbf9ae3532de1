"""What a press campaign does: objects on a soft mount, straight lines into a skin at rest, order and repeats."""

from __future__ import annotations

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
class PressMount:
    """Springs that carry the object, at the middle of its bounds: `n_per_m` along each axis, `nm_per_rad` about it.

    Chosen: 20 N compress it by 7 mm, ten times what a skin gives way by, so that where exactly the mount stands does
    not matter; 0.1 Nm turn it by 0.7 degrees, so that a face lays itself nearly flat.
    """

    n_per_m: float = 3000.0
    nm_per_rad: float = 8.0


@dataclass(frozen=True, eq=False)
class PressApproach:
    """One way to press: which object, where, along which line, how hard.

    Attributes:
        object: name of the object.
        name: such as "press_1"; it tells nothing.
        boards: names of the boards that are pressed, one or two.
        direction: unit vector f64[3] in the world, along which the object comes.
        touch_pose: f64[4, 4], world: where the object on its way first touches the skin, if all is where it is
            believed to be and the mount is not loaded.
        held_pose: f64[4, 4], world: where it is planned to rest in the hold.
        force_n: what the mount's spring along `direction` is compressed by in the hold, newtons.
    """

    object: str
    name: str
    boards: tuple[str, ...]
    direction: FloatArray
    touch_pose: FloatArray
    held_pose: FloatArray
    force_n: float


@dataclass(frozen=True, eq=False)
class PlannedPress:
    """One press. id: unique, sorts by time. iteration: how many presses of that approach came before it, from 0."""

    id: str
    approach: PressApproach
    iteration: int
    session: int


@dataclass(frozen=True, eq=False)
class PressPlan:
    """Presses of objects into the boards of a hand that stands still.

    Attributes:
        hand: the skin.
        bracket_poses: f64[s, 4, 4], world: where the rig holds its brackets.
        objects: by name.
        approaches: each is pressed in every session.
        presses: in the order in which they are made.
        timeline: the phases of one press.
        mount: what carries the object.
    """

    hand: Hand
    bracket_poses: FloatArray
    objects: Mapping[str, GraspObject]
    approaches: tuple[PressApproach, ...]
    presses: tuple[PlannedPress, ...]
    timeline: Timeline
    mount: PressMount = field(default_factory=PressMount)

    @cached_property
    def setup(self) -> Setup:
        """The hand and the objects as every campaign has them."""
        return Setup(self.hand, self.objects)

    def centre(self, name: str) -> FloatArray:
        """The point of an object at which the mount holds it, f64[3], object frame."""
        return np.asarray(self.objects[name].shape.bounds.mean(axis=0))

    def describe(self) -> str:
        """A few words for the dataset's generator; equal for equal plans."""
        digest = hashlib.sha256(repr((self.hand.name, self.timeline, self.mount)).encode())
        digest.update(self.bracket_poses.tobytes())
        for item in self.objects.values():
            digest.update(item.name.encode() + item.shape.mesh()[0].tobytes())
        for approach in self.approaches:
            digest.update(f"{approach.object} {approach.name} {approach.force_n!r}".encode())
            digest.update(approach.direction.tobytes() + approach.touch_pose.tobytes())
        digest.update(" ".join(press.id for press in self.presses).encode())
        return f"press plan {digest.hexdigest()[:12]}"


def ordered(
    approaches: tuple[PressApproach, ...], sessions: int, repeats: int, rng: np.random.Generator
) -> tuple[PlannedPress, ...]:
    """Every approach `repeats` times in each session, the order inside a session drawn."""
    made = dict.fromkeys((approach.name for approach in approaches), 0)
    places, width = len(approaches) * repeats, len(str(sessions - 1))
    presses = []
    for session in range(sessions):
        for place, index in enumerate(rng.permutation(places).tolist()):
            approach = approaches[index % len(approaches)]
            number = made[approach.name]
            made[approach.name] += 1
            name = f"s{session:0{width}d}_{place:0{len(str(places - 1))}d}_{approach.name}_{number}"
            presses.append(PlannedPress(name, approach, number, session))
    return tuple(presses)
