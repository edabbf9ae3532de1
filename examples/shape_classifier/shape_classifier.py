"""Classify the shape of an object from one hold: train on generated grasps, test on the emulated hand.

There are two training sets of the same grasps: without effects, and with the effects of a diagnosis (`report.json`
beside this file). The test set comes from the emulated hand with the effects that were hidden in the diagnosed
campaign, with another seed: other sessions, other variation, other noise. No parameter is fitted to the test set.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from taxel.campaign.emulated import run_emulated
from taxel.campaign.settings import PRESETS, EmulatedSettings
from taxel.errors import TaxelError
from taxel.generate.holds import Holds, read_dataset_holds, read_generated_holds
from taxel.generate.recipe import Recipe
from taxel.generate.recipe_file import add_report
from taxel.generate.run import generate
from taxel.generate.workers import Processes
from taxel.grasp.plan import make_thesis_plan
from taxel.hand import load_hand
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS
from taxel.types import BoolArray, FloatArray

FOLDER = Path(__file__).parent
REPORT = FOLDER / "report.json"

TRAIN_SEED, TEST_SEED = 11, 2  # the diagnosed campaign has seed 1

SCALE_COUNTS = 500.0
"""Typical signal of a taxel under a finger, counts; inputs are divided by it."""

SCALE_TAXELS = 5.0
"""Typical number of active taxels of a board; inputs are divided by it."""

FOLDS = 5
"""Parts of the cross-validation, fewer if a shape has fewer grasps."""
NORMAL_95 = 1.959964
"""97.5 % quantile of the standard normal distribution, for two-sided 95 % intervals."""


@dataclass(frozen=True)
class Accuracy:
    """Number of correct classifications, with a 95 % interval (Wilson 1927)."""

    correct: int
    total: int

    @property
    def value(self) -> float:
        """Share of correct classifications."""
        return self.correct / self.total

    @property
    def ci95(self) -> tuple[float, float]:
        """The 95 % confidence interval (Wilson score interval) of the share: (lower limit, upper limit), 0 to 1."""
        n, z2 = self.total, NORMAL_95**2
        middle = (self.value + z2 / (2 * n)) / (1 + z2 / n)
        half = NORMAL_95 / (1 + z2 / n) * np.sqrt(self.value * (1 - self.value) / n + z2 / (4 * n * n))
        return max(float(middle - half), 0.0), min(float(middle + half), 1.0)


def scale_signals(signal: FloatArray) -> FloatArray:
    """Divide signals f64[g, n] (g grasps, n taxels) in counts by `SCALE_COUNTS`."""
    return np.asarray(signal / SCALE_COUNTS)


def find_active_taxels(signal: FloatArray) -> FloatArray:
    """Convert signals f64[g, n] (g grasps, n taxels) in counts to 1 for an active taxel and 0 for an inactive one."""
    return np.asarray(signal > ACTIVE_SIGNAL_COUNTS, dtype=np.float64)


def count_active_by_board(signal: FloatArray) -> FloatArray:
    """Count the active taxels of each of the 17 boards in each of g grasps, as an input of a classifier: f64[g, 17].

    The product with the membership matrix bool[n, 17] sums over the taxels of each board. The numbers are divided by
    `SCALE_TAXELS`, which brings typical inputs to about 1. signal: f64[g, n], counts.
    """
    board = load_hand("original").board_index
    return np.asarray(find_active_taxels(signal) @ (board[:, None] == np.unique(board)) / SCALE_TAXELS)


VIEWS = {
    "every taxel's signal": scale_signals,
    "which taxels are active": find_active_taxels,
    "how many on each board": count_active_by_board,
}
"""Inputs of the classifiers, computed from the signals during hold."""


def make_classifier(view: str) -> Any:
    """Create a logistic regression on the input `view`, a key of `VIEWS`."""
    return make_pipeline(FunctionTransformer(VIEWS[view]), LogisticRegression(C=1.0, max_iter=500))


def classify(view: str, train: Holds, test: Holds) -> BoolArray:
    """Train on `train`, and return which of the g grasps of `test` are classified correctly: bool[g]."""
    classifier = make_classifier(view).fit(train.signal_counts, train.label)
    return np.asarray(classifier.predict(test.signal_counts) == test.label)


def compute_accuracy_gain(
    before: BoolArray, after: BoolArray, seed: int = 0, resamples: int = 10_000
) -> tuple[float, ...]:
    """Compute the increase of the accuracy on the same grasps, and its 95 % bootstrap interval over grasps.

    before, after: bool[g], which grasps are classified correctly. Returns (increase, lower limit, upper limit) as
    shares.
    """
    change = after.astype(float) - before.astype(float)
    index = np.random.default_rng(seed).integers(len(change), size=(resamples, len(change)))
    return (float(change.mean()), *np.percentile(change[index].mean(axis=1), [2.5, 97.5]).tolist())


def compare(without_effects: Holds, with_effects: Holds, test: Holds) -> dict[str, Any]:
    """Compare the accuracies on `test` after training on each training set, for each input in `VIEWS`.

    The result also contains the accuracy within the simulator, cross-validated on the training set without effects
    ("own_data"), unless a shape has only one grasp.
    """
    labels = without_effects.label
    result: dict[str, Any] = {"train_grasps": len(labels), "test_grasps": len(test.label), "views": {}}
    folds = min(FOLDS, *np.unique(labels, return_counts=True)[1].tolist())
    for view in VIEWS:
        before, after = classify(view, without_effects, test), classify(view, with_effects, test)
        gain, low, high = compute_accuracy_gain(before, after)
        row: dict[str, Any] = {"gain": gain, "gain_ci95": [low, high]}
        if folds > 1:
            scores = cross_val_score(make_classifier(view), without_effects.signal_counts, labels, cv=folds)
            row["own_data"] = float(scores.mean())
        for name, is_correct in (("without_effects", before), ("with_effects", after)):
            accuracy = Accuracy(int(is_correct.sum()), len(is_correct))
            row[name] = {"right": accuracy.correct, "accuracy": accuracy.value, "ci95": list(accuracy.ci95)}
        result["views"][view] = row
    return result


def run(options: argparse.Namespace) -> dict[str, Any]:
    """Generate the missing parts of the training sets and of the test set, and return the result of `compare`."""
    out: Path = options.out
    recipe = Recipe(grasps=options.grasps, seed=TRAIN_SEED, grasps_per_shard=min(100, options.grasps))
    recipes = {"plain": recipe, "with_effects": add_report(recipe, options.report)}
    for name, training_recipe in recipes.items():
        print(f"{name}: {options.grasps} generated grasps", flush=True)
        generate(training_recipe, out / name, Processes(options.workers))
    test_set: Path | None = options.test_set
    if test_set is None:
        test_set = out / "emulated.h5"
        print(f"emulated hand: {options.tests} grasps", flush=True)
        plan = make_thesis_plan(TEST_SEED)[: options.tests]
        settings = EmulatedSettings(seed=TEST_SEED, effects=PRESETS["thesis"])
        run_emulated(test_set, plan, settings, jobs=options.workers, resume=test_set.exists())
    without_effects, with_effects = (read_generated_holds(out / name) for name in recipes)
    return compare(without_effects, with_effects, read_dataset_holds(test_set))


def print_result(result: dict[str, Any]) -> None:
    """Print the result of `compare` as a table."""
    print(
        f"trained on {result['train_grasps']} generated grasps, tested on {result['test_grasps']} of the emulated hand"
    )
    print(f"{'input of the classifier':26s} {'without effects':>22s} {'with effects':>22s} {'gain, points':>20s}")
    for view, row in result["views"].items():
        cells = [
            _format_percent(row[name]["accuracy"], row[name]["ci95"]) for name in ("without_effects", "with_effects")
        ]
        low, high = row["gain_ci95"]
        gain = f"{100 * row['gain']:+.0f} ({100 * low:+.0f} to {100 * high:+.0f})"
        print(f"{view:26s} {cells[0]:>22s} {cells[1]:>22s} {gain:>20s}")


def _format_percent(value: float, interval: Sequence[float]) -> str:
    """Format a share and its interval in percent."""
    return f"{100 * value:.0f} % ({100 * interval[0]:.0f} to {100 * interval[1]:.0f})"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line. Returns the exit status: 1 after an error, otherwise 0."""
    parser = argparse.ArgumentParser(description="Shape from one hold, trained without and with diagnosed effects.")
    parser.add_argument("--out", type=Path, default=Path("out/shape_classifier"))
    parser.add_argument("--grasps", type=int, default=600, help="grasps of each training set")
    parser.add_argument("--tests", type=int, default=24, help="grasps of the emulated hand, of the 144 of the plan")
    parser.add_argument("--report", type=Path, default=REPORT, help="report.json of taxel gap diagnose")
    parser.add_argument("--workers", type=int, default=2, help="number of processes")
    parser.add_argument("--test-set", type=Path, help="grasp dataset to test on, instead of the emulated hand")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    options = parser.parse_args(arguments)
    try:
        result = run(options)
    except TaxelError as error:
        print(f"shape_classifier: {error}")
        return 1
    if options.json:
        print(json.dumps(result))
    else:
        print_result(result)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
