"""`taxel emulate`: a virtual serial port of the project's own hub, or of the original one."""

import os
import subprocess
import sys
import time
from pathlib import Path

from host.tests.command_line import run_refused_command


def read_port(arguments: list[str], size: int) -> bytes:
    """The first `size` bytes of the virtual serial port of `taxel emulate` with these arguments."""
    command = [str(Path(sys.executable).with_name("taxel")), "emulate", *arguments]
    data = b""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            port = os.open(process.stdout.readline().strip(), os.O_RDONLY | os.O_NOCTTY)
            deadline = time.monotonic() + 10.0
            while len(data) < size and time.monotonic() < deadline:
                data += os.read(port, size)
            os.close(port)
        finally:
            process.terminate()
    return data


def test_the_port_of_the_original_hub_sends_messages_without_a_command():
    data = read_port(["--hand", "original", "--protocol", "original", "--seconds", "10"], 3000)
    taxels_of_the_palm, palm = 121, 0x15
    assert bytes([0x01, 2 * taxels_of_the_palm + 8, palm]) in data


def test_an_unknown_protocol_is_rejected_with_the_known_ones(capsys):
    assert "expected taxel or original, found 'modbus'" in run_refused_command(
        capsys, "emulate", "--protocol", "modbus"
    )
