"""Plug-ins on the command line: the package of docs/how-to-write-a-plugin.md, and packages with errors."""

import contextlib
import gzip
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from host.tests.plugin_package import installed_package
from taxel.gap.effects.catalogue import all_effects
from taxel.plugins import COMMANDS, EFFECTS, IMPORTERS, LINKS, PluginError
from taxel.recording.grasp_dataset import GraspDataset

GUIDE = Path(__file__).parents[3] / "docs" / "how-to-write-a-plugin.md"
FILE_BLOCK = re.compile(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", re.DOTALL)
COMMAND_BLOCK = re.compile(r"```sh\n(.*?)```", re.DOTALL)
FILES = dict(FILE_BLOCK.findall(GUIDE.read_text()))
COMMAND_LINES = "".join(COMMAND_BLOCK.findall(GUIDE.read_text())).splitlines()
ENTRY_POINTS = tomllib.loads(FILES["pyproject.toml"])["project"]["entry-points"]
MONITOR_LINE = re.compile(r"(\d+/\d+ boards),.* (\d+ active, signal up to \d+),")
COMMAND_SOURCE = """
import typer
app = typer.Typer()
@app.command()
def first(): print("first command")
@app.command()
def second(): print("second command")
def printname(name: str = "world"):
    "Print a name."
    print("name:", name)
def needs_simulator():
    pass
"""
TARGETS = {"printname": "my_commands:printname", "several": "my_commands:app"}
UNUSABLE = {  # source of a module whose command or importer `x` cannot be used: expected text of the error
    "x = 3": "expected a function or a typer.Typer, found an object of type int",
    "def x(value: complex): pass": "complex",
    "import no_such_module": "cannot be loaded (ModuleNotFoundError: No module named 'no_such_module')",
    "raise OSError('no sensor')": "cannot be loaded (OSError: no sensor)",
}


@contextlib.contextmanager
def install_guide_package(folder):
    """Make the package of the guide available inside the `with` block."""
    folder.mkdir()
    with installed_package(folder, "taxel_compressed", FILES["taxel_compressed.py"], ENTRY_POINTS):
        yield


@pytest.fixture
def arrays(tmp_path):
    """Folder of .npy files with the arrays of one grasp."""
    arrays = {
        "source": "real",
        "hand": "allegro",
        "objects/can/vertices": np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.1]]),
        "objects/can/faces": np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
        "taxels/sensor": [32],
        "taxels/tx": [0],
        "taxels/rx": [0],
        "taxels/position": [[0.0, 0.0, 0.0]],
        "taxels/normal": [[0.0, 0.0, 1.0]],
        "taxels/size": [3e-3],
        "sensors/address": [32],
        "sensors/name": np.array(["palm"]),
        "sensors/kind": np.array(["palm"]),
        "sensors/rate_hz": [20.0],
        "grasps/0001/object": "can",
        "grasps/0001/approach": "top",
        "grasps/0001/iteration": 0,
        "grasps/0001/session": 0,
        "grasps/0001/timestamp": np.arange(2) * 0.05,
        "grasps/0001/phase": np.array([0, 0]),
        "grasps/0001/raw_counts": np.full((2, 1), 3000),
        "grasps/0001/valid": np.ones((2, 1), bool),
        "grasps/0001/sensor_pose": np.eye(4)[None],
        "grasps/0001/object_pose": np.eye(4),
    }
    folder = tmp_path / "data"
    for name, value in arrays.items():
        file = folder / f"{name}.npy"
        file.parent.mkdir(parents=True, exist_ok=True)
        np.save(file, value)
    return folder


def test_the_link_of_the_guide_plays_a_compressed_capture(tmp_path, capsys):
    capture = tmp_path / "skin.bin"
    assert run_taxel("record", "emulator:?speed=max", "--seconds", 1, "--out", capture) == 0
    compressed = tmp_path / "skin.bin.gz"
    compressed.write_bytes(gzip.compress(capture.read_bytes()))
    capsys.readouterr()
    outputs = []
    with install_guide_package(tmp_path / "package"):
        for url in (f"file:{capture}", f"gz:{compressed}"):
            assert run_taxel("monitor", url, "--once", "--baseline-frames", 10) == 0
            outputs.append(MONITOR_LINE.search(capsys.readouterr().out).groups())
        assert run_taxel("monitor", f"gz:{compressed}", "--once", "--baseline-frames", 10, "--speed", 8) == 0
        compressed.write_bytes(b"no gzip")
        error_line = run_refused_command(capsys, "monitor", f"gz:{compressed}", "--once")
        assert "cannot be read (Not a gzipped file" in error_line
    # The largest signal depends on the instant of the reading.
    boards, states = zip(*outputs, strict=True)
    assert boards[0] == boards[1]
    assert [state.partition(",")[0] for state in states] == ["0 active", "0 active"]
    # Without the installed package, the scheme gz: is unknown.
    refusal = run_refused_command(capsys, "monitor", f"gz:{compressed}", "--once")
    assert "one of i2c:, serial:, emulator:, file:" in refusal


def test_the_importer_of_the_guide_is_a_command_of_taxel_import(tmp_path, capsys, arrays):
    with install_guide_package(tmp_path / "package"):
        assert run_taxel("import", "--help") == 0
        assert re.search(r"npy +Import a folder of \.npy files", capsys.readouterr().out)
        assert run_taxel("import", "npy", "--help") == 0
        assert "folder" in capsys.readouterr().out.lower()
        assert run_taxel("import", "npy", arrays, tmp_path / "data.h5") == 0
        assert "Did you mean" in run_refused_command(capsys, "import", "array")
    with GraspDataset(tmp_path / "data.h5") as data:
        data.check()
        assert data.ids == ("0001",)
    assert run_refused_command(capsys, "import", "npy", arrays).startswith("taxel: import: No such command 'npy'")


def test_the_package_of_the_guide_can_be_installed_by_pip(tmp_path, arrays):
    version = metadata.version("setuptools") if shutil.which("gzip") else "0"
    if tuple(map(int, version.split(".")[:2])) < (70, 1):
        pytest.skip("setuptools 70.1 or gzip is not installed: pip install 'setuptools>=70.1'")
    target = tmp_path / "target"
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    folders = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = {**os.environ, "PYTHONPATH": str(target), "PATH": folders, "COLUMNS": "100"}
    for line in COMMAND_LINES:
        arguments = shlex.split(line)
        if arguments[0] == "pip":
            arguments = [
                sys.executable,
                "-m",
                *arguments,
                "--no-build-isolation",
                "--no-deps",
                "-q",
                "--target",
                str(target),
            ]
        result = subprocess.run(arguments, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120)
        assert result.returncode == 0, f"{line}\n{result.stdout}{result.stderr}"
    with GraspDataset(tmp_path / "data.h5") as data:
        data.check()


def test_commands_of_another_package_run_and_are_listed_without_being_loaded(tmp_path, capsys):
    with installed_package(tmp_path, "my_commands", COMMAND_SOURCE, {COMMANDS: TARGETS}):
        assert run_taxel("--help") == 0
        help_page = capsys.readouterr().out
        assert "Commands of other packages" in help_page
        assert re.search(r"printname +Command of the package 'my_commands'; see its own --help", help_page)
        assert "my_commands" not in sys.modules
        assert run_taxel("printname", "--name", "hand") == 0
        assert run_taxel("several", "second") == 0
        assert capsys.readouterr().out == "name: hand\nsecond command\n"


@pytest.mark.parametrize("source", UNUSABLE)
def test_an_unusable_command_gives_one_error_line_and_leaves_the_others_usable(tmp_path, capsys, source):
    with installed_package(tmp_path, "my_commands", source, {COMMANDS: {"broken": "my_commands:x"}}):
        line = run_refused_command(capsys, "broken", "--option", "value")
        assert line.startswith("taxel: entry point 'broken' of group 'taxel.commands' in package 'my_commands' cannot")
        assert UNUSABLE[source] in line
        assert run_taxel("--help") == 0
        assert run_taxel("cloud", "--help") == 0


@pytest.mark.parametrize("source", UNUSABLE)
def test_an_unusable_importer_gives_one_error_line_and_leaves_the_others_usable(tmp_path, capsys, source):
    with installed_package(tmp_path, "my_importers", source, {IMPORTERS: {"broken": "my_importers:x"}}):
        line = run_refused_command(capsys, "import", "broken", "file", "--option", "value")
        assert line.startswith("taxel: entry point 'broken' of group 'taxel.importers' in package 'my_importers' canno")
        assert UNUSABLE[source] in line
        assert run_taxel("import", "--help") == 0
        assert "arrays" in capsys.readouterr().out
        assert run_taxel("import", "arrays", "--help") == 0


def test_a_command_that_needs_an_optional_library_names_its_extra(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with installed_package(tmp_path, "my_commands", "import viser", {COMMANDS: {"web": "my_commands:x"}}):
        line = run_refused_command(capsys, "web")
    assert line == (
        "taxel: taxel web needs the Python package 'viser', which is not installed; "
        "install the extra 'web': pip install 'taxel[web]'"
    )


@pytest.mark.parametrize(
    ("group", "name", "arguments"),
    [
        (COMMANDS, "gap", ("gap", "--help")),
        (IMPORTERS, "arrays", ("import", "--help")),
        (LINKS, "serial", ("monitor", "serial:///dev/none", "--once")),
    ],
)
def test_a_name_in_two_packages_gives_one_error_line_with_both_packages(tmp_path, capsys, group, name, arguments):
    with installed_package(tmp_path, "my_package", "x = None", {group: {name: "my_package:x"}}):
        line = run_refused_command(capsys, *arguments)
    assert f"entry point '{name}' of group '{group}' is in two packages, 'taxel' and 'my_package'" in line


def test_an_effect_name_in_two_packages_is_refused(tmp_path):
    with (
        installed_package(tmp_path, "my_package", "x = None", {EFFECTS: {"noise": "my_package:x"}}),
        pytest.raises(PluginError, match=r"'noise' of group 'taxel\.effects' is in two packages, 'taxel' and 'my_pack"),
    ):
        all_effects()
