"""One grasp of a recipe, made: simulated, sensed, turned into counts, with its effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.setup import WITHDRAW_M, WRIST_LINK, Setup
from taxel.gap.adding.added import with_effects
from taxel.gap.adding.draws import Chance
from taxel.gap.adding.frames import FrameStates
from taxel.generate.draws import DrawnGrasp, draw_effects, draw_grasp, draw_sensor, noise_of
from taxel.generate.errors import HopelessDrawError
from taxel.generate.recipe import FIDELITIES, Recipe
from taxel.grasp.objects import standing_pose
from taxel.grasp.plan import approach_of
from taxel.grasp.timeline import Phase
from taxel.recording.grasp_record import GraspRecord
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.sim.closing import GraspMotion, simulate_grasp
from taxel.sim.scene import build_scene
from taxel.sim.sensing import Sensing, sense
from taxel.sim.sensor_model import SimSensor

MOST_FORCE_N: Final = 1000.0
"""Of one taxel. No press is that hard: the solver has lost the grasp, and it is drawn again."""

FORCE_STEP_N, LENGTH_STEP_M = 2.0**-20, 2.0**-27
"""To these, a micronewton and 7 nm, forces and separations are rounded: what is below is noise of the solver that no
file should be twice as large for."""

TOUCHED_N: Final = 0.05
"""Mean force in hold from which a taxel is touched."""


class Made(NamedTuple):
    """A grasp and its row in the index. values: what was drawn and what came out, by name."""

    record: GraspRecord
    mesh: ObjectMesh
    label: str
    values: dict[str, float]


@dataclass(frozen=True, eq=False)
class _Numbered(GraspRecord):
    """A grasp that stands in no file yet, with the id by which an error names it."""

    id: str = ""


@dataclass(eq=False)
class ShardMaker:
    """What the grasps of a shard have in common. objects: what the grasp in hand is of."""

    recipe: Recipe
    shard: int
    setup: Setup
    path: Path = field(default_factory=lambda: Path("generated"))
    objects: Mapping[str, ObjectMesh] = field(default_factory=dict)

    @cached_property
    def sensor(self) -> SimSensor:
        """Of the shard."""
        return draw_sensor(self.recipe, self.shard)

    @cached_property
    def sensing(self) -> Sensing:
        """Without what each grasp draws."""
        return Sensing(self.recipe.sensing)

    @cached_property
    def sensor_model(self) -> SensorModel:
        """As the shard states it; the layer's stiffness is that without a drawn factor."""
        layer = "coupled" if self.recipe.sensing == "coupled" else "uncoupled"
        return self.sensor.told(self.sensing.stiffness_n_per_m, layer)

    @cached_property
    def taxels(self) -> TaxelTable:
        """Of the hand."""
        return self.setup.taxel_table()

    @cached_property
    def sensors(self) -> SensorTable:
        """Of the hand."""
        return self.setup.sensor_table(FIDELITIES[self.recipe.fidelity].rate_hz)

    @cached_property
    def _states(self) -> FrameStates:
        return FrameStates(self)

    def make(self, number: int) -> Made:
        """A grasp of the shard. Raises HopelessDrawError."""
        drawn = draw_grasp(self.recipe, number)
        while (motion := self._simulate(drawn)) is None:
            try:
                drawn = draw_grasp(self.recipe, number, drawn.attempt + 1)
            except HopelessDrawError:
                raise HopelessDrawError(number, drawn.kind.name, "forces beyond any press") from None
        record, force = self._recorded(drawn, motion)
        vertices, faces = drawn.item.shape.mesh()
        mesh = ObjectMesh(vertices, faces.astype(np.int32))
        record, added = self._with_effects(drawn, record, mesh)
        told = {"attempt": float(drawn.attempt), **drawn.values, **added}
        told |= {"force_n": float(force.sum()), "touched": float((force > TOUCHED_N).sum())}
        return Made(record, mesh, drawn.kind.name, told)

    def _simulate(self, drawn: DrawnGrasp) -> GraspMotion | None:
        """None where the solver has lost it."""
        recipe, hand = self.recipe, self.setup.hand
        fidelity, soft = FIDELITIES[recipe.fidelity], recipe.sensing == "layer"
        law = replace(self.sensing.law, stiffness_n_per_m=drawn.layer_stiffness * self.sensing.law.stiffness_n_per_m)
        motion = simulate_grasp(
            build_scene(hand, drawn.item, WRIST_LINK, drawn.friction),
            approach_of(drawn.item, drawn.approach, drawn.placing, hand, withdraw_m=WITHDRAW_M),
            fidelity.timeline,
            fidelity.rate_hz,
            drawn.offset,
            drawn.grip,
            seed=drawn.stops_seed,
            law=law if soft else None,
            soft_step_s=fidelity.soft_step_s,
            settle_s=fidelity.settle_s,
        )
        felt = motion.wrench if motion.taxel_force is None else motion.taxel_force
        return motion if np.isfinite(felt).all() and np.abs(felt).max() < MOST_FORCE_N else None

    def _recorded(self, drawn: DrawnGrasp, motion: GraspMotion) -> tuple[GraspRecord, NDArray[np.float64]]:
        """The grasp without effects, and the mean force in hold on each taxel, f64[n]."""
        hand = self.setup.hand
        stiffness = drawn.layer_stiffness * self.sensing.stiffness_n_per_m
        sensed = sense(hand, drawn.item.shape, motion, replace(self.sensing, stiffness_n_per_m=stiffness))
        force = FORCE_STEP_N * np.rint(sensed.contact_force / FORCE_STEP_N)
        hold = np.flatnonzero(motion.phase == Phase.HOLD)
        record = GraspRecord(
            object=drawn.item.name,
            approach=drawn.approach,
            iteration=drawn.number,
            session=self.shard,
            timestamp=motion.time_s,
            phase=motion.phase,
            raw_counts=self.sensor.raw_counts(hand, force, noise_of(self.recipe, drawn.number)),
            valid=np.ones((len(motion.time_s), len(hand.boards)), bool),
            sensor_pose=motion.sensor_poses[hold[len(hold) // 2]],
            object_pose=standing_pose(),
            contact_force=force,
            separation=LENGTH_STEP_M * np.rint(sensed.separation / LENGTH_STEP_M),
        )
        return record, np.asarray(force[hold].mean(axis=0))

    def _with_effects(
        self, drawn: DrawnGrasp, record: GraspRecord, mesh: ObjectMesh
    ) -> tuple[GraspRecord, dict[str, float]]:
        effects, told = draw_effects(self.recipe, drawn.number)
        if not effects:
            return record, told
        self.objects = {drawn.kind.name: mesh}  # an effect on an object is on all of its kind
        grasp = _Numbered(**{**vars(record), "object": drawn.kind.name}, id=str(drawn.number))
        chance = Chance(self.recipe.seed, drawn.number, 0, 1)
        raw, valid = with_effects(self._states.of(grasp), grasp, effects, chance)
        return replace(record, raw_counts=raw, valid=valid), told
