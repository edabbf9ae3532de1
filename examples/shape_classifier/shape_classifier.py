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
from taxel.hand import load_hand
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS

HERE = Path(__file__).parent
REPORT = HERE / "report.json"

TRAIN_SEED, TEST_SEED = 11, 2  # the diagnosed campaign has seed 1

SCALE_COUNTS = 500.0
"""Of a signal: what a finger's press makes."""

SCALE_TAXELS = 5.0
"""Of the number of active taxels of a board."""

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


def taxel_signals(signal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of signals f64[g, n]: every taxel's, in about unit size."""
    return np.asarray(signal / SCALE_COUNTS)


def active_taxels(signal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Whether each taxel is active, as the thesis uses them, f64[g, n] of 0 and 1."""
    return np.asarray(signal > ACTIVE_SIGNAL_COUNTS, dtype=np.float64)


def active_on_boards(signal: NDArray[np.float64]) -> NDArray[np.float64]:
    """How many taxels of each board are active, f64[g, 17] in about unit size: how large contact is, not where."""
    board = load_hand("allegro").board_index
    return np.asarray(active_taxels(signal) @ (board[:, None] == np.unique(board)) / SCALE_TAXELS)


VIEWS = {
    "every taxel's signal": taxel_signals,
    "which taxels are active": active_taxels,
    "how many on each board": active_on_boards,
}
"""What a classifier sees of a hold; no pose, no joint angle."""


def classifier(view: str) -> Any:
    """Logistic regression."""
    return make_pipeline(FunctionTransformer(VIEWS[view]), LogisticRegression(C=1.0, max_iter=500))


def right(view: str, train: Holds, test: Holds) -> NDArray[np.bool_]:
    """Which grasps of `test` a classifier tells right that was trained on `train`, bool[g]."""
    return np.asarray(classifier(view).fit(train.signal_counts, train.label).predict(test.signal_counts) == test.label)


def accuracy(found: NDArray[np.bool_]) -> Accuracy:
    """Of what was told right."""
    return Accuracy(int(found.sum()), len(found))


def gain(before: NDArray[np.bool_], after: NDArray[np.bool_], seed: int = 0, draws: int = 10_000) -> tuple[float, ...]:
    """How much the accuracy rises on the same grasps, with a 95 % interval over draws of grasps."""
    change = after.astype(float) - before.astype(float)
    picks = np.random.default_rng(seed).integers(len(change), size=(draws, len(change)))
    return (float(change.mean()), *np.percentile(change[picks].mean(axis=1), [2.5, 97.5]).tolist())


def compared(plain: Holds, added: Holds, test: Holds) -> dict[str, Any]:
    """Accuracies before and after the effects were added, for each view; and on the simulator itself."""
    told: dict[str, Any] = {"train_grasps": len(plain.label), "test_grasps": len(test.label), "views": {}}
    folds = min(FOLDS, *np.unique(plain.label, return_counts=True)[1].tolist())
    for view in VIEWS:
        before, after = right(view, plain, test), right(view, added, test)
        rise, low, high = gain(before, after)
        row: dict[str, Any] = {"gain": rise, "gain_ci95": [low, high]}
        if folds > 1:
            own_scores = cross_val_score(classifier(view), plain.signal_counts, plain.label, cv=folds)
            row["own_data"] = float(own_scores.mean())
        for name, one in (("without_effects", before), ("with_effects", after)):
            share = accuracy(one)
            row[name] = {"right": share.right, "accuracy": share.value, "ci95": list(share.ci95)}
        told["views"][view] = row
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
    print(f"{'what the classifier sees':26s} {'without effects':>22s} {'with effects':>22s} {'gain, points':>20s}")
    for view, row in told["views"].items():
        cells = [_percent(row[name]["accuracy"], row[name]["ci95"]) for name in ("without_effects", "with_effects")]
        low, high = row["gain_ci95"]
        rise = f"{100 * row['gain']:+.0f} ({100 * low:+.0f} to {100 * high:+.0f})"
        print(f"{view:26s} {cells[0]:>22s} {cells[1]:>22s} {rise:>20s}")


def _percent(value: float, interval: Sequence[float]) -> str:
    return f"{100 * value:.0f} % ({100 * interval[0]:.0f} to {100 * interval[1]:.0f})"


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line."""
    parser = argparse.ArgumentParser(description="Shape from one hold, trained with and without diagnosed effects.")
    parser.add_argument("--out", type=Path, default=Path("out/shape_classifier"))
    parser.add_argument("--grasps", type=int, default=600, help="of each training set")
    parser.add_argument("--tests", type=int, default=24, help="grasps of the emulated hand, of the 144 of the plan")
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
