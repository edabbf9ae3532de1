"""Joint angles over time: interpolation, limits of a live source, and files."""

import math
from pathlib import Path

import numpy as np
import pytest

from taxel.hand.joint_history import (
    JointFileError,
    JointFileWriter,
    JointHistory,
    NoJointAnglesError,
    read_joint_file,
)
from taxel.output import LiveOutput

NAMES = ("a", "b")


def make_history() -> JointHistory:
    """Make a history with samples at 1, 2 and 3 s; the angles equal the time and minus the time."""
    history = JointHistory(NAMES, "source")
    for time_s in (1.0, 2.0, 3.0):
        history.add(time_s, np.array([time_s, -time_s]))
    return history


def test_angles_are_interpolated_between_samples_and_constant_outside() -> None:
    history = make_history()
    for time_s, expected in ((1.25, 1.25), (0.0, 1.0), (9.0, 3.0), (2.0, 2.0)):
        history.select_time(time_s)
        np.testing.assert_allclose(history(), [expected, -expected])


def test_error_of_an_empty_history_names_its_source() -> None:
    with pytest.raises(NoJointAnglesError, match=r"^/joints: no joint angles have arrived"):
        JointHistory(NAMES, "/joints")()


def test_sample_that_is_not_finite_is_ignored() -> None:
    history = make_history()
    history.add(4.0, np.array([math.nan, 0.0]))
    assert history.last_s == 3.0


def test_live_history_keeps_a_limited_number_of_samples() -> None:
    history = JointHistory(NAMES, "source", max_samples=10)
    for index in range(1000):
        history.add(float(index), np.zeros(2))
    assert 10 <= len(history) <= 20  # the oldest 10 samples are removed if more than 20 are stored
    assert history.last_s == 999.0


def test_silent_live_source_is_reported_once() -> None:
    history = make_history()
    lines: list[str] = []
    history.is_live, history.on_silence = True, lines.append
    history.select_time(1.0)
    history.select_time(2.0)
    assert len(lines) == 1
    assert lines[0].startswith("source: no joint angles for 0.5 s")


def test_written_angles_are_read_back_up_to_rounding(tmp_path: Path) -> None:
    path = tmp_path / "x.joints.csv"
    writer = JointFileWriter(LiveOutput(path, overwrite=False), NAMES)
    angles = np.array([[0.1, 1 / 3], [-0.7, 1e-9]])
    for time_s, row in zip((0.125, 0.375), angles, strict=True):
        writer.write(time_s, row)
    writer.close()
    history = read_joint_file(path, NAMES)
    np.testing.assert_allclose([history.interpolate(0.125), history.interpolate(0.375)], angles, atol=1e-15)


def test_columns_of_a_file_may_have_another_order_than_the_joints(tmp_path: Path) -> None:
    path = tmp_path / "joints.csv"
    path.write_text("a,time_s,b\n1,0.5,2\n")
    np.testing.assert_array_equal(read_joint_file(path, ("b", "a")).interpolate(0.5), [2.0, 1.0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: expected a column time_s"),
        ("time_s,a\n1,2\n", "line 1: expected a column b"),
        ("time_s,a,b,c\n1,2,3,4\n", "line 1: expected the joints of the robot, found 'c'"),
        ("time_s,a,b\n", "expected at least one line"),
        ("time_s,a,b\n1,2\n", "line 2: expected 3 columns, found 2"),
        ("time_s,a,b\n1,x,3\n", "line 2, a: expected a finite number, found 'x'"),
        ("time_s,a,b\n1,2,nan\n", "line 2, b: expected a finite number"),
        ("time_s,a,b\n1,2,3\n1,2,3\n", "line 3, time_s: expected more than 1"),
    ],
)
def test_invalid_file_raises_a_one_line_error_that_names_the_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "joints.csv"
    path.write_text(text)
    with pytest.raises(JointFileError) as error:
        read_joint_file(path, NAMES)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_missing_file_raises_a_one_line_error(tmp_path: Path) -> None:
    with pytest.raises(JointFileError, match="a readable CSV file"):
        read_joint_file(tmp_path / "none.csv", NAMES)
