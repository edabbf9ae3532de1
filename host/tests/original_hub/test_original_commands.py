"""Commands with an original hub: record, replay, monitor, convert, and the refusal of commands for other firmware."""

import json
from pathlib import Path

import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from taxel.hand import load_hand
from taxel.link import LinkError
from taxel.recording import GraspDataset
from taxel.skin import Skin, open_skin
from taxel.skin.recorder import open_recorded
from taxel_tools.open_wire import open_hub_link, open_wire

URL = "emulator:?protocol=original&speed=max&seed=5&duration_s=20"


def count_frames(skin: Skin) -> int:
    return sum(1 for _ in skin)


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record an emulated original hub with `taxel record`; return the capture file."""
    path = tmp_path_factory.mktemp("original") / "skin.bin"
    assert run_taxel("record", URL, "--hand", "original", "--seconds", "10", "--out", str(path)) == 0
    return path


def test_recording_contains_its_hand_and_is_read_without_the_option(capture: Path) -> None:
    with open_skin(f"file:{capture}") as skin:
        assert skin.hand == load_hand("original")
        frames = list(skin)
        assert {frame.address for frame in frames} == {board.address for board in skin.hand.boards}
        assert sum(count.missing for count in skin.losses.boards.values()) == 0


def test_replay_summarises_the_recording_without_losses_at_5_cycles_per_second(
    capture: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_taxel("replay", str(capture), "--json") == 0
    summary = json.loads(capsys.readouterr().out)
    assert summary["hand"] == "original"
    assert summary["frames_lost_on_wire"] == 0
    assert all(5.0 < board["rate_hz"] < 5.5 and board["missing"] == 0 for board in summary["boards"])


def test_monitor_shows_all_17_boards_of_an_emulated_original_hub_without_losses(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run_taxel("monitor", "emulator:?protocol=original&hand=original", "--seconds", "2", "--json") == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert lines[-1]["boards_streaming"] == 17
    assert lines[-1]["missing"] == 0


def test_recording_converts_to_a_grasp_dataset_with_finite_times(capture: Path, tmp_path: Path) -> None:
    path = tmp_path / "skin.h5"
    assert run_taxel("convert", str(capture), str(path), "--object", "cylinder", "--approach", "side_1") == 0
    with GraspDataset(path) as data:
        (grasp,) = data
        assert grasp.raw_counts.shape[1] == 1037
        assert np.isfinite(grasp.timestamp).all()


def test_mcap_recording_contains_all_frames(tmp_path: Path) -> None:
    pytest.importorskip("mcap")
    path = tmp_path / "skin.mcap"
    with open_recorded(URL, path, "original") as skin:
        recorded_frames = count_frames(skin)
    with open_skin(f"file:{path}") as skin:
        assert count_frames(skin) == recorded_frames


@pytest.mark.parametrize("url", ["serial:///dev/ttyUSB0?protocol=original", "emulator:?protocol=original"])
@pytest.mark.parametrize(
    "arguments",
    [
        ["scan", "URL"],
        ["bench", "URL"],
        ["bench", "URL", "--serial", "X"],
        ["provision", "URL"],
        ["provision", "URL", "--new-address", "0x30"],
        ["flash", "URL"],
        ["flash", "URL", "image.cyacd", "--all"],
    ],
)
def test_command_that_needs_the_projects_firmware_is_refused_with_a_one_line_message(
    arguments: list[str], url: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    line = run_refused_command(capsys, *(url if argument == "URL" else argument for argument in arguments))
    assert "is an original hub, which takes no commands" in line


def test_connections_of_the_flashing_tools_are_refused() -> None:
    for connect in (open_wire, open_hub_link):
        with pytest.raises(LinkError, match="this command needs the project's own firmware"), connect(f"{URL}&seed=1"):
            pass
