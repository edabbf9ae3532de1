"""Calibration of the comparison: evidence from worlds with known causes, and the logistic models that fit it.

python tools/gap/calibrate_comparison.py --worlds 96 --seed 777 --out out/calibration --write

Each world is made, compared and deleted; its evidence is a line of DIR/evidence.jsonl, so that an interrupted run
continues. The worlds are those of the blind check with this seed. Withheld forms: the models are fitted to all worlds
but those of some forms of causes (a fold of `--folds`), and the printed scores refer to the forms that were left out.
--write: store the models fitted to all worlds in host/taxel/gap/comparison/calibration.json.
"""

import argparse
import json
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from taxel.blind.benchmark.scoring import ScoredAnswer, score_answers
from taxel.blind.benchmark.worlds import INDENTATIONS
from taxel.blind.hidden import UNKNOWN
from taxel.blind.sampling import sample_worlds
from taxel.blind.world import World
from taxel.blind.world_datasets import make_world
from taxel.gap.comparison.calibration import Calibration, Logistic, compute_any_inputs
from taxel.gap.comparison.compare import Comparison, compare
from taxel.types import FloatArray

TARGET = Path(__file__).resolve().parents[2] / "host" / "taxel" / "gap" / "comparison" / "calibration.json"


def describe_evidence(world: World, comparison: Comparison) -> dict[str, Any]:
    """Evidence of a comparison and the truth of its world as JSON values."""
    return {
        "number": world.number,
        "kind": world.hidden.kind,
        "truth": list(world.hidden.names),
        "forms": [cause.emulator_effect for cause in world.hidden.causes],
        "gap": [comparison.gap.gap.value, comparison.gap.floor],
        "tried": list(comparison.tried),
        "effects": {name: one.to_inputs().tolist() for name, one in comparison.effects.items()},
        "remainder": comparison.remainder.to_inputs().tolist(),
    }


def collect_evidence(world: World) -> dict[str, Any]:
    """Make a world, compare its datasets and return the evidence."""
    with TemporaryDirectory(prefix="taxel-calibration-") as name:
        real, sim = Path(name) / "real.h5", Path(name) / "sim.h5"
        make_world(world, real, sim)
        return describe_evidence(world, compare(real, sim))


def run(out: Path, count: int, seed: int, jobs: int | None) -> list[dict[str, Any]]:
    """Evidence of all worlds; those that an earlier run stored are read."""
    out.mkdir(parents=True, exist_ok=True)
    path = out / "evidence.jsonl"
    found = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    known = {one["number"] for one in found}
    todo = [world for world in sample_worlds(count, seed=seed) if world.number not in known]
    with path.open("a") as file, ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for number, evidence in enumerate(pool.map(collect_evidence, todo), 1):
            file.write(json.dumps(evidence) + "\n")
            file.flush()
            found.append(evidence)
            print(f"\r{number} of {len(todo)} worlds", end="", file=sys.stderr)
    return found


def fit(evidence: list[dict[str, Any]], source: str) -> Calibration:
    """Fit the models of effects and of the unknown cause to the evidence of worlds."""
    inputs = [(values, name in one["truth"]) for one in evidence for name, values in one["effects"].items()]
    skipped = [name in one["truth"] for one in evidence for name in one["tried"] if name not in one["effects"]]
    effect = Logistic.fit(np.array([values for values, _ in inputs]), [label for _, label in inputs])
    remainders = np.array([one["remainder"] for one in evidence])
    unknown = Logistic.fit(remainders, [UNKNOWN in one["truth"] for one in evidence])
    rate = (sum(skipped) + 0.5) / (len(skipped) + 1.0)  # Jeffreys' estimate
    alone = Calibration(effect, unknown, unknown, rate, source)  # without a model of any cause
    sizes = [compute_any_inputs(*get_inputs(one)[:2]) for one in evidence]
    any_cause = Logistic.fit(np.array(sizes), [bool(one["truth"]) for one in evidence])
    return replace(alone, any_cause=any_cause)


def get_inputs(one: dict[str, Any]) -> tuple[dict[str, FloatArray], FloatArray, list[str]]:
    """Inputs of the calibration from the stored evidence of one world."""
    effects = {name: np.array(values) for name, values in one["effects"].items()}
    return effects, np.array(one["remainder"]), one["tried"]


def predict(one: dict[str, Any], calibration: Calibration) -> dict[str, float]:
    """Probabilities of one world from its stored evidence."""
    return calibration.compute_probabilities(*get_inputs(one))


def score_withheld(evidence: list[dict[str, Any]], folds: int, seed: int) -> dict[str, Any]:
    """Scores on forms of causes that the fit did not use; worlds without a cause are divided at random."""
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
                ratio = one["gap"][0] / max(one["gap"][1], 1e-9)
                truth = frozenset(one["truth"])
                answers.append(ScoredAnswer(truth, one["kind"], INDENTATIONS, predict(one, calibration), ratio, 0.0))
    return score_answers(answers)


def main() -> int:
    """Collect evidence, print the scores on withheld forms and the models, and store the models with --write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--worlds", type=int, default=96)
    parser.add_argument("--seed", type=int, default=777, help="seed of the worlds")
    parser.add_argument("--folds", type=int, default=5)
    parser.add_argument("--jobs", type=int, help="number of processes; default: one for each core")
    parser.add_argument("--out", type=Path, required=True, help="folder of the evidence")
    parser.add_argument("--write", action="store_true", help="store the fitted models")
    options = parser.parse_args()
    evidence = run(options.out, options.worlds, options.seed, options.jobs)
    for name, value in score_withheld(evidence, options.folds, options.seed).items():
        print(f"{name:<48}{value if value is None or isinstance(value, int) else round(value, 3)}")
    calibration = fit(evidence, f"calibrate_comparison.py --worlds {options.worlds} --seed {options.seed}")
    print(json.dumps(calibration.to_json(), indent=1))
    if options.write:
        TARGET.write_text(json.dumps(calibration.to_json(), indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
