"""Worlds of the benchmark: pairs of datasets with hidden causes, in five families."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from taxel.blind.benchmark.bases import GRASP, INDENTATION, TOUCH, BasePair
from taxel.blind.benchmark.faults import FAULTS, damage
from taxel.blind.benchmark.modalities import SENSORS, ModalityWorld, sample_modality_worlds
from taxel.blind.grasp_world import GraspWorldSampler, emulate_grasps, simulate_grasps
from taxel.blind.hidden import UNKNOWN
from taxel.blind.injection.forms import INJECTED_FORMS, RESERVED_FORMS, InjectedForm
from taxel.blind.injection.inject import inject_causes
from taxel.blind.loaded_locations import SimulatedLoads
from taxel.blind.sampling import sample_worlds
from taxel.blind.world import World
from taxel.blind.world_datasets import make_world
from taxel.gap.calibration.calibration import SMALLEST_CAUSE

INDENTATIONS, EMULATED_GRASPS, INJECTED, GRASPS, MEASURED = (
    "indentations",
    "grasps",
    "injected indentations",
    "injected grasps",
    "injected measured touches",
)

FAMILIES: Final = {INDENTATIONS: 0.3, EMULATED_GRASPS: 0.25, INJECTED: 0.2, GRASPS: 0.15, MEASURED: 0.1}
"""Share of each family. Grasps of the whole hand take longest to make."""

SENSOR_FAMILIES: Final = dict.fromkeys(SENSORS, 0.1)
"""Share of worlds of other kinds of sensor, which are used only if they are selected."""

BASE_KINDS: Final = {INJECTED: INDENTATION, GRASPS: GRASP, MEASURED: TOUCH}
"""Kind of the base (pair of datasets without a cause) into which the causes of a family are injected."""

WORLDS_PER_BASE: Final = {INJECTED: 6, GRASPS: 12, MEASURED: 2}
"""Number of worlds that share a base. A base takes far longer to make than an injection."""

FAULTY_SHARE: Final = 0.15
"""Share of the worlds of indentations with a faulty simulator file (chosen: 60 of 420, as in the full score)."""

KINDS: Final = {"none": 0.15, "single": 0.5, "several": 0.2, "outside": 0.15}
"""Share of each kind of injected worlds: no cause, one, two or three causes, and a cause outside the catalogue."""

TOO_WEAK: Final = "too weak"
"""Kind of a world whose injected causes turned out to be too weak to be causes. It enters the measures of all worlds
only, because an answer with or without these causes is acceptable."""

FLOORS: Final = (0.5, 6.0)
"""Smallest and largest gap that an injected cause alone produces, in floors; sampled uniformly in the logarithm."""

FLOORS_OF_SEVERAL: Final = (1.5, 6.0)
"""The same for each of several injected causes of one world."""

NOT_ON_TOUCHES: Final = ("stiffness", "proximity")
"""Causes that need a simulated contact, which measured touches do not have."""


@dataclass(frozen=True)
class BenchmarkWorld:
    """A world of the benchmark.

    number: index in the run. family: key of `FAMILIES` or `SENSOR_FAMILIES`. kind: "none", "single", "several",
    "outside" or "lookalike". truth: names of the hidden causes. forms: functional form of each cause. source: from
    which the datasets are made: world of the blind check, world of another sensor, seed of a grasp world, or base and
    seed of the injection. floors: required gap of each injected cause, in floors. fault: fault of the simulator file
    (`FAULTS`); "": none. fault_seed: seed that selects the grasp and the frame of the fault.
    """

    number: int
    family: str
    kind: str
    truth: tuple[str, ...]
    forms: tuple[str, ...]
    source: World | ModalityWorld | int | tuple[BasePair, int]
    floors: tuple[float, ...] = ()
    fault: str = ""
    fault_seed: int = 0

    def make(self, real: Path, sim: Path, bases: Path) -> tuple[float, ...]:
        """Write the two datasets of the world, and return the gap that each injected cause alone produces, in floors;
        nothing for a world without injected causes.

        The type of `source` determines how: a world of the blind check, a world of another sensor, the seed of a world
        of grasps, or a base with the seed of the injection. bases: folder of the datasets without a cause, filled as
        needed. Raises TaxelError with a one-line message.
        """
        sizes: list[float] = []
        if isinstance(self.source, World):
            make_world(self.source, real, sim)
        elif isinstance(self.source, ModalityWorld):
            self.source.make(real, sim)
        elif isinstance(self.source, int):
            sampler = GraspWorldSampler(self.source)
            simulate_grasps(sampler.campaign_seed, sim, jobs=1)
            emulate_grasps(sampler.sample(SimulatedLoads.read(sim)), real, jobs=1)
        else:
            base, seed = self.source
            first, second = base.provide(bases)
            shutil.copyfile(second, sim)
            forms = [one for name in self.forms for one in (*INJECTED_FORMS, *RESERVED_FORMS) if _label(one) == name]
            if forms:
                sizes = inject_causes(first, second, real, forms, self.floors, seed)
            else:
                shutil.copyfile(first, real)
        if self.fault:
            damage(sim, self.fault, self.fault_seed)
        return tuple(sizes)

    def without_weak_causes(self, sizes: Sequence[float]) -> BenchmarkWorld:
        """Return the world with the truth of its datasets: an injected cause that alone produces a gap below
        `SMALLEST_CAUSE` floors is no cause (definition of the gap report).

        sizes: result of `make`. The kind is "single" if one cause remains, and `TOO_WEAK` if none remains.
        """
        if not sizes or min(sizes) >= SMALLEST_CAUSE:
            return self
        truth = tuple(name for name, size in zip(self.truth, sizes, strict=True) if size >= SMALLEST_CAUSE)
        return replace(self, truth=truth, kind={0: TOO_WEAK, 1: "single"}.get(len(truth), self.kind))

    def to_json(self) -> dict[str, Any]:
        """Return the hidden truth of the world as JSON values."""
        return {
            "number": self.number,
            "family": self.family,
            "kind": self.kind,
            "truth": list(self.truth),
            "forms": list(self.forms),
            "floors": list(self.floors),
            "fault": self.fault,
        }


def sample_benchmark(
    count: int,
    seed: int,
    families: Sequence[str] = tuple(FAMILIES),
    forms: Sequence[InjectedForm] = INJECTED_FORMS,
) -> list[BenchmarkWorld]:
    """Sample `count` worlds of some families in random order, in the proportions of `FAMILIES` and `SENSOR_FAMILIES`.

    forms: functional forms of the injected causes, `INJECTED_FORMS` or `RESERVED_FORMS`. Equal arguments give equal
    worlds. The worlds are not sealed as those of the blind check: the truth is compared after all answers are stored.
    """
    rng = np.random.default_rng([seed, count])
    shares = {name: share for name, share in {**FAMILIES, **SENSOR_FAMILIES}.items() if name in families}
    total = sum(shares.values())
    counts = {name: round(count * shares[name] / total) for name in families}
    counts[families[0]] += count - sum(counts.values())
    worlds: list[BenchmarkWorld] = []
    for name, number in counts.items():
        if name == INDENTATIONS:
            worlds += _sample_indentations(rng, number, seed)
        elif name == EMULATED_GRASPS:
            worlds += [_sample_grasps(index, int(rng.integers(2**62))) for index in range(number)]
        elif name in SENSOR_FAMILIES:
            worlds += _sample_sensors(name, number, seed)
        else:
            worlds += _sample_injected(rng, name, number, seed, forms)
    order = rng.permutation(len(worlds)).tolist()
    return [replace(worlds[index], number=number) for number, index in enumerate(order)]


def _sample_indentations(rng: np.random.Generator, count: int, seed: int) -> list[BenchmarkWorld]:
    """Sample worlds of the blind check, some of them with a faulty simulator file."""
    result = []
    for world in sample_worlds(count, seed=seed):
        hidden = world.hidden
        forms = tuple(cause.emulator_effect for cause in hidden.causes)
        source = replace(world, salt="")
        result.append(BenchmarkWorld(world.number, INDENTATIONS, hidden.kind, hidden.names, forms, source))
    names = list(FAULTS)
    for place, index in enumerate(rng.permutation(count)[: round(FAULTY_SHARE * count)].tolist()):
        fault, fault_seed = names[place % len(names)], int(rng.integers(2**31))
        result[index] = replace(result[index], fault=fault, fault_seed=fault_seed)
    return result


def _sample_grasps(number: int, seed: int) -> BenchmarkWorld:
    """Sample a world of grasps of the emulated hand, as in the demonstration."""
    sampler = GraspWorldSampler(seed)
    names = tuple(one.name for one in sampler.types)
    forms = tuple(one.emulator_effect for one in sampler.types)
    return BenchmarkWorld(number, EMULATED_GRASPS, sampler.kind, names, forms, seed)


def _sample_injected(
    rng: np.random.Generator, family: str, count: int, seed: int, available: Sequence[InjectedForm]
) -> list[BenchmarkWorld]:
    """Sample worlds of a family with injected causes. available: functional forms of the causes.

    Each world gets a base (pair of datasets without a cause, shared by several worlds), the forms (functional variants)
    of its causes, and the gap that each cause must produce, in floors.
    """
    kind_of_base = BASE_KINDS[family]
    forms = [one for one in available if kind_of_base != TOUCH or one.name not in NOT_ON_TOUCHES]
    worlds = []
    for number in range(count):
        base = BasePair(kind_of_base, 1000 * seed + number // WORLDS_PER_BASE[family])
        kind = str(rng.choice(list(KINDS), p=list(KINDS.values())))
        chosen = _sample_forms(rng, forms, kind)
        low, high = np.log(FLOORS_OF_SEVERAL if kind == "several" else FLOORS)
        floors = tuple(np.exp(rng.uniform(low, high, len(chosen))).tolist())
        names, labels = tuple(one.name for one in chosen), tuple(map(_label, chosen))
        source = (base, int(rng.integers(2**31)))
        worlds.append(BenchmarkWorld(number, family, kind, names, labels, source, floors))
    return worlds


def _sample_sensors(sensor: str, count: int, seed: int) -> list[BenchmarkWorld]:
    """Sample worlds of another kind of sensor."""
    worlds = []
    for number, world in enumerate(sample_modality_worlds(count, seed, sensor)):
        kind = "outside" if world.cause == UNKNOWN else "single" if world.cause else "none"
        truth = (world.cause,) if world.cause else ()
        forms = (f"{sensor}: {world.cause}",) if world.cause else ()
        worlds.append(BenchmarkWorld(number, sensor, kind, truth, forms, world))
    return worlds


def _sample_forms(rng: np.random.Generator, forms: Sequence[InjectedForm], kind: str) -> list[InjectedForm]:
    """Sample the causes of a world of one kind as forms.

    Every effect of the catalogue has the same probability, and so has every form of an effect.
    """
    effects = sorted({one.name for one in forms} - {UNKNOWN})
    names = {
        "none": [],
        "single": rng.permutation(effects)[:1].tolist(),
        "several": rng.permutation(effects)[: int(rng.integers(2, 4))].tolist(),
        "outside": [UNKNOWN],
    }[kind]
    forms_by_cause = [[one for one in forms if one.name == name] for name in names]
    return [variants[int(rng.integers(len(variants)))] for variants in forms_by_cause]


def _label(form: InjectedForm) -> str:
    return f"{form.name}: {form.form}"
