"""A recipe: the ranges from which objects, grasps, simulator, sensor and effects are sampled."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from taxel.generate.effects import PlannedEffect
from taxel.generate.ranges import Range, fixed
from taxel.generate.solids import ObjectKind, make_default_kinds
from taxel.grasp.objects import ObjectSizes, select_object_sizes
from taxel.grasp.timeline import Timeline
from taxel.hand import load_hand
from taxel.sim.closing import RATE_HZ, SETTLE_S
from taxel.sim.sensing import Level
from taxel.sim.sensor_model import FULL_SCALE_SIGNAL_COUNTS, HALF_FORCE_N, NOISE_COUNTS, REST_COUNTS
from taxel.sim.soft_push import SOFT_STEP_S

DEFAULT_HAND: Final = "original"
"""Packaged hand of a recipe that names none."""

GRASPS_PER_SHARD: Final = 200
"""Default number of grasps in a shard: as many as the first page of a dataset has space for (see
`taxel.recording.grasp_storage`).
"""


@dataclass(frozen=True)
class Fidelity:
    """How finely and how long a grasp is simulated.

    timeline: phases of the grasp. rate_hz: stored frames per second. soft_step_s: time step of the elastic layer.
    settle_s: simulated time before the grasp.
    """

    timeline: Timeline
    rate_hz: float
    soft_step_s: float
    settle_s: float


FIDELITIES: Final[Mapping[str, Fidelity]] = {
    "quick": Fidelity(Timeline(2.0, 2.0, 1.5, 0.0, 0.0), 5.0, 2.0 * SOFT_STEP_S, 0.0),
    "full": Fidelity(Timeline(), RATE_HZ, SOFT_STEP_S, SETTLE_S),
}
"""quick: baseline, closing and hold with doubled time steps, 28 frames, without release and recovery. The frames show
no hysteresis, no creep, and not in which order contacts arise within 0.2 s. full: as `taxel grasp --source sim`.
"""


@dataclass(frozen=True)
class GraspRanges:
    """Sampled quantities of a grasp.

    turn_deg: rotation of the approach about the object's axis. reach_mm: shift of the object towards the fingertips.
    along_mm: shift along the object's axis. press_mm: motion of the palm after its first contact. thumb_deg: rotation
    of both holding joints of the thumb. grip: factor on the joint torques. top_share: share of grasps from above, for
    objects that may be approached from any side. object_mm, object_deg: standard deviations of the object's true
    position and rotation about its nominal pose, per axis; the dataset contains the nominal pose.
    """

    turn_deg: Range = Range(-6.0, 6.0)
    reach_mm: Range = Range(-3.0, 3.0)
    along_mm: Range = Range(-6.0, 6.0)
    press_mm: Range = Range(0.8, 2.2)
    thumb_deg: Range = Range(-4.0, 4.0)
    grip: Range = Range(0.85, 1.15)
    top_share: float = 0.25
    object_mm: float = 0.7
    object_deg: float = 0.6


@dataclass(frozen=True)
class SimulatorRanges:
    """Sampled quantities of the simulator.

    layer_stiffness: factor on the stiffness of the elastic layer. friction: coefficient between hand and object, only
    for the sensing level "rigid", because the elastic layer transmits only forces along its normals.
    """

    layer_stiffness: Range = Range(0.85, 1.15)
    friction: Range = fixed(0.0)


@dataclass(frozen=True)
class SensorRanges:
    """Sampled parameters of the sensor model.

    They are sampled once for each shard, because a dataset has a single sensor model.
    """

    baseline_counts: Range = fixed(REST_COUNTS)
    full_scale_drop_counts: Range = fixed(FULL_SCALE_SIGNAL_COUNTS)
    half_force_n: Range = fixed(HALF_FORCE_N)
    noise_counts: Range = fixed(NOISE_COUNTS)
    noise_line_counts: Range = fixed(0.0)


@dataclass(frozen=True)
class Recipe:
    """All quantities that determine the bytes of a generated dataset.

    grasps: number of grasps. grasps_per_shard: number of grasps in one file (shard). fidelity: a key of `FIDELITIES`.
    sensing: level of the simulated sensing. hand: name of a packaged hand. objects: kinds of objects; empty: the three
    test objects in the sizes for this hand. grasp, simulator, sensor: ranges of the sampled quantities. effects:
    effects that are added to the simulated counts.
    """

    grasps: int = 1000
    seed: int = 1
    grasps_per_shard: int = GRASPS_PER_SHARD
    fidelity: str = "quick"
    sensing: Level = "layer"
    hand: str = DEFAULT_HAND
    objects: tuple[ObjectKind, ...] = ()
    grasp: GraspRanges = field(default_factory=GraspRanges)
    simulator: SimulatorRanges = field(default_factory=SimulatorRanges)
    sensor: SensorRanges = field(default_factory=SensorRanges)
    effects: tuple[PlannedEffect, ...] = ()

    def __post_init__(self) -> None:
        """Complete the objects. Raises HandError if no packaged hand has the name `hand`."""
        if not self.objects:
            object.__setattr__(self, "objects", make_default_kinds(get_sizes(self.hand)))

    @property
    def shards(self) -> int:
        """Number of shards (files) that the grasps of the recipe fill."""
        return -(-self.grasps // self.grasps_per_shard)

    def numbers_of(self, shard: int) -> range:
        """Return the numbers of the grasps in one shard (file). shard: its number."""
        first = shard * self.grasps_per_shard
        return range(first, min(first + self.grasps_per_shard, self.grasps))

    def to_json(self) -> dict[str, Any]:
        """Return the recipe as JSON values; meshes and reports are identified by the SHA-256 of their content."""
        ranges = {name: _ranges_to_json(getattr(self, name)) for name in ("grasp", "simulator", "sensor")}
        return {
            "hand": self.hand,
            "grasps": self.grasps,
            "seed": self.seed,
            "shard": self.grasps_per_shard,
            "fidelity": self.fidelity,
            "sensing": self.sensing,
            "objects": [kind.to_json() for kind in self.objects],
            **ranges,
            "effects": [effect.to_json() for effect in self.effects],
        }

    @property
    def digest(self) -> str:
        """SHA-256 of the recipe's JSON values; equal recipes have equal digests."""
        return hashlib.sha256(json.dumps(self.to_json(), sort_keys=True).encode()).hexdigest()


def get_sizes(hand: str) -> ObjectSizes:
    """Return the sizes of the test objects for a packaged hand. Raises HandError for an unknown name."""
    return select_object_sizes(load_hand(hand).robot)


def _ranges_to_json(ranges: Any) -> dict[str, Any]:
    """Return the fields of a `GraspRanges`, `SimulatorRanges` or `SensorRanges` as JSON values."""
    return {name: value.to_json() if isinstance(value, Range) else value for name, value in vars(ranges).items()}
