"""Poses of an object over time, and their file."""

import numpy as np
import pytest

from taxel.hand.transforms import from_rotation_vector, to_quaternion
from taxel.twin.errors import TwinInputError
from taxel.twin.simulated.object_history import ObjectHistory, read_object_poses

HEADING = "time_s,x_m,y_m,z_m,qw,qx,qy,qz\n"


@pytest.fixture
def write(tmp_path):
    """A function that writes a file of poses and returns its path."""

    def write_text(text):
        path = tmp_path / "object.csv"
        path.write_text(text)
        return path

    return write_text


def test_poses_are_interpolated_between_samples():
    history = ObjectHistory("object")
    turned = to_quaternion(from_rotation_vector([0.0, 0.0, 0.4]))
    history.add(10.0, np.array([0.1, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    history.add(11.0, np.array([0.3, 0.0, 0.0]), turned)
    found = history.find(10.5)
    assert found[:3, 3] == pytest.approx([0.2, 0.0, 0.0])
    assert np.allclose(found[:3, :3], from_rotation_vector([0.0, 0.0, 0.2])[:3, :3])


def test_a_pose_is_unknown_a_second_after_the_last_sample():
    """The same holds a second before the first sample.

    If the times of frames have another clock than the samples, the latest sample is used for every time.
    """
    history = ObjectHistory("object")
    history.add(10.0, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
    assert history.find(10.9) is not None
    assert history.find(11.1) is None
    assert history.find(8.9) is None
    history.uses_stream_time = False
    assert history.find(500.0) is not None


def test_samples_that_are_late_or_not_finite_are_ignored():
    history = ObjectHistory("object")
    for time_s, x in ((10.0, 0.1), (9.0, 0.2), (11.0, np.nan)):
        history.add(time_s, np.array([x, 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0]))
    assert len(history) == 1
    assert history.find(10.0)[0, 3] == 0.1


def test_a_file_is_read(write):
    history = read_object_poses(write(HEADING + "0.0,0.1,0.2,0.3,1,0,0,0\n0.5,0.1,0.2,0.4,0.7071,0,0,0.7071\n"))
    assert len(history) == 2
    assert history.find(0.25)[2, 3] == pytest.approx(0.35)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,x_m\n0,0\n", r"line 1: expected the columns time_s,x_m,.*, found no column y_m"),
        ("", r"line 1: expected the columns .* found no heading"),
        (HEADING, r"expected at least one pose, found none"),
        (HEADING + "0,0,0,zero,1,0,0,0\n", r"line 2: z_m: expected a finite number, found 'zero'"),
        (HEADING + "0,0,0,inf,1,0,0,0\n", r"line 2: z_m: expected a finite number"),
        (HEADING + "0,0,0\n", r"line 2: expected 8 entries, found 3"),
        (HEADING + "0,0,0,0,2,0,0,0\n", r"line 2: expected a quaternion of length 1, found 2; correct qw"),
        (HEADING + "1,0,0,0,1,0,0,0\n1,0,0,0,1,0,0,0\n", r"line 3: time_s: expected a time after the line before"),
    ],
)
def test_an_invalid_file_is_refused_with_its_line(write, text, message):
    with pytest.raises(TwinInputError, match=message):
        read_object_poses(write(text))


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(TwinInputError, match="expected a readable CSV file, found No such file"):
        read_object_poses(tmp_path / "none.csv")
