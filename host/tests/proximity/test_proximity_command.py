"""`taxel proximity`: calibration with a recording of an emulated plate at known distances, and the estimates."""

import json
import statistics

import numpy as np
import pytest
from typer.testing import CliRunner

from taxel.cli.main import build_app
from taxel.proximity import ProximityCalibration, write_calibration
from taxel.proximity.watch import ProximityWatch, open_watch
from taxel.ros.topics import SkinTopics
from taxel.skin import open_skin
from taxel.skin.recorder import open_recorded
from taxel.stream import TaxelFrame


def invoke(*arguments):
    return CliRunner().invoke(build_app("proximity"), ["proximity", *map(str, arguments)])


@pytest.fixture(scope="module")
def stage(tmp_path_factory):
    """Emulate a plate on a positioning stage in front of one board, and calibrate from the recording.

    Returns the folder (plate.bin, plate.csv, skin.json) and the JSON output of the calibration.
    """
    folder = tmp_path_factory.mktemp("stage")
    result = invoke("emulate", "--out", folder, "--boards", "medial_front_index", "--seed", "5")
    assert result.exit_code == 0, result.output
    arguments = (f"file:{folder}/plate.bin", "--holds", folder / "plate.csv", "--out", folder / "skin.json", "--json")
    result = invoke("calibrate", *arguments)
    assert result.exit_code == 0, result.output
    return folder, json.loads(result.output)


def test_calibrated_signal_of_the_emulated_plate_is_negative_and_vanishes_with_the_distance(stage):
    _, document = stage
    (response,) = document["responses"]
    assert response["kind"] == "medial_front"
    assert response["signal_counts"][0] < -100.0
    assert response["signal_counts"][0] < response["signal_counts"][5] < response["signal_counts"][-1] < 1.0


def test_intervals_of_watch_contain_the_distances_of_the_plate_and_medians_lie_within_half_a_millimetre(stage):
    folder, _ = stage
    result = invoke("watch", f"file:{folder}/plate.bin", "--calibration", folder / "skin.json", "--json")
    assert result.exit_code == 0, result.output
    estimates = [json.loads(line) for line in result.output.splitlines()]
    holds = [line.split(",") for line in (folder / "plate.csv").read_text().splitlines()[1:]]
    checked = 0
    for start, end, board, target, distance in holds:
        if target == "rest" or not 0.5 <= float(distance) <= 5.0:
            continue
        # The estimates of the first second still contain the motion to this distance.
        estimated = [each for each in estimates if float(start) + 1.0 < each["time_s"] < float(end)]
        assert {each["board"] for each in estimated} == {board}
        ranges = [each["distance_mm"] for each in estimated]
        assert all(each["low"] <= float(distance) <= each["high"] for each in ranges)
        assert abs(statistics.median(each["median"] for each in ranges) - float(distance)) < 0.5
        checked += len(estimated)
    assert checked > 50


def test_watch_without_json_prints_the_end_of_the_baseline_and_distances_with_intervals(stage):
    folder, _ = stage
    result = invoke("watch", f"file:{folder}/plate.bin", "--calibration", folder / "skin.json", "--seconds", "25")
    assert result.exit_code == 0, result.output
    assert "baseline complete" in result.output
    assert " mm [" in result.output


def test_calibrate_does_not_replace_an_existing_file(stage):
    folder, _ = stage
    before = (folder / "skin.json").read_bytes()
    arguments = ("--holds", folder / "plate.csv", "--out", folder / "skin.json")
    result = invoke("calibrate", f"file:{folder}/plate.bin", *arguments)
    assert result.exit_code != 0
    assert "expected a new file, found an existing one" in str(result.exception)
    assert (folder / "skin.json").read_bytes() == before


def test_calibration_from_a_recording_without_a_file_of_holds_is_refused(stage):
    folder, _ = stage
    result = invoke("calibrate", f"file:{folder}/plate.bin", "--out", folder / "other.json")
    assert result.exit_code != 0
    assert "needs --holds" in str(result.exception)


def test_proximity_topic_contains_the_distance_of_the_plate(stage):
    folder, _ = stage
    with open_skin(f"file:{folder}/plate.bin") as skin:
        topics = SkinTopics(skin.hand, skin.hub, proximity=open_watch(folder / "skin.json", skin.hand))
        messages = [message for frame in skin for message in topics.take(frame) if message.topic.endswith("/proximity")]
    assert {message.topic for message in messages} >= {"/taxel/medial_front_index/proximity"}
    near = [message.message for message in messages if message.message["present"] > 0.95]
    assert near
    assert all(0.0 < each["distance_m"][0] < 0.02 for each in near)


def test_mcap_recording_contains_the_proximity_topic_of_the_calibrated_board(stage, tmp_path):
    folder, _ = stage
    path = tmp_path / "skin.mcap"
    with open_recorded(f"file:{folder}/plate.bin", path, proximity=folder / "skin.json") as skin:
        for _ in zip(skin, range(4000), strict=False):  # read 4000 frames
            pass
    from mcap.reader import make_reader

    with path.open("rb") as file:
        topics = {channel.topic for _, channel, _ in make_reader(file).iter_messages()}
    assert "/taxel/medial_front_index/proximity" in topics


def run_monitor(folder, *options):
    """Run the monitor on the recording of the plate with the calibration."""
    arguments = ["monitor", f"file:{folder}/plate.bin", "--proximity", str(folder / "skin.json"), *options]
    result = CliRunner().invoke(build_app("monitor"), arguments)
    assert result.exit_code == 0, result.output
    return result.output


def test_monitor_shows_distance_and_board_of_the_nearest_target(stage):
    folder, _ = stage
    output = run_monitor(folder, "--speed", "40")
    assert " mm from medial front index" in output
    assert "repeat the baseline" not in output


def test_json_of_the_monitor_contains_targets_of_calibrated_boards_only(stage):
    folder, _ = stage
    output = run_monitor(folder, "--json", "--speed", "1000")
    boards = [each["board"] for each in json.loads(output.splitlines()[-1])["proximity"]]
    assert "medial_front_index" in boards
    assert "palm" not in boards


@pytest.mark.parametrize("option", ["--boards", "--target", "--distances-mm"])
def test_option_of_live_calibration_is_refused_with_a_file_of_holds(stage, tmp_path, option):
    folder, _ = stage
    arguments = ("--holds", folder / "plate.csv", "--out", tmp_path / "x.json", option, "1")
    result = invoke("calibrate", f"file:{folder}/plate.bin", *arguments)
    assert f"leave out {option}" in str(result.exception)
    assert not (tmp_path / "x.json").exists()


def test_restart_of_the_baseline_discards_the_baseline_and_the_latest_estimates(hand, calibration):
    watch = ProximityWatch(hand, ProximityCalibration("original", {"medial_front": calibration}))
    board = hand.find_board("medial_front_index")
    counts = np.full(board.kind.taxel_count, 3000, np.uint16)
    for number in range(45):  # more than the 40 frames of a baseline
        watch.take(TaxelFrame(board.address, 0, number, 0.05 * number, 0, 0, counts))
    assert watch.latest[board.address].is_ready
    watch.restart_baseline()
    assert watch.progress == 0.0
    assert watch.latest == {}


def test_recording_of_proximity_to_a_capture_file_is_refused_without_creating_the_file(stage, tmp_path, calibration):
    write_calibration(tmp_path / "skin.json", ProximityCalibration("original", {"medial_front": calibration}))
    folder, _ = stage
    with pytest.raises(Exception, match="contains no topics"):
        open_recorded(f"file:{folder}/plate.bin", tmp_path / "x.bin", proximity=tmp_path / "skin.json")
    assert not (tmp_path / "x.bin").exists()
