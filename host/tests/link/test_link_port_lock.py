"""One program at a time uses a serial port or an I2C adapter; the second one names the process of the first."""

import os
import re
import select
import subprocess
import sys
import types

import pytest

from host.tests.command_line import run_refused_command
from taxel.link import PortBusyError, SerialLink, open_i2c, port_lock

HOLD = """
import sys
from taxel.link import open_link
link = open_link(sys.argv[1])
print("open", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def holder():
    """Function that starts a process, waits until the process has opened a URL, and returns the process."""
    processes = []

    def start(url, code=HOLD):
        process = subprocess.Popen(
            [sys.executable, "-c", code, url], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        processes.append(process)
        assert process.stdout.readline() == "open\n"
        return process

    yield start
    for process in processes:
        process.stdin.close()
        process.wait(timeout=20)
        process.stdout.close()


def test_second_program_on_a_port_ends_with_one_error_line_that_names_the_first_process(terminal, holder, capsys):
    process = holder(f"serial://{terminal.name}")
    line = run_refused_command(capsys, "monitor", terminal.name)
    pattern = rf"taxel: {terminal.name}: is used by process {process.pid} \(\S+\); end that program first"
    assert re.fullmatch(pattern, line)


def test_refused_program_takes_no_bytes_and_changes_no_settings(terminal):
    link = SerialLink(terminal.name, 115200)
    os.write(terminal.master, b"bytes of the first program")
    with pytest.raises(PortBusyError):
        SerialLink(terminal.name, 9600)
    assert link.read(1.0).data == b"bytes of the first program"
    assert link._port.baudrate == 115200
    link.close()


def test_port_is_free_after_its_program_was_killed(terminal, holder):
    process = holder(f"serial://{terminal.name}")
    process.kill()
    process.wait(timeout=20)
    SerialLink(terminal.name).close()


def test_port_is_locked_under_each_of_its_names(terminal, tmp_path):
    name = tmp_path / "by-id"
    name.symlink_to(terminal.name)
    link = SerialLink(str(name))
    with pytest.raises(PortBusyError, match=f"is used by process {os.getpid()}"):
        SerialLink(terminal.name)
    link.close()
    SerialLink(terminal.name).close()


def test_port_that_the_kernel_refuses_is_reported_as_busy(terminal, monkeypatch):
    def refuse(*arguments, **options):
        raise OSError(16, "Device or resource busy")

    monkeypatch.setattr("serial.serial_for_url", refuse)
    with pytest.raises(PortBusyError, match="is used by"):
        SerialLink(terminal.name)


def test_second_program_on_an_i2c_adapter_is_refused(tmp_path, monkeypatch, holder):
    adapter = tmp_path / "i2c-7"
    adapter.touch()

    class FileBus:
        """A file in place of an adapter: locks do not depend on the kind of a file."""

        def __init__(self, path):
            self.fd = os.open(path, os.O_RDWR)

        def close(self):
            os.close(self.fd)

    monkeypatch.setitem(sys.modules, "smbus2", types.SimpleNamespace(SMBus=FileBus))
    lock = "import fcntl, sys; f = open(sys.argv[1]); fcntl.flock(f, fcntl.LOCK_EX); print('open', flush=True)"
    process = holder(str(adapter), f"{lock}; sys.stdin.read()")
    with pytest.raises(PortBusyError, match=f"i2c-7: is used by process {process.pid}"):
        open_i2c(str(adapter))
    process.stdin.close()
    process.wait(timeout=20)
    bus = open_i2c(str(adapter))
    with pytest.raises(PortBusyError):
        open_i2c(str(adapter))
    bus.close()


def test_holder_without_a_lock_is_found_by_its_open_file(tmp_path, holder):
    path = tmp_path / "port"
    path.touch()
    process = holder(str(path), "import sys; f = open(sys.argv[1]); print('open', flush=True); sys.stdin.read()")
    assert port_lock.find_holder(str(path))[0] == process.pid
    assert port_lock.find_holder(str(tmp_path / "missing")) is None


def test_other_openings_are_refused_except_on_a_pseudo_terminal(terminal, monkeypatch):
    """On a pseudo-terminal, the refusal of the kernel would outlive a killed program."""
    requests = []
    monkeypatch.setattr(port_lock.fcntl, "ioctl", lambda descriptor, request: requests.append(request))
    port_lock.refuse_other_openings(0, terminal.name)
    assert not requests
    port_lock.refuse_other_openings(0, "/dev/ttyUSB0")
    assert requests == [port_lock.termios.TIOCEXCL]
    assert not select.select([terminal.master], [], [], 0.0)[0]
