"""The example that trains on generated grasps: few grasps, and a generated test set instead of the emulated hand."""

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("sklearn")

PROGRAM = Path(__file__).parents[3] / "examples" / "shape_classifier" / "shape_classifier.py"


@pytest.fixture(scope="module")
def example():
    """Import the program of the example as a module."""
    spec = importlib.util.spec_from_file_location("shape_classifier", PROGRAM)
    assert spec
    assert spec.loader
    module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_example_reports_the_accuracies_without_and_with_effects(example, generated, capsys, tmp_path):
    test_set = generated.folder / "shard-00000.h5"
    arguments = ["--grasps", "6", "--workers", "1", "--test-set", test_set, "--out", tmp_path / "out", "--json"]
    assert example.main([str(word) for word in arguments]) == 0
    report = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (report["train_grasps"], report["test_grasps"]) == (6, 2)
    for row in report["views"].values():
        for name in ("without_effects", "with_effects"):
            low, high = row[name]["ci95"]
            assert 0.0 <= low <= row[name]["accuracy"] <= high <= 1.0


@pytest.mark.slow
def test_training_set_without_the_effect_of_the_test_set_has_a_lower_accuracy(example):
    """The effect of the artificial test set reverses the order of the taxels."""
    rng = np.random.default_rng(4)
    labels = np.repeat(["a", "b"], 40)
    signal = rng.normal(0.0, 100.0, (80, 1037))
    signal[:40, :200] += 400.0
    without_effect, with_effect = example.Holds(signal, labels), example.Holds(signal[:, ::-1], labels)
    report = example.compare(without_effect, with_effect, with_effect)
    row = report["views"]["every taxel's signal"]
    assert row["with_effects"]["accuracy"] == 1.0
    assert row["without_effects"]["accuracy"] < 0.7
    assert row["gain_ci95"][0] > 0.0


def test_interval_of_an_accuracy_is_the_wilson_interval(example):
    """The expected bounds for 9 of 10 correct answers are those of any statistics program."""
    low, high = example.Accuracy(9, 10).ci95
    assert (low, high) == pytest.approx((0.5958, 0.9821), abs=1e-4)
