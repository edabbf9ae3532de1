"""`taxel generate`: the example of its help, its output, and invalid options."""

import json
import re
import shutil
from pathlib import Path

import pytest

from host.tests.command_line import run_refused_command, run_taxel
from taxel.cli.generate import generate

REPORT = Path(__file__).parents[3] / "examples" / "shape_classifier" / "report.json"


def extract_example_arguments() -> list[str]:
    """Extract the example's arguments after `taxel` from the help of the command."""
    match = re.search(r"Example: taxel (.*)", generate.__doc__ or "")
    assert match
    return match[1].split()


def test_example_of_the_help_runs(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("out/gap").mkdir(parents=True)
    shutil.copy(REPORT, "out/gap/report.json")
    arguments = [
        "2" if word == "100000" else word for word in extract_example_arguments()
    ]  # fewer grasps, to save time
    assert run_taxel(*arguments, "--jobs", "1") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "out/synthetic: 2 grasps in 1 shards, effects: contact propagation"
    assert lines[1].startswith("generated in this run: 2 in ")
    assert run_taxel(*arguments, "--json") == 0
    result = json.loads(capsys.readouterr().out)
    assert (result["grasps"], result["made"], result["effects"]) == (2, 0, ["contact_propagation"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--fidelity", "best"], "taxel: --fidelity: expected quick, full, found 'best'"),
        (["--jobs", "2", "--scheduler", "tcp://127.0.0.1:9"], "taxel: --jobs and --scheduler: expected one of them"),
        (["--unit", "inch", "--mesh", "a.stl"], "taxel: --unit: expected m, cm, mm, found 'inch'"),
        (["--mesh", "a.step"], "taxel: a.step: name: expected a mesh file with one of the endings .ply, .stl, .obj"),
        (["--mesh", "a.stl"], "taxel: a.stl: No such file or directory"),
        (
            ["--gap-report", "missing.json"],
            "taxel: missing.json: expected a report.json of taxel gap diagnose, found",
        ),
        (["--recipe", "missing.toml"], "taxel: missing.toml: No such file or directory"),
    ],
)
def test_invalid_option_is_refused_and_creates_no_file(arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run_refused_command(capsys, "generate", *arguments, "--out", "new").startswith(message)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("option", "value"), [("--grasps", "-1"), ("--seed", "-2"), ("--grasps-per-shard", "20000"), ("--jobs", "-1")]
)
def test_number_outside_its_range_is_refused(option, value, capsys, tmp_path):
    assert run_taxel("generate", option, value, "--out", tmp_path / "new") != 0
    assert option in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
