"""The suite again, on the drivers for real ports: they stand on a fake /dev here, and know nothing of it."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hil_tests.fake_dev.bench import FakeBench, build_shim, multicast_works
from hil_tests.harness.rig_file import load_rig
from taxel.hand import load_hand
from taxel.hand.world import format_world
from taxel.link.virtual import VirtualWorld

REPOSITORY = Path(__file__).parent.parent
CAN_URL = f"can:udp:239.74.163.2:{40000 + os.getpid() % 20000}"
"""One suite's own: two on one machine must not hear each other's joints."""
SUITES = ("test_hil_boards.py", "test_hil_i2c.py", "test_hil_stream.py", "test_hil_can.py", "test_hil_fault_cases.py")


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What pytest says on the fake bench."""
    folder = tmp_path_factory.mktemp("bench")
    socket_path, has_can = folder / "i2c.sock", multicast_works()
    with VirtualWorld(format_world(load_hand("allegro")), "pty") as world:
        rig = folder / "bench.toml"
        rig.write_text(
            'name = "fake bench"\nhand = "allegro"\n'
            f'[uart]\ndriver = "serial"\nurl = "serial://{world.pty_name}"\n'
            '[i2c]\ndriver = "linux"\nbus = "/dev/i2c-7"\n'
            + (f'[can]\ndriver = "python-can"\nurl = "{CAN_URL}"\n' if has_can else "")
        )
        environment = os.environ | {
            "LD_PRELOAD": str(build_shim(folder)),
            "FAKE_I2C": f"/dev/i2c-7={socket_path}",
        }
        environment.pop("PYTEST_XDIST_WORKER", None)
        with FakeBench(world, socket_path, CAN_URL if has_can else None):
            done = subprocess.run(
                [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rig", str(rig)]
                + [f"hil_tests/{suite}" for suite in SUITES],
                cwd=REPOSITORY,
                env=environment,
                capture_output=True,
                text=True,
                timeout=300,
            )
    return done.stdout + done.stderr


def row(outcome: str, suite: str) -> tuple[int, int, int]:
    found = re.search(rf"^{suite} +(\d+) +(\d+) +(\d+)", outcome, re.MULTILINE)
    assert found, outcome[-3000:]
    return int(found[1]), int(found[2]), int(found[3])


@pytest.mark.parametrize("suite", ["hil_boards", "hil_i2c", "hil_stream"])
def test_the_same_tests_pass_on_real_ports(outcome: str, suite: str) -> None:
    passed, failed, _ = row(outcome, suite)
    assert failed == 0, outcome[-5000:]
    assert passed >= 5


def test_the_hand_answers_on_a_real_channel(outcome: str) -> None:
    if not multicast_works():
        pytest.skip("this machine does not carry multicast to itself, over which CAN goes between processes")
    passed, failed, not_possible = row(outcome, "hil_can")
    assert failed == 0, outcome[-5000:]
    assert passed >= 4
    assert not_possible > 0


def test_what_a_rig_cannot_do_is_said_and_not_skipped_in_silence(outcome: str) -> None:
    assert row(outcome, "hil_fault_cases") == (0, 0, 25)
    assert "lacks raw counts that are known, faults injected" in outcome
    assert "rig: " in outcome


def test_the_example_of_a_physical_rig_is_a_rig() -> None:
    description = load_rig(str(REPOSITORY / "hil_tests" / "rigs" / "physical.example.toml"))
    assert not description.is_virtual
    assert set(description.devices) == {"uart", "i2c", "can", "power", "stimulus"}
