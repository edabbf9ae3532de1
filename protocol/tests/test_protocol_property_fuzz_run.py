"""tools/fuzz/run_targets.py parses the output of a libFuzzer target and reports missing programs."""

import importlib
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

FOLDER = Path(__file__).resolve().parents[2] / "tools" / "fuzz"
TARGET = """#!/bin/sh
echo '#120 NEW    cov: 17 ft: 23 corp: 3/9b lim: 4 exec/s: 0' >&2
echo '#500 REDUCE cov: 351 ft: 1969 corp: 5/40b lim: 9 exec/s: 100' >&2
for option; do case $option in -artifact_prefix=*) prefix=${option#*=};; esac; done
%s
echo 'stat::number_of_executed_units: 56694' >&2
exit %d
"""


@pytest.fixture
def run_targets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """Module tools/fuzz/run_targets.py with folders inside `tmp_path`."""
    monkeypatch.syspath_prepend(str(FOLDER))
    module = importlib.import_module("run_targets")
    for name, folder in (("ROOT", tmp_path), ("OUT", tmp_path / "out"), ("BUILD", tmp_path / "build")):
        monkeypatch.setattr(module, name, folder)
    yield module
    del sys.modules["run_targets"]


def write_target(folder: Path, finding: str, status: int) -> Path:
    """Write a program that behaves as a libFuzzer target: runs the command `finding` and exits with `status`."""
    path = folder / "fuzz_hub"
    path.write_text(TARGET % (finding, status))
    path.chmod(0o755)
    return path


def test_the_statistics_of_a_target_are_read(run_targets: ModuleType, tmp_path: Path) -> None:
    outcome = run_targets.run_target(write_target(tmp_path, "", 0), ["-runs=1"], seed=1)
    assert (outcome.executions, outcome.edges, outcome.features) == (56694, 351, 1969)
    assert outcome.findings == []


def test_a_crashing_input_is_named(run_targets: ModuleType, tmp_path: Path) -> None:
    outcome = run_targets.run_target(write_target(tmp_path, "echo x > ${prefix}crash-1", 77), ["-runs=1"], seed=1)
    assert outcome.findings == ["out/findings/fuzz_hub-crash-1"]


def test_a_target_that_fails_without_a_file_is_a_finding(run_targets: ModuleType, tmp_path: Path) -> None:
    outcome = run_targets.run_target(write_target(tmp_path, "", 1), ["-runs=1"], seed=1)
    assert outcome.findings == ["no file; see out/fuzz_hub.log"]


def test_missing_clang_is_reported_with_the_package_to_install(
    run_targets: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    for arguments, status in ([], 2), (["--if-possible"], 0):
        monkeypatch.setattr(sys, "argv", ["run_targets.py", *arguments])
        assert run_targets.main() == status
        expected = "fuzz: clang or its runtime is missing: apt-get install clang libclang-rt-14-dev\n"
        assert capsys.readouterr().err == expected
