"""Short form of `make crash-writers`: some faults of every writer; the seed that repeats them is printed."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
SAMPLE = 1
"""Faults of each writer; all of them take minutes."""


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler: apt-get install gcc")
def test_no_writer_loses_complete_records_after_a_fault(tmp_path):
    program = ROOT / "tools" / "crash" / "crash_writers.py"
    command = [sys.executable, program, "--sample", str(SAMPLE), "--jobs", "1", "--folder", tmp_path]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "0 broken guarantees" in result.stdout
