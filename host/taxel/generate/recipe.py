"""What is generated: objects, grasps, simulator, sensor and effects, each number drawn from a range."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from taxel.generate.effects import PlannedEffect
from taxel.generate.ranges import Range, fixed
from taxel.generate.solids import ObjectKind, default_kinds
from taxel.grasp.timeline import Timeline
from taxel.sim.closing import RATE_HZ, SETTLE_S
from taxel.sim.sensing import Level
from taxel.sim.sensor_model import FULL_SCALE_SIGNAL_COUNTS, HALF_FORCE_N, NOISE_COUNTS, REST_COUNTS
from taxel.sim.soft_push import SOFT_STEP_S

HAND: Final = "allegro"

SHARD: Final = 200
"""Grasps of a shard: as many as a dataset's first page has room for (`taxel.recording.grasp_storage`)."""


@dataclass(frozen=True)
class Fidelity:
    """How much of a grasp is simulated, and in which steps. rate_hz: frames a second that are kept."""

    timeline: Timeline
    rate_hz: float
    soft_step_s: float
    settle_s: float


FIDELITIES: Final[Mapping[str, Fidelity]] = {
    "quick": Fidelity(Timeline(2.0, 2.0, 1.5, 0.0, 0.0), 5.0, 2.0 * SOFT_STEP_S, 0.0),
    "full": Fidelity(Timeline(), RATE_HZ, SOFT_STEP_S, SETTLE_S),
}
"""quick: the same closing and hold in steps twice as long, 28 frames; no release and no recovery. Hysteresis, creep and
the order in which boards are touched within 0.2 s are not in it. full: as `taxel grasp --source sim`."""


@dataclass(frozen=True)
class GraspRanges:
    """How a grasp departs from its approach. turn_deg: about the object's axis. reach_mm: towards the fingertips.
    along_mm: along the object's axis. press_mm: how far the palm goes on once it touches. thumb_deg: of both joints of
    the thumb that hold. grip: factor on the torques. top_share: of grasps from above, where approaches are "any".
    object_mm, object_deg: standard deviations of where the object truly stands and how it is turned, each axis; nobody
    is told these.
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
    """layer_stiffness: factor on the elastic layer's. friction: between hand and object; only where sensing is "rigid",
    since the layer bears along its normals alone.
    """

    layer_stiffness: Range = Range(0.85, 1.15)
    friction: Range = fixed(0.0)


@dataclass(frozen=True)
class SensorRanges:
    """The sensor model, drawn once for each shard: a dataset states one, as a skin that stays mounted has one."""

    baseline_counts: Range = fixed(REST_COUNTS)
    full_scale_drop_counts: Range = fixed(FULL_SCALE_SIGNAL_COUNTS)
    half_force_n: Range = fixed(HALF_FORCE_N)
    noise_counts: Range = fixed(NOISE_COUNTS)
    noise_line_counts: Range = fixed(0.0)


@dataclass(frozen=True)
class Recipe:
    """All that decides the bytes that come out. grasps: how many. shard: how many stand in one file."""

    grasps: int = 1000
    seed: int = 1
    shard: int = SHARD
    fidelity: str = "quick"
    sensing: Level = "layer"
    objects: tuple[ObjectKind, ...] = field(default_factory=default_kinds)
    grasp: GraspRanges = field(default_factory=GraspRanges)
    simulator: SimulatorRanges = field(default_factory=SimulatorRanges)
    sensor: SensorRanges = field(default_factory=SensorRanges)
    effects: tuple[PlannedEffect, ...] = ()

    @property
    def shards(self) -> int:
        """Number of files."""
        return -(-self.grasps // self.shard)

    def numbers_of(self, shard: int) -> range:
        """The numbers of the grasps in a shard."""
        return range(shard * self.shard, min((shard + 1) * self.shard, self.grasps))

    def to_json(self) -> dict[str, Any]:
        """As plain values; files are named by what is in them."""
        groups = {name: _plain(getattr(self, name)) for name in ("grasp", "simulator", "sensor")}
        return {
            "hand": HAND,
            **{name: getattr(self, name) for name in ("grasps", "seed", "shard", "fidelity", "sensing")},
            "objects": [kind.to_json() for kind in self.objects],
            **groups,
            "effects": [effect.to_json() for effect in self.effects],
        }

    @property
    def digest(self) -> str:
        """SHA-256 of `to_json`: equal for equal recipes."""
        return hashlib.sha256(json.dumps(self.to_json(), sort_keys=True).encode()).hexdigest()


def _plain(group: Any) -> dict[str, Any]:
    return {name: value.to_json() if isinstance(value, Range) else value for name, value in vars(group).items()}
