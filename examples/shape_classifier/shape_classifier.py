"""Tell an object's shape from one hold: train on generated grasps, test on the emulated hand.

Two training sets of the same grasps: the simulator's own, and with the effects that a diagnosis found (`report.json`
beside this file). The test set is the emulated hand with the effects that were hidden in the diagnosed campaign, under
another seed: other sessions, other scatter, other noise. Nothing is fitted to it.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from taxel.campaign.emulated import run_emulated
from taxel.campaign.settings import PRESETS, EmulatedSettings
from taxel.errors import TaxelError
from taxel.generate.reading import Holds, dataset_holds, generated_holds
from taxel.generate.recipe import Recipe
from taxel.generate.recipe_file import with_report
from taxel.generate.run import generate
from taxel.generate.workers import Processes
from taxel.grasp.plan import thesis_plan

HERE = Path(__file__).parent
REPORT = HERE / "report.json"

TRAIN_SEED, TEST_SEED = 11, 2  # the diagnosed campaign has seed 1

SCALE_COUNTS = 500.0
"""Of a drop: what a finger's press makes."""

FOLDS = 5
NORMAL_95 = 1.959964


@dataclass(frozen=True)
class Accuracy:
    """right of total, with a 95 % interval (Wilson 1927)."""

    right: int
    total: int

    @property
    def value(self) -> float:
        """Share that was told right."""
        return self.right / self.total

    @property
    def ci95(self) -> tuple[float, float]:
        """The interval."""
        n, z2 = self.total, NORMAL_95**2
        middle = (self.value + z2 / (2 * n)) / (1 + z2 / n)
        half = NORMAL_95 / (1 + z2 / n) * np.sqrt(self.value * (1 - self.value) / n + z2 / (4 * n * n))
        return max(float(middle - half), 0.0), min(float(middle + half), 1.0)


def scaled(drop: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the classifier sees of drops f64[g, n]: every taxel's, in about unit size."""
    return np.asarray(drop / SCALE_COUNTS)


def classifier() -> Any:
    """Logistic regression on the hold's drops; no pose, no joint angle."""
    return make_pipeline(FunctionTransformer(scaled), LogisticRegression(C=1.0, max_iter=500))


def right(train: Holds, test: Holds) -> NDArray[np.bool_]:
    """Which grasps of `test` a classifier tells right that was trained on `train`, bool[g]."""
    return np.asarray(classifier().fit(train.drop, train.label).predict(test.drop) == test.label)


def accuracy(found: NDArray[np.bool_]) -> Accuracy:
    """Of what was told right."""
    return Accuracy(int(found.sum()), len(found))


def gain(before: NDArray[np.bool_], after: NDArray[np.bool_], seed: int = 0, draws: int = 10_000) -> tuple[float, ...]:
    """How much the accuracy rises on the same grasps, with a 95 % interval over draws of grasps."""
    change = after.astype(float) - before.astype(float)
    picks = np.random.default_rng(seed).integers(len(change), size=(draws, len(change)))
    return (float(change.mean()), *np.percentile(change[picks].mean(axis=1), [2.5, 97.5]).tolist())


def compared(plain: Holds, added: Holds, test: Holds) -> dict[str, Any]:
    """Accuracies before and after the effects were added, on the simulator itself and on the test set."""
    folds = min(FOLDS, int(np.unique(plain.label, return_counts=True)[1].min()))
    before, after = right(plain, test), right(added, test)
    told: dict[str, Any] = {"train_grasps": len(plain.label), "test_grasps": len(test.label)}
    for name, holds, found in (("without_effects", plain, before), ("with_effects", added, after)):
        own = float(cross_val_score(classifier(), holds.drop, holds.label, cv=folds).mean()) if folds > 1 else np.nan
        one = accuracy(found)
        told[name] = {"own_data": own, "right": one.right, "accuracy": one.value, "ci95": list(one.ci95)}
    told["gain"], *told["gain_ci95"] = gain(before, after)
    return told


def made(out: Path, grasps: int, tests: int, report: Path, workers: int, test_set: Path | None) -> dict[str, Any]:
    """Make what is missing of the three sets in `out`, and compare."""
    recipe = Recipe(grasps=grasps, seed=TRAIN_SEED, shard=min(100, grasps))
    sets = {"plain": recipe, "with_effects": with_report(recipe, report)}
    for name, one in sets.items():
        print(f"{name}: {grasps} generated grasps", flush=True)
        generate(one, out / name, Processes(workers))
    if test_set is None:
        test_set = out / "emulated.h5"
        print(f"emulated hand: {tests} grasps", flush=True)
        plan = thesis_plan(TEST_SEED)[:tests]
        settings = EmulatedSettings(seed=TEST_SEED, effects=PRESETS["thesis"])
        run_emulated(test_set, plan, settings, jobs=workers, resume=test_set.exists())
    return compared(generated_holds(out / "plain"), generated_holds(out / "with_effects"), dataset_holds(test_set))


def printed(told: dict[str, Any]) -> None:
    """The result as lines."""
    print(f"trained on {told['train_grasps']} generated grasps, tested on {told['test_grasps']} of the emulated hand")
    for name in ("without_effects", "with_effects"):
        one = told[name]
        low, high = one["ci95"]
        rest = f"on the simulator's own, cross-validated: {100 * one['own_data']:.0f} %"
        words = name.replace("_", " ")
        print(f"{words:16s} {100 * one['accuracy']:.0f} % ({100 * low:.0f} to {100 * high:.0f} %); {rest}")
    low, high = told["gain_ci95"]
    print(f"gain: {100 * told['gain']:+.0f} points ({100 * low:+.0f} to {100 * high:+.0f})")


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description="Shape from one hold, trained with and without diagnosed effects.")
    parser.add_argument("--out", type=Path, default=Path("out/shape_classifier"))
    parser.add_argument("--grasps", type=int, default=1200, help="of each training set")
    parser.add_argument("--tests", type=int, default=60, help="grasps of the emulated hand, of the 144 of the plan")
    parser.add_argument("--report", type=Path, default=REPORT)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--test-set", type=Path, help="a grasp dataset to test on, instead of making one")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args(arguments)
    try:
        told = made(asked.out, asked.grasps, asked.tests, asked.report, asked.workers, asked.test_set)
    except TaxelError as error:
        print(f"shape_classifier: {error}")
        return 1
    if asked.json:
        print(json.dumps(told))
    else:
        printed(told)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
