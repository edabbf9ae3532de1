"""The core without optional packages: captures, CSV export, terminal monitor; other formats name their extra."""

import subprocess
import sys

import pytest

from taxel.optional import EXTRA_OF_PACKAGE

RUN = f"""
import sys

class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {set(EXTRA_OF_PACKAGE)!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Blocked())
from taxel.cli.main import main
main()
"""


def run_taxel(folder, *arguments):
    """Run `taxel ARGUMENTS...` in a process in which no optional package can be imported."""
    command = [sys.executable, "-c", RUN, *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with a capture of one second."""
    path = tmp_path_factory.mktemp("core")
    result = run_taxel(path, "record", "emulator:?speed=max", "--seconds", 1, "--out", "x.bin")
    assert result.returncode == 0, result.stderr
    return path


@pytest.mark.parametrize(
    "arguments",
    [
        ("convert", "x.bin", "x.csv"),
        ("replay", "x.bin", "--json"),
        ("monitor", "file:x.bin", "--speed", "50"),
        ("monitor", "emulator:?speed=max", "--once", "--baseline-frames", "5"),
    ],
)
def test_command_runs_without_optional_packages(folder, arguments):
    result = run_taxel(folder, *arguments)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize(("target", "extra"), [("x.mcap", "ros"), ("x.parquet", "parquet"), ("x.h5", "gap")])
def test_other_formats_name_the_extra_to_install(folder, target, extra):
    result = run_taxel(folder, "convert", "x.bin", target)
    assert result.returncode == 1
    assert "Traceback" not in result.stderr
    assert result.stderr.splitlines()[-1].endswith(f"pip install 'taxel[{extra}]'")
    assert not (folder / target).exists()
