"""Calibration of the comparison: evidence from worlds with known causes, and the logistic models that fit it.

python tools/gap/calibrate_comparison.py --out out/calibration --write

Each world is made, compared and deleted; its evidence is a line of DIR/evidence.jsonl, so that an interrupted run
continues. --datasets: keep the datasets, so that a calibration after a change of the comparison need not make them
again. --stored: fit to stored evidence, without further worlds: that of --out, or else that of the packaged calibration
(`PACKAGED`). The worlds are those of `taxel gap benchmark` with this seed, in random order, so that the stored part of
a run has all families. The weights of the worlds give each family its share in the benchmark (`compute_weights`).

Withheld effects: a world with one cause is compared twice, the second time without its effect in the catalogue. The
cause is then unknown, and the models use the evidence of effects that resemble it. The two comparisons together count
as one world (`WITHHELD_WEIGHT`). Withheld forms: the models are fitted to all worlds but those of some forms of causes
(a fold of `--folds`), and the printed scores refer to the forms that were left out. --packaged: print the scores of the
packaged calibration instead of a fit. --write: store the models fitted to all worlds in
host/taxel/gap/calibration/calibration.json, and the evidence in `PACKAGED`.
"""

import argparse
import gzip
import json
import shutil
import sys
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from taxel.blind.benchmark.scoring import ScoredAnswer, score_answers
from taxel.blind.benchmark.worlds import FAMILIES, SENSOR_FAMILIES, BenchmarkWorld, sample_benchmark
from taxel.blind.hidden import UNKNOWN
from taxel.errors import TaxelError
from taxel.gap.calibration.calibration import (
    SMALLEST_CAUSE,
    Calibration,
    Logistic,
    combine_inputs,
    compute_any_inputs,
    load_calibration,
)
from taxel.gap.comparison.compare import Comparison, compare
from taxel.gap.comparison.evidence import EffectEvidence, RemainderEvidence
from taxel.output import AppendedLines, read_complete_lines, write_whole
from taxel.types import FloatArray

MADE = "world.json"
"""File in the folder of a world whose datasets are complete."""

TARGET = Path(__file__).resolve().parents[2] / "host" / "taxel" / "gap" / "calibration" / "calibration.json"

PACKAGED = Path(__file__).with_name("evidence.jsonl.gz")
"""Evidence to which the packaged calibration was fitted: gzip, one JSON object for each world."""

SENSOR_SHARE = 0.25
"""Share of the worlds of other kinds of sensor in the weights (chosen): the skin of the project is the usual case."""

EVIDENCE = "evidence.jsonl"
"""File of the evidence in the folder of a run."""

WITHHELD_FAMILY = "effect withheld"
"""Family, in the scores, of the worlds whose effect is left out of the catalogue."""

WITHHELD_WEIGHT = 0.1
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
                world.make(folder / "real.h5", folder / "sim.h5", bases)
                write_whole(folder / MADE, json.dumps(world.to_json()))
            evidence = describe_evidence(world, compare(folder / "real.h5", folder / "sim.h5"))
            if world.kind == "single":
                without = compare(folder / "real.h5", folder / "sim.h5", world.truth)
                evidence["without"] = describe_evidence(world, without) | UNKNOWN_CAUSE
            return evidence
        except TaxelError as error:
            return {**world.to_json(), "error": str(error)}


@dataclass(frozen=True)
class Sample:
    """Worlds of a run: number of worlds of the own skin, of worlds of other kinds of sensor, and seed."""

    worlds: int
    sensor_worlds: int
    seed: int

    def list_worlds(self) -> list[BenchmarkWorld]:
        """Return the worlds in random order; the numbers of the worlds of other sensors follow those of the skin."""
        sensors = sample_benchmark(self.sensor_worlds, self.seed, tuple(SENSOR_FAMILIES)) if self.sensor_worlds else []
        worlds = sample_benchmark(self.worlds, self.seed)
        worlds += [replace(world, number=self.worlds + world.number) for world in sensors]
        np.random.default_rng(self.seed).shuffle(worlds)
        return worlds

    def to_json(self) -> list[int]:
        """Return the field "run" of the evidence."""
        return [self.worlds, self.sensor_worlds, self.seed]


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
    with AppendedLines(path) as file, ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for number, evidence in enumerate(pool.map(task, todo), 1):
            evidence["run"] = sample.to_json()
            file.append(json.dumps(evidence))
            found.append(evidence)
            print(f"\r{number} of {len(todo)} worlds", end="", file=sys.stderr)
    return found


def read_stored(path: Path) -> list[dict[str, Any]]:
    """Return the stored evidence of a folder with `EVIDENCE`, or of a file in the format of `PACKAGED`."""
    if path.is_dir():
        return [json.loads(line) for line in read_complete_lines(path / EVIDENCE)]
    with gzip.open(path, "rt") as file:
        return [json.loads(line) for line in file]


def list_comparisons(found: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the usable comparisons of all worlds with their weights.

    Comparisons with an error, and of worlds whose cause is too weak, are omitted. The two comparisons of a world
    together have the weight of the world (`WITHHELD_WEIGHT`).
    """
    family_weights = compute_weights([one["family"] for one in found])
    compared = []
    for one in found:
        both = [one, one["without"] | {"family": WITHHELD_FAMILY}] if "without" in one else [one]
        usable = [part for part in both if "error" not in part and not _is_too_weak(part)]
        shares = [1.0 - WITHHELD_WEIGHT, WITHHELD_WEIGHT] if len(usable) == 2 else [1.0]
        weight = family_weights[one["family"]]
        compared += [part | {"weight": share * weight} for part, share in zip(usable, shares, strict=False)]
    return compared


def compute_weights(families: Sequence[str]) -> dict[str, float]:
    """Return the weight of a world of each family, so that every family has its share and the mean weight is 1.

    The families of the own skin have their shares of the benchmark, scaled to 1 - `SENSOR_SHARE` in all; the families
    of other sensors have equal parts of `SENSOR_SHARE`. families: family of each world.
    """
    counts = Counter(families)
    shares = {name: (1.0 - SENSOR_SHARE) * share for name, share in FAMILIES.items()}
    shares |= dict.fromkeys(SENSOR_FAMILIES, SENSOR_SHARE / len(SENSOR_FAMILIES))
    total = sum(shares[name] for name in counts)
    return {name: shares[name] / total * len(families) / count for name, count in counts.items()}


def _is_too_weak(one: dict[str, Any]) -> bool:
    """Return whether the single cause of a world changes the data too little to count as a cause.

    The root of the excess, which is the squared gap minus the squared floor, must be at least `SMALLEST_CAUSE` floors.
    """
    _, floor, excess = one["gap"]
    return len(one["truth"]) == 1 and max(excess, 0.0) ** 0.5 < SMALLEST_CAUSE * floor


def fit(evidence: list[dict[str, Any]], source: str) -> Calibration:
    """Fit the logistic models of the calibration to the evidence of worlds with known causes.

    The models give the probabilities that an effect is a cause, that the cause is unknown, and that there is any cause.
    A tried effect that no candidate set contains has no inputs for a model: its probability is the share of true causes
    among such effects. Every world has the weight 1 in total. source: text that names the origin of the evidence.
    """
    weights = [one["weight"] for one in evidence]
    inputs: list[FloatArray] = []
    labels: list[bool] = []
    effect_weights: list[float] = []
    for one in evidence:
        effects, remainder, _ = get_inputs(one)
        inputs += [combine_inputs(values, remainder) for values in effects.values()]
        labels += [name in one["truth"] for name in effects]
        effect_weights += [one["weight"]] * len(effects)
    skipped = [name in one["truth"] for one in evidence for name in one["tried"] if name not in one["effects"]]
    effect = Logistic.fit(np.array(inputs), labels, effect_weights)
    remainders = np.array([get_inputs(one)[1] for one in evidence])
    unknown = Logistic.fit(remainders, [UNKNOWN in one["truth"] for one in evidence], weights)
    rate = (sum(skipped) + 0.5) / (len(skipped) + 1.0)  # Jeffreys' estimate
    alone = Calibration(effect, unknown, unknown, rate, source)  # without a model of any cause
    sizes = [compute_any_inputs(*get_inputs(one)[:2]) for one in evidence]
    any_cause = Logistic.fit(np.array(sizes), [bool(one["truth"]) for one in evidence], weights)
    return replace(alone, any_cause=any_cause)


def get_inputs(one: dict[str, Any]) -> tuple[dict[str, FloatArray], FloatArray, list[str]]:
    """Return the models' inputs from the stored evidence of one world.

    Returns inputs by effect, inputs of the remainder that no effect explains, and names of the effects that were tried.
    """
    effects = {name: EffectEvidence(**values).to_inputs() for name, values in one["effects"].items()}
    return effects, RemainderEvidence(**one["remainder"]).to_inputs(), one["tried"]


def predict(one: dict[str, Any], calibration: Calibration) -> dict[str, float]:
    """Return the probability of each cause of one world, from its stored evidence."""
    return calibration.compute_probabilities(*get_inputs(one))


def score_withheld(evidence: list[dict[str, Any]], folds: int, seed: int) -> dict[str, Any]:
    """Return the scores of a cross-validation over the forms of causes, by family of worlds and for all.

    A form is a functional variant of a cause (`BenchmarkWorld.forms`). The forms are divided randomly into `folds`
    folds. For each fold, the logistic models are fitted to the worlds that contain none of its forms (the withheld
    forms). The models then predict the probability of each cause in the worlds whose first cause has a withheld form,
    and the scores compare these probabilities with the true causes. Worlds without a cause are divided randomly among
    the folds. evidence: evidence of all worlds, from `run`.
    """
    rng = np.random.default_rng(seed)
    variants = sorted({variant for one in evidence for variant in one["forms"]})
    fold_of = dict(zip(variants, rng.permutation(len(variants)) % folds, strict=True))
    folds_of_worlds = [int(fold_of[one["forms"][0]]) if one["forms"] else int(rng.integers(folds)) for one in evidence]
    answers = []
    for number in range(folds):
        withheld = {variant for variant, fold in fold_of.items() if fold == number}
        rest = [
            one
            for one, fold in zip(evidence, folds_of_worlds, strict=True)
            if fold != number and not withheld & set(one["forms"])
        ]
        calibration = fit(rest, "")
        for one, fold in zip(evidence, folds_of_worlds, strict=True):
            if fold == number:
                answers.append(_answer(one, calibration))
    return _score_by_family(answers)


def score_packaged(evidence: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the scores of the packaged calibration, by family of worlds and for all."""
    calibration = load_calibration()
    return _score_by_family([_answer(one, calibration) for one in evidence])


def _answer(one: dict[str, Any], calibration: Calibration) -> ScoredAnswer:
    """Return the answer of a calibration to the evidence of one world, with the truth; the floor may be 0."""
    ratio = one["gap"][0] / max(one["gap"][1], 1e-9)
    return ScoredAnswer(
        frozenset(one["truth"]), one["kind"], one["family"], predict(one, calibration), ratio, seconds=0.0
    )


def _score_by_family(answers: list[ScoredAnswer]) -> dict[str, Any]:
    """Return the scores of all answers, and of the answers of each family of worlds."""
    families = sorted({one.family for one in answers})
    return {
        "all": score_answers(answers),
        **{name: score_answers([one for one in answers if one.family == name]) for name in families},
    }


def _format(value: float | int | None) -> str:
    """Return a score as the text of a table entry; "-" for None."""
    return "-" if value is None else f"{value:.3f}" if isinstance(value, float) else str(value)


def main() -> int:
    """Collect evidence, print the scores on withheld forms and the models, and store the models with --write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--worlds", type=int, default=240, help="number of worlds of the own skin")
    parser.add_argument("--sensor-worlds", type=int, default=120, help="number of worlds of other kinds of sensor")
    parser.add_argument("--seed", type=int, default=4601, help="seed of the worlds")
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--jobs", type=int, help="number of processes; default: one for each core")
    parser.add_argument("--out", type=Path, help="folder of the evidence")
    parser.add_argument("--datasets", type=Path, help="folder that keeps the datasets of the worlds")
    parser.add_argument("--stored", action="store_true", help="use stored evidence only, of --out or as packaged")
    parser.add_argument("--packaged", action="store_true", help="print the scores of the packaged calibration; no fit")
    parser.add_argument("--write", action="store_true", help="store the fitted models")
    options = parser.parse_args()
    if options.out is None and not options.stored:
        parser.error("--out: expected a folder for the evidence; or use --stored")
    sample = Sample(options.worlds, options.sensor_worlds, options.seed)
    found = (
        read_stored(options.out or PACKAGED)
        if options.stored
        else run(options.out, sample, options.jobs, options.datasets)
    )
    evidence = list_comparisons(found)
    score = score_packaged(evidence) if options.packaged else score_withheld(evidence, options.folds, options.seed)
    print(f"{'':<48}" + "".join(f"{name:>26}" for name in score))
    for measure in score["all"]:
        print(f"{measure:<48}" + "".join(f"{_format(one[measure]):>26}" for one in score.values()))
    if options.packaged:
        return 0
    calibration = fit(evidence, describe_source(found))
    print(json.dumps(calibration.to_json(), indent=1))
    if options.write:
        write_whole(TARGET, json.dumps(calibration.to_json(), indent=1) + "\n")
        lines = "".join(json.dumps(one) + "\n" for one in found)
        write_whole(PACKAGED, gzip.compress(lines.encode(), mtime=0))
    return 0


def describe_source(found: list[dict[str, Any]]) -> str:
    """Return the field "source" of the calibration: the command, and the number of worlds of which it has evidence."""
    worlds, sensor_worlds, seed = found[0]["run"]
    command = f"calibrate_comparison.py --worlds {worlds} --sensor-worlds {sensor_worlds} --seed {seed}"
    return f"{command}, evidence of {len(found)} worlds"


if __name__ == "__main__":
    sys.exit(main())
