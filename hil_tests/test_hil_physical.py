"""The suite with the drivers of physical rigs, on ports that an emulated bench provides (fake_dev/)."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from hil_tests.fake_dev.bench import FakeBench, build_shim, has_multicast
from hil_tests.harness.fault_cases import CASES
from hil_tests.harness.rig_file import load_rig
from taxel.hand import load_hand
from taxel.hand.world import format_world
from taxel.link.virtual import VirtualWorld

# Half a minute of real time, in which other tests must not take all the processor time.
pytestmark = pytest.mark.slow

REPOSITORY = Path(__file__).parent.parent
CAN_URL = f"can:udp:239.74.163.2:{40000 + os.getpid() % 20000}"
"""A port of this process: parallel test runs on one machine must not receive each other's frames."""
SUITES = ("test_hil_boards.py", "test_hil_i2c.py", "test_hil_stream.py", "test_hil_can.py", "test_hil_fault_cases.py")


@pytest.fixture(scope="module")
def output(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Output of pytest with the suites `SUITES` on the emulated bench."""
    folder = tmp_path_factory.mktemp("bench")
    socket_path, has_can = folder / "i2c.sock", has_multicast()
    with VirtualWorld(format_world(load_hand("original")), "pty") as world:
        rig = folder / "bench.toml"
        rig.write_text(
            'name = "fake bench"\nhand = "original"\n'
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


def read_row(output: str, suite: str) -> tuple[int, int, int]:
    """Read the numbers of passed, failed and not possible tests of a test module from the table that pytest printed."""
    found = re.search(rf"^{suite} +(\d+) +(\d+) +(\d+)", output, re.MULTILINE)
    assert found, output[-3000:]
    return int(found[1]), int(found[2]), int(found[3])


@pytest.mark.parametrize("suite", ["hil_boards", "hil_i2c", "hil_stream"])
def test_suites_pass_with_the_drivers_of_physical_rigs(output: str, suite: str) -> None:
    passed, failed, _ = read_row(output, suite)
    assert failed == 0, output[-5000:]
    assert passed >= 5


def test_can_suite_passes_on_a_multicast_channel(output: str) -> None:
    if not has_multicast():
        pytest.skip("CAN between processes needs multicast, which this machine does not deliver to itself")
    passed, failed, not_possible = read_row(output, "hil_can")
    assert failed == 0, output[-5000:]
    assert passed >= 4  # the suite has run, not only been skipped
    assert not_possible > 0  # tests with CAN faults, which this bench cannot inject


def test_tests_that_a_rig_cannot_run_are_reported_with_the_missing_ability(output: str) -> None:
    assert read_row(output, "hil_fault_cases") == (0, 0, len(CASES))
    assert "lacks known raw counts, fault injection" in output
    assert "rig: " in output


def test_example_of_a_physical_rig_file_is_valid() -> None:
    description = load_rig(str(REPOSITORY / "hil_tests" / "rigs" / "physical.example.toml"))
    assert not description.is_virtual
    assert set(description.devices) == {"clock", "uart", "i2c", "can", "power", "stimulus"}
