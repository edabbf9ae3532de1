"""Commands on a full disk: one error line, exit status 1, the old file unchanged, no temporary file.

A limit of the file size takes the place of the full disk: the system refuses a write beyond it, with another error.
"""

import resource
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import h5py
import numpy as np
import pytest

from taxel.recording import GraspDatasetWriter
from taxel.recording.formats import convert
from taxel.skin.recorder import open_recorded

CRASH_TOOLS = Path(__file__).resolve().parents[3] / "tools" / "crash"
CONVERSION_LIMIT_BYTES = 9000
"""Less than any converted file of the capture has."""
DATASET_LIMIT_BYTES = 100_000
"""More than the first grasp of a dataset needs, and less than 20 grasps need."""


def limit_file_size(limit_bytes):
    """Let the system refuse larger files of this process, without the signal that would end the process."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes))


def run_taxel(*arguments):
    """Run `taxel ARGUMENTS` on a full disk; return its exit status and standard error."""
    program = "import sys; from taxel.cli.main import main; sys.argv[0] = 'taxel'; main()"
    command = [sys.executable, "-c", program, *map(str, arguments)]
    limit = partial(limit_file_size, CONVERSION_LIMIT_BYTES)
    result = subprocess.run(command, preexec_fn=limit, capture_output=True, text=True, check=False)
    return result.returncode, result.stderr.strip()


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """Path of a 2 s capture."""
    path = tmp_path_factory.mktemp("capture") / "source.bin"
    with open_recorded("emulator:?speed=max&duration_s=2", path, "flat8") as skin:
        for _ in skin:
            pass
    return path


@pytest.mark.parametrize("name", ["x.h5", "x.mcap", "x.bin", "x.pcapng", "x.parquet", "x.csv"])
def test_conversion_on_a_full_disk_keeps_the_old_file(tmp_path, capture, name):
    convert(capture, tmp_path / name)
    files = [tmp_path / name] if (tmp_path / name).is_file() else sorted((tmp_path / name).iterdir())
    contents = [file.read_bytes() for file in files]
    # `run_taxel` limits the size of a file to less than the conversion needs, as a full disk does.
    status, errors = run_taxel("convert", capture, tmp_path / name, "--overwrite")
    assert (status, errors.count("\n")) == (1, 0), errors
    assert name in errors
    assert [file.read_bytes() for file in files] == contents
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_dataset_writer_on_a_full_disk_keeps_the_complete_grasps_and_does_not_crash(tmp_path):
    # The HDF5 library crashed at the end of the program after a failed write.
    program = """
import sys
sys.path.insert(0, sys.argv[2])
from crash_cases import make_grasp, make_header
from taxel.errors import TaxelError
from taxel.recording import GraspDatasetWriter
try:
    with GraspDatasetWriter.create(sys.argv[1], make_header()) as out:
        for number in range(20):
            out.add(make_grasp(number))
            print(number + 1, flush=True)
except TaxelError as error:
    sys.exit(str(error))
"""
    path = tmp_path / "x.h5"
    limit = partial(limit_file_size, DATASET_LIMIT_BYTES)
    command = [sys.executable, "-c", program, path, CRASH_TOOLS]
    result = subprocess.run(command, preexec_fn=limit, capture_output=True, text=True, check=False)
    assert (result.returncode, result.stderr.count("\n")) == (1, 1), (result.returncode, result.stderr)
    complete = len(result.stdout.split())
    assert complete > 0
    with h5py.File(path, "r") as file:
        assert len(file["grasps"]) >= complete
        assert all(np.isfinite(file["grasps"][name]["timestamp"][()]).all() for name in file["grasps"])
    with GraspDatasetWriter.extend(path) as out:
        assert len(out.ids) >= complete
