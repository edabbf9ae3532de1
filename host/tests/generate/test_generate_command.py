"""`taxel generate`: the example of its help, what it prints, and what it refuses."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest

from host.tests.command_line import exit_status, refusal
from taxel.cli.generate import generate

REPORT = Path(__file__).parents[3] / "examples" / "shape_classifier" / "report.json"


def example() -> list[str]:
    """The words after `taxel` of the example in the command's help."""
    found = re.search(r"Example: taxel (.*)", generate.__doc__ or "")
    assert found
    return found[1].split()


def test_the_example_of_the_help_runs(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("out/gap").mkdir(parents=True)
    shutil.copy(REPORT, "out/gap/report.json")
    words = ["2" if word == "100000" else word for word in example()]
    assert exit_status(*words, "--jobs", "1") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "out/synthetic: 2 grasps in 1 shards, effects: contact propagation, noise"
    assert lines[1].startswith("generated in this run: 2 in ")
    assert exit_status(*words, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["grasps"], told["made"], told["effects"]) == (2, 0, ["contact_propagation", "noise"])


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--grasps", "-1"], "taxel: generate: Invalid value for '--grasps': -1"),
        (["--seed", "-2"], "taxel: generate: Invalid value for '--seed': -2"),
        (["--grasps-per-shard", "20000"], "taxel: generate: Invalid value for '--grasps-per-shard': 20000"),
        (["--fidelity", "best"], "taxel: --fidelity: expected quick, full, found 'best'"),
        (["--jobs", "-1"], "taxel: generate: Invalid value for '--jobs': -1"),
        (["--jobs", "2", "--scheduler", "tcp://127.0.0.1:9"], "taxel: --jobs and --scheduler: expected one of them"),
        (["--unit", "inch", "--mesh", "a.stl"], "taxel: --unit: expected m, cm, mm, found 'inch'"),
        (["--mesh", "a.step"], "taxel: a.step: name: expected a mesh that ends in .ply, .stl, .obj, found .step"),
        (["--mesh", "a.stl"], "taxel: a.stl: No such file or directory"),
        (
            ["--gap-report", "missing.json"],
            "taxel: missing.json: expected a report.json of taxel gap diagnose, found nothing",
        ),
        (["--recipe", "missing.toml"], "taxel: missing.toml: No such file or directory"),
    ],
)
def test_a_bad_option_is_one_line_and_makes_nothing(arguments, complaint, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert refusal(capsys, "generate", *arguments, "--out", "new").startswith(complaint)
    assert list(tmp_path.iterdir()) == []
