"""Commands in an installation without optional packages: they run, or name the extra that contains the packages."""

import json
import re
import subprocess
import sys
import tomllib
from collections.abc import Collection
from pathlib import Path

import pytest

from taxel.cli.commands import COMMANDS
from taxel.optional import EXTRA_OF_PACKAGE

PROJECT = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
IMPORT_NAMES = {
    "libigl": {"igl"},
    "mcap": {"mcap", "lz4", "zstandard"},
    "python-can": {"can"},
    "ur-rtde": {"rtde_control", "rtde_receive"},
}
"""Distribution -> names of the modules that it contains, where they differ from the name of the distribution."""

HELP_NEEDS_EXTRA = {
    "demo": "all",
    "grasp": "sim",
    "show": "sim",
    "import": "sim",
    "generate": "sim",
    "gap": "gap",
    "cloud": "cloud",
    "thesis": "all",
}
RUN_NEEDS_EXTRA = {
    ("bench", "emulator:"): "bench",
    ("feel", "--out", "feel"): "plots",
    ("record", "emulator:?speed=max", "--seconds", "1", "--out", "skin.mcap"): "ros",
    ("scan", "/dev/i2c-1"): "i2c",
}


PROGRAM = """
import contextlib, io, json, sys
sys.modules.update(dict.fromkeys(json.loads(sys.argv[1])))  # the import of a module that is None fails
from taxel.cli.main import main
outcomes = []
for words in json.loads(sys.argv[2]):
    sys.argv = ["taxel", *words]
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as error:
        try:
            main()
        except SystemExit as request:
            outcomes.append([request.code or 0, error.getvalue()])
print(json.dumps(outcomes))
"""


def run_commands(
    folder: Path, commands: Collection[tuple[str, ...]], installed: Collection[str] = ()
) -> list[tuple[int, str]]:
    """Run commands in one process as if only the optional packages `installed` were installed.

    Return (exit status, standard error) of each command.
    """
    missing = sorted(set(EXTRA_OF_PACKAGE) - set(installed))
    program = [sys.executable, "-c", PROGRAM, json.dumps(missing), json.dumps([*commands])]
    finished = subprocess.run(program, cwd=folder, capture_output=True, text=True, timeout=300)
    assert finished.returncode == 0, finished.stderr
    return [(status, error) for status, error in json.loads(finished.stdout)]


def list_packages(extra: str) -> set[str]:
    """Return the import names of the packages that an extra of pyproject.toml contains, also through other extras."""
    packages: set[str] = set()
    for requirement in PROJECT["optional-dependencies"][extra]:
        if requirement.startswith("taxel["):
            for inner in requirement.removeprefix("taxel[").removesuffix("]").split(","):
                packages |= list_packages(inner)
        else:
            name = re.split(r"[<>=; ]", requirement)[0]
            packages |= IMPORT_NAMES.get(name, {name})
    return packages


def test_help_of_a_core_command_needs_no_optional_package(tmp_path):
    commands = [name for name in COMMANDS if name not in HELP_NEEDS_EXTRA]
    outcomes = run_commands(tmp_path, [(name, "--help") for name in commands])
    assert dict(zip(commands, outcomes, strict=True)) == dict.fromkeys(commands, (0, ""))


def test_a_command_without_its_packages_names_the_extra_in_one_line(tmp_path):
    commands = {(name, "--help"): extra for name, extra in HELP_NEEDS_EXTRA.items()} | RUN_NEEDS_EXTRA
    outcomes = run_commands(tmp_path, commands)
    for (words, extra), (status, error) in zip(commands.items(), outcomes, strict=True):
        assert status != 0, words
        assert len(error.splitlines()) == 1, words
        assert error.rstrip().endswith(f"pip install 'taxel[{extra}]'"), words
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("extra", sorted(set(HELP_NEEDS_EXTRA.values())))
def test_the_extra_that_a_message_names_is_sufficient_for_the_command(tmp_path, extra):
    commands = [name for name, named_extra in HELP_NEEDS_EXTRA.items() if named_extra == extra]
    outcomes = run_commands(tmp_path, [(name, "--help") for name in commands], installed=list_packages(extra))
    assert dict(zip(commands, outcomes, strict=True)) == dict.fromkeys(commands, (0, ""))


def test_the_blind_check_with_only_the_extra_gap_names_the_extra_all(tmp_path):
    command = ("gap", "blind", "--worlds", "1", "--out", "blind")
    ((status, error),) = run_commands(tmp_path, [command], installed=list_packages("gap"))
    assert status == 1
    assert error.endswith("pip install 'taxel[all]'\n")


def test_every_extra_that_a_message_names_exists():
    extras = set(PROJECT["optional-dependencies"])
    assert set(EXTRA_OF_PACKAGE.values()) <= extras
    assert {entry.extra for entry in COMMANDS.values() if entry.extra is not None} <= extras


def test_the_extra_all_contains_every_extra_of_a_command():
    (everything,) = PROJECT["optional-dependencies"]["all"]
    contained = set(everything.removeprefix("taxel[").removesuffix("]").split(","))
    assert contained == set(PROJECT["optional-dependencies"]) - {"all", "docs", "test"}
