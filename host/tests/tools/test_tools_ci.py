"""`.ci/run` fails with one line for each program that the tests need and that is missing."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[3] / ".ci" / "run"
SHELL_PROGRAMS = ("bash", "cat", "dirname", "env", "git", "id", "mktemp", "rm")
OPTIONAL_PROGRAMS = (
    *("clang", "arm-none-eabi-gcc", "qemu-system-arm", "chromium"),
    *("g++", "rustc", "lua5.4", "tshark", "ROS 1"),
)


def add_program(folder: Path, name: str, text: str = "exit 0") -> None:
    """Write an executable shell script to a folder of programs. text: body of the script."""
    (folder / name).write_text(f"#!/bin/bash\n{text}\n")
    (folder / name).chmod(0o755)


@pytest.fixture
def programs(tmp_path):
    """Folder that replaces PATH: the shell's programs, a compiler, and a `make` that prints its target."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name in SHELL_PROGRAMS:
        (folder / name).symlink_to(shutil.which(name))
    add_program(folder, "cc", "cat > /dev/null")
    add_program(folder, "make", 'echo "make $*"')
    return folder


def run_ci(programs: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run `.ci/run` with `programs` as its PATH. variables: additional environment variables."""
    environment = {"PATH": str(programs), "PYTHON": sys.executable, "TMPDIR": str(programs), **variables}
    return subprocess.run([SCRIPT, *arguments], env=environment, capture_output=True, text=True, timeout=60)


def test_each_missing_program_is_named_in_one_line_and_no_test_runs(programs):
    finished = run_ci(programs)
    assert finished.returncode == 1
    assert finished.stdout == ""
    lines = finished.stderr.splitlines()
    assert [line.partition(" is missing")[0] for line in lines] == [f"ci: {name}" for name in OPTIONAL_PROGRAMS]


def test_a_failed_installation_is_an_error(programs):
    add_program(programs, "id", "echo 0")
    add_program(programs, "apt-get", "exit 100")
    finished = run_ci(programs)
    assert finished.returncode == 1
    assert "make" not in finished.stdout
    assert "ci: apt-get install qemu-system-arm failed" in finished.stderr
    assert "ci: qemu-system-arm is missing or incomplete" in finished.stderr


def test_a_compiler_without_its_runtime_library_is_reported_as_missing(programs):
    add_program(programs, "clang", "cat > /dev/null; exit 1")
    assert "ci: clang is missing or incomplete; install it: apt-get install clang" in run_ci(programs, "--check").stderr


def test_optional_programs_are_left_out_only_on_request(programs):
    finished = run_ci(programs, CI_OPTIONAL="skip")
    assert finished.returncode == 0
    assert finished.stdout.splitlines() == ["make test", "make test-slow", "make test-threads"]
    assert finished.stderr.count("left out: ") == len(OPTIONAL_PROGRAMS)


def test_a_missing_compiler_is_an_error_also_without_optional_programs(programs):
    (programs / "cc").unlink()
    finished = run_ci(programs, CI_OPTIONAL="skip")
    assert finished.returncode == 1
    assert finished.stdout == ""
    assert "ci: cc is missing or incomplete; install it: apt-get install gcc libc6-dev" in finished.stderr


def test_a_wrong_argument_is_refused(programs):
    assert run_ci(programs, "--chekc").returncode == 2
    assert run_ci(programs, CI_OPTIONAL="yes").returncode == 2
