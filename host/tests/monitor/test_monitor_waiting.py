"""A port that disappears: monitor and `record --wait` wait and continue, and all views show a banner."""

import io
import json
import re
import subprocess
import sys
import time
from pathlib import Path

import pytest
from rich.console import Console

from host.tests.command_line import run_taxel
from host.tests.monitor.restartable_hub import RestartableHub, UnpluggableHub
from taxel.errors import TaxelError
from taxel.monitor import Screen, SkinMonitor, open_paced
from taxel.monitor.summary_text import format_line
from taxel.monitor.web.page import format_status_html
from taxel.skin import open_skin
from taxel.stream.hub_client import ATTEMPTS

TIMEOUT_S = 40.0
TAXEL = str(Path(sys.executable).with_name("taxel"))


@pytest.fixture
def hub(tmp_path):
    """A running hub that a test can stop, start and freeze."""
    restartable = RestartableHub(tmp_path)
    yield restartable
    restartable.stop()


@pytest.fixture
def cable():
    """A running hub whose cable a test can unplug and plug in again."""
    unpluggable = UnpluggableHub()
    yield unpluggable
    unpluggable.close()


def watch_until(skin, monitor, condition):
    """Process frames until a reading fulfils the condition; return the reading."""
    deadline = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline:
        monitor.take(skin.poll(0.02), time.monotonic())
        reading = monitor.read(time.monotonic())
        if condition(reading):
            return reading
        time.sleep(0.02)
    raise AssertionError(format_line(reading))


def test_monitor_waits_for_a_restarted_hub_and_resumes(hub):
    with open_paced(hub.url, "flat8") as skin:
        monitor = SkinMonitor(skin, samples=5)
        watch_until(skin, monitor, lambda reading: reading.is_measuring)
        # The uptime of the hub reveals the restart if the first message of the restarted hub is lost. The first hub
        # therefore runs longer than the host needs to open the port again on a slow machine.
        first_end_s = time.monotonic() + 4.0
        watch_until(skin, monitor, lambda reading: time.monotonic() > first_end_s)
        hub.stop()
        before_s = time.time()
        reading = watch_until(skin, monitor, lambda reading: reading.no_data_since_s is not None)
        assert abs(reading.no_data_since_s - before_s) < 1.5
        assert "the monitor continues when the port is back" in reading.advice
        hub.start()
        reading = watch_until(skin, monitor, lambda reading: reading.boards_streaming == 1)
        assert reading.no_data_since_s is None
        assert (reading.hub_restarts, reading.lost_on_wire) == (1, 0)


def test_skin_that_does_not_wait_raises_an_error_if_its_port_disappears(hub):
    with open_skin(hub.url, "flat8") as skin:
        next(iter(skin))
        hub.stop()
        with pytest.raises(TaxelError, match="the port is gone"):
            for _ in skin:
                pass
        hub.start()  # the fixture stops a running hub


def test_frames_that_a_running_hub_sent_to_an_unplugged_cable_are_lost_on_the_wire(cable):
    with open_paced(cable.url, "flat8") as skin:
        monitor = SkinMonitor(skin, samples=5)
        watch_until(skin, monitor, lambda reading: reading.is_measuring)
        cable.unplug()
        watch_until(skin, monitor, lambda reading: reading.no_data_since_s is not None)
        cable.plug()
        reading = watch_until(skin, monitor, lambda reading: reading.boards_streaming == 1)
        assert reading.hub_restarts == 0
        assert len(skin.reconnection.gaps) == 1
        # More than 100 frames per second are lost for two seconds; they are also missing frames of their board.
        assert reading.lost_on_wire > 50
        assert reading.missing > 50
        assert skin.hub.attempts == ATTEMPTS  # a single attempt per call applies to the reconnection only


def start_recording(url, path, *options):
    """Start `taxel record`, and wait until its file contains frames."""
    process = subprocess.Popen(
        [TAXEL, "record", url, "--hand", "flat8", "--out", path, *options],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + TIMEOUT_S
    while not path.exists() or path.stat().st_size < 20_000:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return process


@pytest.mark.parametrize("is_restarted", [True, False])
def test_recording_continues_in_the_same_file_and_states_the_gap(capsys, hub, cable, tmp_path, is_restarted):
    path = tmp_path / "skin.bin"
    process = start_recording(hub.url if is_restarted else cable.url, path, "--wait", "--seconds", "4")
    (hub.stop if is_restarted else cable.unplug)()
    time.sleep(1.0)
    (hub.start if is_restarted else cable.plug)()
    output, errors = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 0, errors
    assert re.search(r"gaps: 1 without the port, \d\.\d s in total \(\d\d:\d\d:\d\d to \d\d:\d\d:\d\d\)", output)
    assert "waiting for it since" in errors
    assert "is back after" in errors
    assert ("the hub restarted 1 time" in output) == is_restarted
    assert run_taxel("replay", path, "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert f"frames: {summary['frames_received']} received, {summary['frames_lost_on_wire']} lost" in output
    assert (summary["frames_lost_on_wire"] > 0) != is_restarted
    assert 3.9 < summary["seconds"] < 6.0


def test_recording_without_wait_ends_with_an_error_and_a_summary_if_the_port_disappears(hub, tmp_path):
    process = start_recording(hub.url, tmp_path / "skin.bin")
    hub.stop()
    output, errors = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 1
    assert "the port is gone" in errors
    assert "frames:" in output
    hub.start()  # the fixture stops a running hub


def test_recording_of_a_silent_hub_ends_at_the_requested_duration(hub, tmp_path):
    process = start_recording(hub.url, tmp_path / "skin.bin", "--seconds", "2")
    hub.freeze()
    output, errors = process.communicate(timeout=TIMEOUT_S)
    assert process.returncode == 0, errors
    assert "frames:" in output


def format_canvas(canvas):
    """Return the text of a canvas on a terminal."""
    console = Console(file=io.StringIO(), width=80)
    console.print(canvas)
    return console.file.getvalue()


def test_all_views_show_the_time_of_the_last_frame_instead_of_outdated_figures(fake_skin):
    skin = fake_skin("flat8")
    skin.pass_time(1.0)
    assert "no errors" in format_line(skin.read())
    skin.now_s += 60.0
    reading = skin.read()
    since = time.strftime("%H:%M:%S", time.localtime(time.time() - 60.0))[:-1]  # to ten seconds: the test takes time
    for text in (
        format_line(reading),
        format_status_html(reading, "fake"),
        format_canvas(Screen(skin.hand, "fake", 150.0).draw(reading, 80, 24, False)),
    ):
        assert f"no data since {since}" in text
        assert "scans/s" not in text
        assert "no errors" not in text
    assert reading.as_dict()["no_data_since"].endswith("+00:00")


def test_missing_data_is_reported_after_three_scan_periods_at_a_low_scan_rate(fake_skin):
    skin = fake_skin("flat8", rate_hz=0.2)  # period 5 s
    skin.pass_time(1.0)
    skin.now_s += 10.0
    assert skin.read().no_data_since_s is None
    skin.now_s += 10.0
    assert skin.read().no_data_since_s is not None
