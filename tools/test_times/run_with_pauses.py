"""Run a command while its processes pause at random, as on a busy machine: finds tests that depend on real time.

python tools/test_times/run_with_pauses.py --seed 1 -- .venv/bin/python -m pytest -q -n 2 host/tests/link

In each period a random half of the processes stops for a random time (SIGSTOP, SIGCONT). A test that fails here and
passes without pauses measures the load of the machine instead of the behaviour of the code. Needs Linux (/proc).
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path


def list_processes(session: int) -> list[int]:
    """Return the ids of the processes in a session (`setsid`), except its leader, whose process id is `session`."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rpartition(")")[2].split()
        except OSError:  # the process has ended
            continue
        # Fields after the name of the process (proc(5)): state, parent, process group, session.
        if int(fields[3]) == session and int(path.parent.name) != session:
            found.append(int(path.parent.name))
    return found


def send(number: signal.Signals, processes: list[int]) -> None:
    """Send a signal to each of the processes that still exists."""
    for process in processes:
        try:
            os.kill(process, number)
        except ProcessLookupError:
            continue


def main() -> int:
    """Run the command with random pauses of its processes and return its exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seed", type=int, default=1, help="seed of the pauses")
    parser.add_argument("--period-s", type=float, default=1.5, help="mean time between two pauses, seconds")
    parser.add_argument("--pause-s", type=float, default=0.6, help="longest pause, seconds")
    parser.add_argument("command", nargs="+", help="command and its arguments, after --")
    options = parser.parse_args()
    rng = random.Random(options.seed)
    try:
        program = subprocess.Popen(options.command, start_new_session=True)
    except OSError as error:
        parser.error(f"{options.command[0]}: {error.strerror}; state a program and its arguments after --")
    pauses = 0
    try:
        while program.poll() is None:
            time.sleep(rng.uniform(0.5, 1.5) * options.period_s)
            processes = [process for process in list_processes(program.pid) if rng.random() < 0.5]
            send(signal.SIGSTOP, processes)
            try:
                time.sleep(rng.uniform(0.2, 1.0) * options.pause_s)
            finally:  # no process may remain stopped after Ctrl-C
                send(signal.SIGCONT, processes)
            pauses += 1
    except KeyboardInterrupt:
        send(signal.SIGTERM, [*list_processes(program.pid), program.pid])
        return 130
    print(f"{pauses} pauses, seed {options.seed}", file=sys.stderr)
    return program.returncode


if __name__ == "__main__":
    sys.exit(main())
