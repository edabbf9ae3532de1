"""Evidence of the calibration: comparisons of worlds with known causes, their storage and their weights.

A world is a pair of datasets with known causes of their gap. Each world is made, compared and deleted; its evidence is
a line of a file, so that an interrupted run continues. A world with one cause is compared twice, the second time
without its effect in the catalogue. The cause is then unknown.
"""

import gzip
import json
import shutil
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import as_completed
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from taxel.blind.benchmark.worlds import (
    EMULATED_GRASPS,
    FAMILIES,
    KINDS,
    SENSOR_FAMILIES,
    TOO_WEAK,
    BenchmarkWorld,
    sample_benchmark,
)
from taxel.blind.hidden import UNKNOWN
from taxel.errors import TaxelError
from taxel.gap.calibration.calibration import SMALLEST_CAUSE
from taxel.gap.comparison.compare import Comparison, compare_sets
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.effects.catalogue import choose_effects
from taxel.gap.fitting.parallel import open_diagnosis_pool
from taxel.output import AppendedLines, read_complete_lines, write_whole
from taxel.types import FloatArray

MADE = "made.json"
"""File in the folder of a world whose datasets are complete."""

EVIDENCE = "evidence.jsonl"
"""File of the evidence in the folder of a run."""

PACKAGED = Path(__file__).with_name("evidence.jsonl.gz")
"""Evidence to which the packaged calibration was fitted: gzip, one JSON object for each world."""

SENSOR_SHARE = 0.25
"""Share of the worlds of other kinds of sensor in the weights (chosen): the skin of the project is the usual case."""

FITTING_STEPS = 100
"""Number of iterations of the fit of the weights to two kinds of shares (chosen): it converges in far fewer."""

WITHHELD_SKIN, WITHHELD_SENSORS = "effect withheld, own skin", "effect withheld, other sensors"
"""Families, in the scores, of the worlds whose effect is left out of the catalogue."""

WITHHELD_WEIGHT = 0.15
"""Weight of the comparison without the effect; the comparison of the same world with all effects has the rest of 1.
It is the prior probability that a single cause is outside the catalogue, beyond the worlds with such causes (chosen: no
statistics of real causes exist). A larger value names unknown causes more often, and causes of the catalogue less
often; docs/gap-diagnosis.md states both for several values."""

UNKNOWN_CAUSE = {"kind": "outside", "truth": [UNKNOWN]}
"""Kind and truth of a world whose effect is not in the catalogue."""


def describe_evidence(world: BenchmarkWorld, comparison: Comparison) -> dict[str, Any]:
    """Return the evidence of a comparison and the true causes of its world as JSON values."""
    gap = comparison.gap
    return {
        **world.to_json(),
        "gap": [gap.gap.value, gap.floor, gap.excess.value],
        "tried": list(comparison.tried),
        "effects": {name: asdict(one) for name, one in comparison.effects.items()},
        "remainder": asdict(comparison.remainder),
    }


def collect_evidence(world: BenchmarkWorld, bases: Path, datasets: Path | None) -> dict[str, Any]:
    """Make a world, compare its datasets and return the evidence; after an error, return the world and the error text.

    A world is a pair of datasets with known causes of their gap. A world with one cause is compared a second time with
    a catalogue that lacks its effect; this evidence has the key "without". bases: folder of the
    datasets without a cause, filled as needed. datasets: folder that keeps the datasets of all worlds, and from which
    the datasets of a world are reused; None: they are deleted.
    """
    with TemporaryDirectory(prefix="taxel-calibration-") as name:
        folder = Path(name) if datasets is None else datasets / f"{world.number:03d}"
        try:
            if not (folder / MADE).exists():
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir(parents=True)
                made = world.make(folder / "real.h5", folder / "sim.h5", bases)
                write_whole(folder / MADE, json.dumps(world.to_json() | {"sizes": made}))
            sizes = json.loads((folder / MADE).read_text())["sizes"]  # also of datasets of an earlier run
            world = world.without_weak_causes(sizes)
            with threadpool_limits(limits=1):  # as in `compare`; both comparisons use the same prepared data
                data = prepare_pair(read_pair(folder / "real.h5", folder / "sim.h5"))
                evidence = describe_evidence(world, compare_sets(data, choose_effects())) | {"sizes": sizes}
                if world.kind == "single":
                    without = compare_sets(data, choose_effects(world.truth))
                    evidence["without"] = describe_evidence(world, without) | UNKNOWN_CAUSE
            return evidence
        except TaxelError as error:
            return {**world.to_json(), "error": str(error)}


@dataclass(frozen=True)
class Sample:
    """Worlds of a run.

    worlds, sensor_worlds: number of worlds of the own skin, and of other kinds of sensor. several_worlds: number of
    further worlds of the own skin, from which those with several causes are used, except the emulated grasps. seed:
    seed of the worlds; the further worlds have the next seed.
    """

    worlds: int
    sensor_worlds: int
    several_worlds: int
    seed: int

    def list_worlds(self) -> list[BenchmarkWorld]:
        """Return the worlds in random order.

        The numbers of the worlds of other sensors follow those of the skin; the numbers of the further worlds are the
        last.
        """
        sensors = sample_benchmark(self.sensor_worlds, self.seed, tuple(SENSOR_FAMILIES)) if self.sensor_worlds else []
        worlds = sample_benchmark(self.worlds, self.seed)
        worlds += [replace(world, number=self.worlds + world.number) for world in sensors]
        families = tuple(name for name in FAMILIES if name != EMULATED_GRASPS)
        further = sample_benchmark(self.several_worlds, self.seed + 1, families) if self.several_worlds else []
        first = self.worlds + self.sensor_worlds
        worlds += [replace(world, number=first + world.number) for world in further if world.kind == "several"]
        np.random.default_rng(self.seed).shuffle(worlds)
        return worlds

    def to_json(self) -> list[int]:
        """Return the field "run" of the evidence."""
        return [self.worlds, self.sensor_worlds, self.several_worlds, self.seed]


def run(out: Path, sample: Sample, jobs: int | None, datasets: Path | None) -> list[dict[str, Any]]:
    """Collect the evidence of all worlds and return it; worlds that an earlier run has stored are read.

    datasets: folder that keeps the datasets; None: they are deleted.
    """
    out.mkdir(parents=True, exist_ok=True)
    path = out / EVIDENCE
    found = [json.loads(line) for line in read_complete_lines(path)]
    if any(one["run"] != sample.to_json() for one in found):
        sys.exit(f"calibrate_comparison: {path}: another seed or number of worlds; choose another --out")
    known = {one["number"] for one in found}
    todo = [world for world in sample.list_worlds() if world.number not in known]
    task = partial(collect_evidence, bases=(datasets or out) / "bases", datasets=datasets)
    with AppendedLines(path) as file, open_diagnosis_pool(jobs, len(todo)) as pool:
        tasks = [pool.submit(task, world) for world in todo]
        for number, finished in enumerate(as_completed(tasks), 1):
            evidence = finished.result()
            evidence["run"] = sample.to_json()
            file.append(json.dumps(evidence))
            found.append(evidence)
            print(f"\r{number} of {len(todo)} worlds", end="", file=sys.stderr)
    return found


def read_stored(path: Path) -> list[dict[str, Any]]:
    """Return the stored evidence of a folder with `EVIDENCE`, or of a file in the format of `PACKAGED`.

    Ends the program with a one-line message if there is none.
    """
    try:
        if path.is_dir():
            found = [json.loads(line) for line in read_complete_lines(path / EVIDENCE)]
        else:
            with gzip.open(path, "rt") as file:
                found = [json.loads(line) for line in file]
    except (OSError, EOFError, ValueError) as error:
        sys.exit(f"calibrate_comparison: {path}: expected stored evidence, found {error}; collect it with --out")
    if not found:
        sys.exit(f"calibrate_comparison: {path}: expected stored evidence, found none; collect it with --out")
    return found


def store_packaged(found: list[dict[str, Any]]) -> None:
    """Write evidence to `PACKAGED`, sorted by the number of the world so that equal evidence gives equal bytes."""
    lines = "".join(json.dumps(one) + "\n" for one in sorted(found, key=lambda one: int(one["number"])))
    write_whole(PACKAGED, gzip.compress(lines.encode(), mtime=0))


def describe_source(found: list[dict[str, Any]]) -> str:
    """Return the field "source" of the calibration: the command, and the number of worlds of which it has evidence."""
    worlds, sensor_worlds, several_worlds, seed = found[0]["run"]
    command = (
        f"calibrate_comparison.py --worlds {worlds} --sensor-worlds {sensor_worlds} "
        f"--several-worlds {several_worlds} --seed {seed}"
    )
    return f"{command}, evidence of {len(found)} worlds"


def list_comparisons(found: list[dict[str, Any]], withheld_weight: float = WITHHELD_WEIGHT) -> list[dict[str, Any]]:
    """Return the usable comparisons of all worlds with their weights.

    Comparisons with an error, and of worlds whose cause is too weak, are omitted. The two comparisons of a world
    together have the weight of the world; withheld_weight: part of the one without the effect.
    """
    weights = compute_weights([(one["family"], one["kind"]) for one in found])
    compared = []
    for one, weight in zip(found, weights, strict=True):
        family = WITHHELD_SENSORS if one["family"] in SENSOR_FAMILIES else WITHHELD_SKIN
        both = [one, one["without"] | {"family": family}] if "without" in one else [one]
        usable = [part for part in both if "error" not in part and not _is_too_weak(part)]
        shares = [1.0 - withheld_weight, withheld_weight] if len(usable) == 2 else [1.0]
        compared += [part | {"weight": share * weight} for part, share in zip(usable, shares, strict=False)]
    return compared


def compute_weights(worlds: Sequence[tuple[str, str]]) -> FloatArray:
    """Return the weight of each world, so that every family and every kind has its share and the mean weight is 1.

    The families of the own skin have their shares of the benchmark, scaled to 1 - `SENSOR_SHARE` in all; the families
    of other sensors have equal parts of `SENSOR_SHARE`. Within the own skin the kinds have the shares `KINDS`, whatever
    the sample contains; both shares are reached by iterative proportional fitting (Deming and Stephan 1940). worlds:
    family and kind of each world.
    """
    shares = {name: (1.0 - SENSOR_SHARE) * share for name, share in FAMILIES.items()}
    shares |= dict.fromkeys(SENSOR_FAMILIES, SENSOR_SHARE / len(SENSOR_FAMILIES))
    weights = np.ones(len(worlds))
    families = np.array([family for family, _ in worlds])
    # A world of the kind "lookalike" has a single cause that resembles an effect of the catalogue.
    kinds = np.array(["single" if kind == "lookalike" else kind for _, kind in worlds])
    is_skin = np.isin(families, list(FAMILIES))
    for _ in range(FITTING_STEPS):
        _give_shares(weights, np.where(is_skin, kinds, ""), KINDS)
        _give_shares(weights, families, shares)
    return np.asarray(weights * len(worlds) / weights.sum())


def _give_shares(weights: FloatArray, groups: NDArray[np.str_], shares: Mapping[str, float]) -> None:
    """Scale the weights of the worlds in place, so that the groups of worlds have their shares.

    weights: f64[w], of w worlds. groups: name of the group of each world; worlds of a group without a share keep their
    weights. shares: share of each group; the sum over the groups is kept.
    """
    present = {name: share for name, share in shares.items() if (groups == name).any()}
    total = weights[np.isin(groups, list(present))].sum() / sum(present.values(), start=0.0) if present else 0.0
    for name, share in present.items():
        weights[groups == name] *= share * total / weights[groups == name].sum()


def _is_too_weak(one: dict[str, Any]) -> bool:
    """Return whether the causes of a world change the data too little to count as causes.

    The root of the excess, which is the squared gap minus the squared floor, must be at least `SMALLEST_CAUSE` floors.
    """
    _, floor, excess = one["gap"]
    return one["kind"] == TOO_WEAK or (len(one["truth"]) == 1 and max(excess, 0.0) ** 0.5 < SMALLEST_CAUSE * floor)
