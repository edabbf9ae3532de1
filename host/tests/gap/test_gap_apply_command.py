"""`taxel gap apply`: output, refused inputs with one error line, and a simulator command of the user."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path

import h5py
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from taxel.gap.data.pair import read_pair
from taxel.gap.errors import GapInputError
from taxel.gap.report.reading import read_report
from taxel.recording.grasp_dataset import GraspDataset

N = 60

SIMULATOR = """
import json, shutil, sys
import h5py
effects, sim, out = sys.argv[1:]
found = json.load(open(effects))
shutil.copyfile(sim, out)
with h5py.File(out, "r+") as file:
    for grasp in file["grasps"].values():
        grasp["raw_counts"][...] = 29_000
    file.attrs["mine"] = found["effects"][0]["name"]
print(found["effects"][0]["parameters"])
"""


@pytest.fixture(scope="module")
def paths(write_world, tmp_path_factory):
    """Paths of a real and a simulated dataset."""
    return write_world(tmp_path_factory.mktemp("apply_command"), conditions=2, sessions=1, repeats=1)


@pytest.fixture(scope="module")
def digest(paths):
    return read_pair(*paths).digests[1]


@pytest.fixture
def content(digest):
    """Content of a report that names a saturation and a gain of each taxel."""
    number = list(range(N // 2)) * 2
    shared = {"until_s": 3.5, "shift_s": 0.0}
    clip = {"form": "clip", "scope": "hand", "order": 60, "blocks": ["hand"]}
    gain = {"form": "taxels", "scope": "taxel", "order": 50, "blocks": list(range(N))}
    clip["parameters"] = {"counts": {"unit": "counts", "values": [400.0]}}
    gain["parameters"] = {"log_gain": {"unit": "1", "values": [0.1] * N}}
    return {
        "format": "taxel-gap-report",
        "version": 1,
        "inputs": {"sim": {"path": "sim.h5", "sha256": digest}},
        "verdict": {"status": "partly_explained", "effects": ["saturation", "gain_mismatch", "unknown"]},
        "effects": [
            {"name": "gain_mismatch", "model": {**gain, **shared}},
            {"name": "saturation", "model": {**clip, **shared}},
        ],
        "taxels": {
            "sensor": [0x20] * (N // 2) + [0x21] * (N // 2),
            "tx": [one // 5 for one in number],
            "rx": [one % 5 for one in number],
        },
    }


@pytest.fixture
def report(content, tmp_path) -> Path:
    """Path of a report with `content`."""
    path = tmp_path / "report.json"
    path.write_text(json.dumps(content))
    return path


def test_effects_are_added_in_their_physical_order(capsys, report, paths, tmp_path):
    out = tmp_path / "sim2.h5"
    assert run_taxel("gap", "apply", report, paths[1], "--out", out) == 0
    printed = capsys.readouterr().out
    assert "gain mismatch, saturation" in printed
    assert "unknown cause" in printed
    # The gain acts before the saturation at 400 counts, although the verdict names the saturation first. Noise causes
    # the signals above 400 counts.
    with GraspDataset(out) as data:
        signal_counts = max((30_000.0 - grasp.raw_counts).max() for grasp in data)
    assert 400.0 <= signal_counts < 430.0
    assert run_taxel("gap", "apply", report, paths[1], "--out", out, "--overwrite", "--json") == 0
    assert json.loads(capsys.readouterr().out)["effects"] == ["gain_mismatch", "saturation"]


def test_an_existing_file_is_kept_without_overwrite_and_after_a_refusal(capsys, report, paths, tmp_path):
    real, sim = paths
    out = tmp_path / "sim2.h5"
    out.write_text("mine")
    assert "a new file" in run_refused_command(capsys, "gap", "apply", report, sim, "--out", out)
    assert "source" in run_refused_command(capsys, "gap", "apply", report, real, "--out", out, "--overwrite")
    assert out.read_text() == "mine"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.json", "sim2.h5"]


def test_the_simulated_dataset_is_not_overwritten_by_the_output(capsys, report, paths):
    sim = Path(paths[1])
    content = sim.read_bytes()
    line = run_refused_command(capsys, "gap", "apply", report, sim, "--out", sim, "--overwrite")
    assert "a file other than the inputs" in line
    assert sim.read_bytes() == content


def test_a_dataset_of_another_hand_is_refused(capsys, report, paths, tmp_path):
    sim = tmp_path / "sim.h5"
    sim.write_bytes(Path(paths[1]).read_bytes())
    with h5py.File(sim, "r+") as file:
        file["sensors/address"][0] = 0x30
        file["taxels/sensor"][: N // 2] = 0x30
    line = run_refused_command(capsys, "gap", "apply", report, sim, "--out", tmp_path / "sim2.h5")
    assert "sim.h5: /taxels/sensor[0]: expected 32 as in" in line


def set_value(content, path, value):
    """Replace the value at a path of keys in nested tables and lists."""
    *outer_keys, last = path
    for key in outer_keys:
        content = content[key]
    content[last] = value


SATURATION = ("effects", 1, "model")


@pytest.mark.parametrize(
    ("path", "value", "words"),
    [
        (("format",), "another", "report.json: format"),
        (("version",), 3, "report.json: version"),
        (("verdict", "status"), "fine", "verdict.status"),
        (("verdict", "effects"), ["magic"], "verdict.effects[0]"),
        (("verdict", "effects"), ["saturation", "saturation"], "verdict.effects[1]"),
        (("verdict", "effects"), ["noise"], "an entry for noise"),
        (SATURATION, None, "effects[1].model"),
        ((*SATURATION, "form"), "round", "a form of saturation (clip of the hand, soft of the hand, "),
        ((*SATURATION, "scope"), "board", "effects[1].model.blocks"),
        ((*SATURATION, "scope"), "finger", "effects[1].model.blocks"),
        ((*SATURATION, "order"), 1.5, "effects[1].model.order"),
        ((*SATURATION, "until_s"), 0, "effects[1].model.until_s"),
        ((*SATURATION, "blocks"), ["hand", "hand"], "effects[1].model.blocks"),
        ((*SATURATION, "parameters"), {}, "counts and nothing else"),
        ((*SATURATION, "parameters", "counts", "unit"), "mm", "expected counts"),
        ((*SATURATION, "parameters", "counts", "values"), [400.0, 1.0], "1 numbers, found 2"),
        ((*SATURATION, "parameters", "counts", "values"), [-4.0], "a number from 50 to 1e+06"),
        ((*SATURATION, "parameters", "counts", "values"), [None], "a number"),
        ((*SATURATION, "parameters", "counts", "values"), ["many"], "a number"),
        (("effects", 0, "model", "blocks"), list(range(N - 1)), f"the indices 0 to {N - 1}"),
        (("taxels",), None, "taxels"),
        (("taxels", "tx"), [0], f"{N} integers"),
        (("inputs", "sim"), {}, "inputs.sim.sha256"),
    ],
)
def test_a_malformed_report_gives_one_error_line(capsys, content, paths, tmp_path, path, value, words):
    set_value(content, path, value)
    report = tmp_path / "report.json"
    report.write_text(json.dumps(content))
    line = run_refused_command(capsys, "gap", "apply", report, paths[1], "--out", tmp_path / "sim2.h5")
    assert "report.json: " in line
    assert words in line
    assert [found.name for found in tmp_path.iterdir()] == ["report.json"]


@pytest.mark.parametrize("text", ["", "[]", "{", '{"format": NaN}', "[" * 100_000, "\x89HDF"])
def test_a_file_that_is_not_a_report_gives_one_error_line(text, tmp_path):
    path = tmp_path / "report.json"
    path.write_text(text)
    with pytest.raises(GapInputError, match=r"report\.json.*make the report again"):
        read_report(path)


def test_a_folder_and_a_missing_file_are_refused_as_report(tmp_path):
    with pytest.raises(GapInputError, match="found a folder"):
        read_report(tmp_path)
    with pytest.raises(GapInputError, match="found no file"):
        read_report(tmp_path / "none.json")


def write_simulator(tmp_path, text=SIMULATOR) -> str:
    """Write the source text of a simulator, and return the command that runs it."""
    script = tmp_path / "my simulator.py"
    script.write_text(text)
    return shlex.join([sys.executable, str(script)]) + " {effects} {sim} {out}"


def test_a_simulator_command_of_the_user_creates_the_dataset(capfd, content, report, paths, tmp_path):
    """The simulator of this test sets all counts to 29000, and prints the limit of the saturation, 400 counts."""
    content["verdict"]["effects"] = ["saturation"]
    report.write_text(json.dumps(content))
    out = tmp_path / "sim2.h5"
    assert (
        run_taxel("gap", "apply", report, paths[1], "--out", out, "--resim", write_simulator(tmp_path), "--json") == 0
    )
    printed = capfd.readouterr()
    assert json.loads(printed.out)["effects"] == ["saturation"]
    assert "400.0" in printed.err
    with h5py.File(out) as file:
        assert file.attrs["mine"] == "saturation"
        assert json.loads(file.attrs["gap_applied"])["report"]["sha256"] == read_report(report).sha256
        assert (file["grasps/0000/raw_counts"][...] == 29_000).all()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["my simulator.py", "report.json", "sim2.h5"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("raise SystemExit(3)", "status 3"),
        ("", "no file"),
        ("import sys; open(sys.argv[3], 'w').write('no')", "sim2.h5: /: expected an HDF5 file"),
        (SIMULATOR + "h5py.File(out, 'r+')['taxels/rx'][:2] = [1, 0]", "sim2.h5: /taxels/rx[0]"),
        (SIMULATOR + "h5py.File(out, 'r+')['taxels/position'][3] = 0.5", "sim2.h5: /taxels/position[3]"),
        (SIMULATOR + "del h5py.File(out, 'r+')['grasps/0000']['phase']", "sim2.h5: /grasps/0000/phase"),
        (SIMULATOR + "h5py.File(out, 'r+')['grasps'].clear()", "sim2.h5: /grasps"),
    ],
)
def test_the_dataset_of_the_simulator_command_is_checked(capsys, report, paths, tmp_path, text, words):
    out = tmp_path / "sim2.h5"
    out.write_text("mine")
    resim = write_simulator(tmp_path, text)
    assert words in run_refused_command(
        capsys, "gap", "apply", report, paths[1], "--out", out, "--overwrite", "--resim", resim
    )
    assert out.read_text() == "mine"


@pytest.mark.parametrize(
    ("resim", "words"),
    [
        ("simulate {out}", "{effects} and {out}"),
        ("simulate '{effects} {out}", "close the quotes"),
        ("no-such-program {effects} {out}", "No such file"),
        (" ", "{effects} and {out}"),
    ],
)
def test_a_simulator_command_that_cannot_run_gives_one_error_line(capsys, report, paths, tmp_path, resim, words):
    assert words in run_refused_command(
        capsys, "gap", "apply", report, paths[1], "--out", tmp_path / "sim2.h5", "--resim", resim
    )


def test_without_an_effect_the_simulator_is_not_run(capsys, content, report, paths, tmp_path):
    content["verdict"] = {"status": "no_gap", "effects": []}
    report.write_text(json.dumps(content))
    out = tmp_path / "sim2.h5"
    resim = write_simulator(tmp_path, "raise SystemExit(3)")
    assert run_taxel("gap", "apply", report, paths[1], "--out", out, "--resim", resim) == 0
    assert "there is no gap" in capsys.readouterr().out
    assert out.read_bytes() == Path(paths[1]).read_bytes()


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (
            "<!DOCTYPE html>",
            "expected the report.json of a diagnosis, found an HTML page; give the report.json beside",
        ),
        ('{"a": 1,\n"b"', "expected the report.json of a diagnosis, found no valid JSON in line 2"),
        ('{"a": NaN}', "expected the report.json of a diagnosis, found no valid JSON"),
    ],
)
def test_a_file_that_is_not_a_report_is_refused_without_the_message_of_a_parser(
    capsys, paths, tmp_path, content, problem
):
    path = tmp_path / "x.html"
    path.write_text(content)
    for words in (("apply", path, paths[1]), ("export", path, "--to", "python"), ("next", path)):
        options = () if words[0] == "next" else ("--out", tmp_path / "out.h5")
        line = run_refused_command(capsys, "gap", *words, *options)
        assert problem in line
        assert "char" not in line
