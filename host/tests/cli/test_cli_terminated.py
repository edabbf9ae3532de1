"""A command that a service manager ends puts its things away."""

import os
import signal
import subprocess
import sys
from pathlib import Path

PATIENCE_S = 60.0


def test_an_emulator_ends_with_its_command(tmp_path):
    command = [str(Path(sys.executable).with_name("taxel")), "emulate"]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env={**os.environ, "TMPDIR": str(tmp_path), "PYTHONUNBUFFERED": "1"}
    )
    assert process.stdout is not None
    line = process.stdout.readline()
    device = next(word for word in line.split() if word.startswith("/dev/"))
    assert [path.name.split("-")[0] for path in tmp_path.iterdir()] == ["taxel"]
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=PATIENCE_S)  # till the emulator, which writes here too, has ended
    assert list(tmp_path.iterdir()) == []
    assert not Path(device).exists()
