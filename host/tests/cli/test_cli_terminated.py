"""A command that a service manager ends with SIGTERM ends its child processes and removes its temporary files."""

import os
import signal
import subprocess
import sys
from pathlib import Path

TIMEOUT_S = 60.0


def test_sigterm_ends_the_emulator_and_removes_its_files(tmp_path):
    command = [str(Path(sys.executable).with_name("taxel")), "emulate"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env={**os.environ, "TMPDIR": str(tmp_path), "PYTHONUNBUFFERED": "1"}
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    device = next(word for word in line.split() if word.startswith("/dev/"))
    assert [path.name.split("-")[0] for path in tmp_path.iterdir()] == ["taxel"]
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=TIMEOUT_S)  # also waits for the emulator, which inherits the pipe
    assert list(tmp_path.iterdir()) == []
    assert not Path(device).exists()
