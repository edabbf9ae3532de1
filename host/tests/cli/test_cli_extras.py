"""Commands in an installation without optional packages."""

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
"""Import names of the distributions for which they are not the name of the distribution."""

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


def run_taxel(folder: Path, *words: str, installed: Collection[str] = ()) -> subprocess.CompletedProcess[str]:
    """Run `taxel` with no optional packages but `installed`: the import of a module that is None fails."""
    missing = sorted(set(EXTRA_OF_PACKAGE) - set(installed))
    program = f"import sys; sys.modules.update(dict.fromkeys({missing})); from taxel.cli.main import main; main()"
    command = [sys.executable, "-c", program, *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)


def list_packages(extra: str) -> set[str]:
    """Import names of the packages of an extra."""
    packages: set[str] = set()
    for requirement in PROJECT["optional-dependencies"][extra]:
        if requirement.startswith("taxel["):
            for inner in requirement.removeprefix("taxel[").removesuffix("]").split(","):
                packages |= list_packages(inner)
        else:
            name = re.split(r"[<>=; ]", requirement)[0]
            packages |= IMPORT_NAMES.get(name, {name})
    return packages


@pytest.mark.parametrize("command", [name for name in COMMANDS if name not in HELP_NEEDS_EXTRA])
def test_help_of_a_core_command_needs_no_optional_package(tmp_path, command):
    finished = run_taxel(tmp_path, command, "--help")
    assert finished.returncode == 0, finished.stderr
    assert finished.stderr == ""


@pytest.mark.parametrize(
    ("words", "extra"),
    [*(((name, "--help"), extra) for name, extra in HELP_NEEDS_EXTRA.items()), *RUN_NEEDS_EXTRA.items()],
    ids=lambda value: value[0] if isinstance(value, tuple) else value,
)
def test_a_command_without_its_packages_names_the_extra_in_one_line(tmp_path, words, extra):
    finished = run_taxel(tmp_path, *words)
    assert finished.returncode != 0
    assert len(finished.stderr.splitlines()) == 1
    assert finished.stderr.rstrip().endswith(f"pip install 'taxel[{extra}]'")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", HELP_NEEDS_EXTRA)
def test_the_extra_that_a_message_names_is_sufficient_for_the_command(tmp_path, command):
    finished = run_taxel(tmp_path, command, "--help", installed=list_packages(HELP_NEEDS_EXTRA[command]))
    assert finished.returncode == 0, finished.stderr


def test_the_blind_check_names_the_extra_with_emulator_and_simulator(tmp_path):
    finished = run_taxel(tmp_path, "gap", "blind", "--worlds", "1", "--out", "blind", installed=list_packages("gap"))
    assert finished.stderr.endswith("pip install 'taxel[all]'\n")


def test_every_extra_that_a_message_names_exists():
    extras = set(PROJECT["optional-dependencies"])
    assert set(EXTRA_OF_PACKAGE.values()) <= extras
    assert {entry.extra for entry in COMMANDS.values() if entry.extra is not None} <= extras


def test_the_extra_all_contains_every_extra_of_a_command():
    (everything,) = PROJECT["optional-dependencies"]["all"]
    contained = set(everything.removeprefix("taxel[").removesuffix("]").split(","))
    assert contained == set(PROJECT["optional-dependencies"]) - {"all", "docs", "test"}
