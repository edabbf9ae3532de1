"""Generation of one grasp of a recipe: motion, contact forces, raw counts, effects."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from taxel.campaign.setup import WITHDRAW_M, WRIST_LINK, Setup
from taxel.gap.apply.frames import FrameStates
from taxel.gap.apply.grasp_effects import add_effects_to_grasp
from taxel.gap.apply.random_samples import RandomStreams
from taxel.generate.errors import SamplingError
from taxel.generate.placement import shift_recorded_approach
from taxel.generate.recipe import FIDELITIES, Recipe
from taxel.generate.sampling import SampledGrasp, make_noise_generator, sample_effects, sample_grasp, sample_sensor
from taxel.grasp.objects import make_standing_pose
from taxel.grasp.plan import ITERATIONS, Approach, PlannedGrasp, make_approach
from taxel.grasp.timeline import Phase
from taxel.recording.grasp_record import GraspRecord
from taxel.recording.grasp_sensor_model import SensorModel
from taxel.recording.grasp_tables import ObjectMesh, SensorTable, TaxelTable
from taxel.sim.closing import GraspMotion, SimulationSettings, simulate_grasp
from taxel.sim.scene import build_scene
from taxel.sim.sensing import Sensing, sense
from taxel.sim.sensor_model import SimSensor
from taxel.types import FloatArray

MAX_FORCE_N: Final = 1000.0
"""Largest force on one taxel, newtons. A grasp with a larger force is sampled again, because the solver has diverged:
real contacts stay below 50 N. A smaller value would remove valid grasps.
"""

FORCE_STEP_N, LENGTH_STEP_M = 2.0**-20, 2.0**-27
"""Forces and separations are rounded to these steps, one micronewton and 7 nm. Smaller digits are noise of the solver,
which would double the size of a file.
"""

TOUCHED_N: Final = 0.05
"""Mean force during hold above which a taxel is treated as touched, newtons."""


class GeneratedGrasp(NamedTuple):
    """A generated grasp and its line in the index.

    record: dataset record. mesh: triangle mesh of its object. label: kind of object. values: sampled values and results
    of the simulation, by name.
    """

    record: GraspRecord
    mesh: ObjectMesh
    label: str
    values: dict[str, float]


@dataclass(frozen=True, eq=False)
class _NumberedGrasp(GraspRecord):
    """A grasp record that is not in a file yet, with its id for error messages."""

    id: str = ""


@dataclass(eq=False)
class ShardGenerator:
    """Generates the grasps of a shard.

    recipe: what is generated. shard: number of the shard. setup: hand and objects. path: file name in error messages.
    objects: mesh of the current grasp's object, by name.
    """

    recipe: Recipe
    shard: int
    setup: Setup
    path: Path = field(default_factory=lambda: Path("generated"))
    objects: Mapping[str, ObjectMesh] = field(default_factory=dict)

    @cached_property
    def sensor(self) -> SimSensor:
        """Sensor model of the shard, with sampled parameters."""
        return sample_sensor(self.recipe, self.shard)

    @cached_property
    def sensing(self) -> Sensing:
        """Settings of the simulated sensing, without the variation of single grasps."""
        return Sensing(self.recipe.sensing)

    @cached_property
    def sensor_model(self) -> SensorModel:
        """Sensor model stored in the shard; the stiffness of the layer is the value without the sampled factor."""
        layer = "coupled" if self.recipe.sensing == "coupled" else "uncoupled"
        return self.sensor.make_dataset_model(self.setup.hand, self.sensing.stiffness_n_per_m, layer)

    @cached_property
    def taxels(self) -> TaxelTable:
        """Dataset table of the hand's taxels."""
        return self.setup.taxel_table()

    @cached_property
    def sensors(self) -> SensorTable:
        """Dataset table of the hand's boards."""
        return self.setup.sensor_table(FIDELITIES[self.recipe.fidelity].rate_hz)

    @cached_property
    def _states(self) -> FrameStates:
        """Converter of grasps to the input of the effect models; it uses this generator in place of a dataset."""
        return FrameStates(self)

    def generate(self, number: int) -> GeneratedGrasp:
        """Sample and simulate the grasp `number` of the recipe, and add its effects.

        The grasp is sampled again if the simulation diverges. Raises SamplingError if no sample can be simulated.
        """
        sample = sample_grasp(self.recipe, number)
        while (motion := self._simulate(sample)) is None:
            try:
                sample = sample_grasp(self.recipe, number, sample.attempt + 1)
            except SamplingError:
                raise SamplingError(number, sample.kind.name, f"forces above {MAX_FORCE_N:g} N") from None
        record, force = self._make_record(sample, motion)
        vertices, faces = sample.item.shape.mesh()
        mesh = ObjectMesh(vertices, faces.astype(np.int32))
        record, effect_values = self._add_effects(sample, record, mesh)
        values = {"attempt": float(sample.attempt), **sample.values, **effect_values}
        values |= {"force_n": float(force.sum()), "touched": float((force > TOUCHED_N).sum())}
        return GeneratedGrasp(record, mesh, sample.kind.name, values)

    def _simulate(self, sample: SampledGrasp) -> GraspMotion | None:
        """Simulate the motion of the hand in a sampled grasp; None if the solver has diverged."""
        recipe, hand = self.recipe, self.setup.hand
        fidelity, soft = FIDELITIES[recipe.fidelity], recipe.sensing == "layer"
        law = replace(self.sensing.law, stiffness_n_per_m=sample.layer_stiffness * self.sensing.law.stiffness_n_per_m)
        motion = simulate_grasp(
            build_scene(hand, sample.item, WRIST_LINK, sample.friction),
            self._make_approach(sample),
            fidelity.timeline,
            SimulationSettings(
                rate_hz=fidelity.rate_hz,
                object_offset=sample.offset,
                torque_scale=sample.grip,
                seed=sample.stops_seed,
                law=law if soft else None,
                soft_step_s=fidelity.soft_step_s,
                settle_s=fidelity.settle_s,
            ),
        )
        force = motion.wrench if motion.taxel_force is None else motion.taxel_force
        return motion if np.isfinite(force).all() and np.abs(force).max() < MAX_FORCE_N else None

    def _make_approach(self, sample: SampledGrasp) -> Approach:
        """Make the approach of a sampled grasp.

        If hand and approach are those of the original experiment, its recorded grasp is shifted by the sampled values.
        Otherwise the approach is computed from the sampled placement of the palm.
        """
        if not (self.setup.is_original and sample.kind.approaches == "thesis"):
            return make_approach(sample.item, sample.approach, sample.placement, self.setup.hand, withdraw_m=WITHDRAW_M)
        name, iteration = sample.kind.name, sample.number % ITERATIONS[sample.kind.name, sample.approach]
        planned = PlannedGrasp("", name, sample.approach, iteration, self.shard)
        nominal = self.setup.objects[name].shape
        recorded = replace(self.setup.approach(planned), object=sample.item.name)
        return shift_recorded_approach(recorded, sample.item.shape, nominal, sample.values)

    def _make_record(self, sample: SampledGrasp, motion: GraspMotion) -> tuple[GraspRecord, FloatArray]:
        """Make the dataset record of a simulated grasp without effects.

        Forces and separations are rounded to `FORCE_STEP_N` and `LENGTH_STEP_M`, because smaller digits are noise of
        the solver. Also returns the mean force on each taxel in the hold phase, f64[n], newtons.
        """
        hand = self.setup.hand
        stiffness = sample.layer_stiffness * self.sensing.stiffness_n_per_m
        sensed = sense(hand, sample.item.shape, motion, replace(self.sensing, stiffness_n_per_m=stiffness))
        force = FORCE_STEP_N * np.rint(sensed.contact_force / FORCE_STEP_N)
        hold = np.flatnonzero(motion.phase == Phase.HOLD)
        record = GraspRecord(
            object=sample.item.name,
            approach=sample.approach,
            iteration=sample.number,
            session=self.shard,
            timestamp=motion.time_s,
            phase=motion.phase,
            raw_counts=self.sensor.raw_counts(hand, force, make_noise_generator(self.recipe, sample.number)),
            valid=np.ones((len(motion.time_s), len(hand.boards)), bool),
            sensor_pose=motion.sensor_poses[hold[len(hold) // 2]],
            object_pose=make_standing_pose(),
            contact_force=force,
            separation=LENGTH_STEP_M * np.rint(sensed.separation / LENGTH_STEP_M),
        )
        return record, np.asarray(force[hold].mean(axis=0))

    def _add_effects(
        self, sample: SampledGrasp, record: GraspRecord, mesh: ObjectMesh
    ) -> tuple[GraspRecord, dict[str, float]]:
        """Add the sampled effects to the counts of a record; also return the sampled values by label."""
        effects, values = sample_effects(self.recipe, sample.number)
        if not effects:
            return record, values
        self.objects = {sample.kind.name: mesh}  # an effect on an object applies to all objects of its kind
        grasp = _NumberedGrasp(**{**vars(record), "object": sample.kind.name}, id=str(sample.number))
        # Each generated grasp is its own condition, with a single repeat.
        streams = RandomStreams(seed=self.recipe.seed, condition=sample.number, repeat=0, repeats=1)
        raw, valid = add_effects_to_grasp(self._states.build_state(grasp), grasp, effects, streams)
        return replace(record, raw_counts=raw, valid=valid), values
