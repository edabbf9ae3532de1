"""Commands in an installation without optional packages."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from taxel.cli.commands import COMMANDS
from taxel.optional import EXTRA_OF_PACKAGE

PROJECT = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
WITHOUT_OPTIONAL_PACKAGES = (
    f"import sys; sys.modules.update(dict.fromkeys({sorted(EXTRA_OF_PACKAGE)!r}));"
    "from taxel.cli.main import main; main()"
)
"""Program that runs `taxel` as if no optional package were installed: an import of a module that is None fails."""

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


def run_taxel(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    program = [sys.executable, "-c", WITHOUT_OPTIONAL_PACKAGES, *words]
    return subprocess.run(program, cwd=folder, capture_output=True, text=True, timeout=120)


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


def test_every_extra_that_a_message_names_exists():
    extras = set(PROJECT["optional-dependencies"])
    assert set(EXTRA_OF_PACKAGE.values()) <= extras
    assert {entry.extra for entry in COMMANDS.values() if entry.extra is not None} <= extras


def test_the_extra_all_contains_every_extra_of_a_command():
    (everything,) = PROJECT["optional-dependencies"]["all"]
    contained = set(everything.removeprefix("taxel[").removesuffix("]").split(","))
    assert contained == set(PROJECT["optional-dependencies"]) - {"all", "docs", "test"}
