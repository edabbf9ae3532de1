"""A skin without a hub in real time: an unmodified smbus2 and the hub of this process on a fake /dev/i2c-7."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from hil_tests.fake_dev.bench import FakeBench, build_shim
from taxel.hand import load_hand
from taxel.hand.world import format_world
from taxel.link.virtual import VirtualWorld

REPOSITORY = Path(__file__).parent.parent
HAND = "rig4"
URL = "i2c:///dev/i2c-7?boards=auto&scl_hz=400000"
SUITES = ("test_hil_boards.py", "test_hil_stream.py")


@contextmanager
def open_bench(folder: Path, hand: str) -> Iterator[dict[str, str]]:
    """Serve a fake I2C adapter with the boards of a hand and no hub.

    Yields the environment variables of programs that use the adapter as /dev/i2c-7.
    """
    with VirtualWorld(format_world(load_hand(hand)), "none") as world:
        world.inject("hub_unplug")
        world.run(0.2)
        environment = os.environ | {
            "LD_PRELOAD": str(build_shim(folder)),
            "FAKE_I2C": f"/dev/i2c-7={folder / 'i2c.sock'}",
        }
        environment.pop("PYTEST_XDIST_WORKER", None)
        with FakeBench(world, folder / "i2c.sock", is_paced=True):
            yield environment


def run(environment: dict[str, str], *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python with these arguments and environment variables in the repository. Its output is captured."""
    return subprocess.run(
        [sys.executable, *arguments], cwd=REPOSITORY, env=environment, capture_output=True, text=True, timeout=250
    )


RUN_COMMANDS = """
import contextlib, io, json, os, sys
from taxel.cli.main import main

results = []
for arguments, variables in json.loads(sys.argv[1]):
    os.environ.update(variables)
    sys.argv[1:] = arguments
    status, output, errors = 0, io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        try:
            main()
        except SystemExit as end:
            status = end.code or 0
    results.append({"returncode": status, "stdout": output.getvalue(), "stderr": errors.getvalue()})
print(json.dumps(results))
"""
"""Program that runs `taxel` several times, because the start of a process takes longer than a short command."""


def run_commands(environment: dict[str, str], *commands: tuple[list[str], dict[str, str]]) -> list[SimpleNamespace]:
    """Run `taxel` with the arguments and the additional environment variables of each command, in one process.

    Returns `returncode`, `stdout` and `stderr` of each command.
    """
    done = run(environment, "-c", RUN_COMMANDS, json.dumps(commands))
    assert done.returncode == 0, done.stderr
    return [SimpleNamespace(**result) for result in json.loads(done.stdout)]


def test_record_scan_rate_and_monitor_work_without_a_hub(tmp_path: Path) -> None:
    """The commands work on a fake I2C adapter with the four boards of the hand.

    No board has the address 0x70, and an adapter with SMBus commands only is not sufficient: both cause an error.
    """
    boards = load_hand(HAND).boards
    capture = str(tmp_path / "skin.bin")
    with open_bench(tmp_path, HAND) as environment:
        scanned, recorded, rate, watched, silent, replayed, smbus = run_commands(
            environment,
            (["scan", URL, "--json"], {}),
            (["record", URL, "--hand", HAND, "--seconds", "1", "--out", capture], {}),
            (["rate", URL, "--seconds", "1", "--json"], {}),
            (["monitor", URL, "--hand", HAND, "--once", "--baseline-frames", "10"], {}),
            (["record", URL.replace("auto", "0x70"), "--out", str(tmp_path / "x.bin")], {}),
            (["replay", capture], {}),
            (["scan", URL], {"FAKE_I2C_SMBUS_ONLY": "1"}),
        )
    assert [device["address"] for device in json.loads(scanned.stdout)] == sorted(board.address for board in boards)
    assert recorded.returncode == 0, recorded.stderr
    assert "0 lost on the wire" in replayed.stdout
    measured = json.loads(rate.stdout)
    assert len(measured["boards"]) == len(boards)
    assert measured["unexplained"] == 0
    assert watched.returncode == 0, watched.stderr
    assert re.search(r"4/4 boards", watched.stdout)
    assert silent.returncode == 1
    assert silent.stderr.startswith("taxel: /dev/i2c-7: no board answers at 0x70; check power")
    assert smbus.returncode == 1
    assert "SMBus commands only" in smbus.stderr


@pytest.mark.slow
@pytest.mark.parametrize("suite", SUITES)
def test_suites_pass_on_an_adapter_in_real_time(tmp_path: Path, suite: str) -> None:
    """A hardware test suite passes on a rig without a hub, whose link is a fake I2C adapter with emulated boards."""
    rig = tmp_path / "bench.toml"
    rig.write_text(f'name = "fake adapter"\nhand = "original"\n[uart]\ndriver = "serial"\nurl = "{URL}"\n')
    with open_bench(tmp_path, "original") as environment:
        done = run(environment, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rig", str(rig), f"hil_tests/{suite}")
    assert done.returncode == 0, done.stdout[-5000:]
