"""A command that a service manager ends with SIGTERM ends its child processes and removes its temporary files."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

TIMEOUT_S = 60.0

# Programs of the tests: each prints "waiting" when SIGTERM may be sent.
WAITING_IN_C = """
import ctypes, sys
from taxel.cli.termination import interrupted_by_sigterm
with interrupted_by_sigterm(grace_s=0.2):
    mutex, library = ctypes.create_string_buffer(64), ctypes.CDLL(None)
    library.pthread_mutex_lock(mutex)
    print("waiting", flush=True)
    library.pthread_mutex_lock(mutex)  # never returns, and no signal interrupts it
"""
HOLDING_THE_LOCK = WAITING_IN_C.replace("ctypes.CDLL(None)", "ctypes.PyDLL(None)").replace(
    "from taxel", "from taxel.cli import termination; termination.LOCKED_S = 1; from taxel"
)
CLEANING_UP = """
import time
from taxel.cli.termination import interrupted_by_sigterm
with interrupted_by_sigterm(grace_s=0.05):
    try:
        print("waiting", flush=True)
        time.sleep(60)
    except KeyboardInterrupt:
        print("cleaning", flush=True)
        time.sleep(SECONDS)
        print("cleaned", flush=True)
"""


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


def start_program(text):
    """Start a Python program, wait until it prints "waiting", and return its process."""
    process = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "waiting\n"
    return process


def test_sigterm_ends_a_process_that_waits_in_a_library():
    """The main thread runs no Python code, so another thread ends the process after `grace_s`."""
    process = start_program(WAITING_IN_C)
    time.sleep(0.5)  # until the program has entered the call
    process.send_signal(signal.SIGTERM)
    assert process.wait(TIMEOUT_S) == 128 + signal.SIGTERM


def test_sigterm_ends_a_process_whose_library_holds_the_lock_of_the_interpreter():
    """No thread can run Python code, so an alarm of the kernel (SIGALRM) ends the process after `LOCKED_S`."""
    process = start_program(HOLDING_THE_LOCK)
    time.sleep(0.5)  # until the program has entered the call
    process.send_signal(signal.SIGTERM)
    assert process.wait(TIMEOUT_S) == -signal.SIGALRM


def test_a_process_that_cleans_up_after_sigterm_is_not_ended():
    process = start_program(CLEANING_UP.replace("SECONDS", "0.3"))
    process.send_signal(signal.SIGTERM)
    assert process.communicate(timeout=TIMEOUT_S) == ("cleaning\ncleaned\n", None)
    assert process.returncode == 0


def test_a_second_sigterm_ends_a_process_at_once():
    process = start_program(CLEANING_UP.replace("SECONDS", "60"))
    process.send_signal(signal.SIGTERM)
    assert process.stdout is not None
    assert process.stdout.readline() == "cleaning\n"
    process.send_signal(signal.SIGTERM)
    assert process.wait(TIMEOUT_S) == 128 + signal.SIGTERM
