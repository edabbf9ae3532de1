"""Stimulus files: the format, and the refusal of invalid values by the writer and by the emulator."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from taxel.link import LinkError, run_emulator, write_stimulus

HEADER = struct.Struct("<8sIIII")  # magic, version, kind, number of taxels, reserved


def make_stimulus_bytes(records, taxels=64, kind=0, version=1, magic=b"TAXELSTM"):
    """Make the content of a stimulus file. records: (time in s, value of every taxel). kind: 0 force, 1 counts."""
    body = b"".join(struct.pack("<d", time) + np.full(taxels, value, "<f4").tobytes() for time, value in records)
    return HEADER.pack(magic, version, kind, taxels, 0) + body


@given(
    values=hnp.arrays(
        np.float32, st.tuples(st.integers(0, 5), st.integers(1, 30)), elements=st.floats(0, 65535, width=32)
    ),
    kind=st.sampled_from(["force", "counts"]),
)
def test_a_stimulus_file_contains_a_header_and_one_record_per_time(tmp_path_factory, values, kind):
    path = tmp_path_factory.mktemp("stimulus") / "a.stm"
    times = np.arange(len(values)) * 0.25
    write_stimulus(path, times, values, kind)
    data = path.read_bytes()
    count, taxels = values.shape
    assert HEADER.unpack(data[:24]) == (b"TAXELSTM", 1, {"force": 0, "counts": 1}[kind], taxels, 0)
    records = np.frombuffer(data[24:], [("time", "<f8"), ("values", "<f4", (taxels,))])
    assert len(records) == count
    assert np.array_equal(records["time"], times)
    assert np.array_equal(records["values"], values)


@pytest.mark.parametrize(
    ("times", "values"),
    [
        ([0.0], np.zeros(64)),
        ([0.0], 0.0),
        ([0.0], np.zeros((1, 2, 3))),
        (0.0, np.zeros((1, 3))),
        ([[0.0]], np.zeros((1, 3))),
        ([0.0, 1.0], np.zeros((1, 3))),
        ([], np.zeros((1, 3))),
    ],
    ids=["values 1-D", "values 0-D", "values 3-D", "time 0-D", "times 2-D", "too few values", "no times"],
)
def test_times_and_values_of_inconsistent_shapes_are_refused(tmp_path, times, values):
    with pytest.raises(ValueError):
        write_stimulus(tmp_path / "a.stm", times, values)
    assert not (tmp_path / "a.stm").exists()


@pytest.mark.parametrize("value", [-1e-9, -1.0, np.nan, np.inf, -np.inf, 1e39])
def test_a_value_that_is_negative_or_not_finite_is_refused(tmp_path, value):
    with pytest.raises(ValueError):
        write_stimulus(tmp_path / "a.stm", [0.0], [[0.0, value]])
    assert not (tmp_path / "a.stm").exists()


@pytest.mark.parametrize("times", [[-1.0, 0.0], [1.0, 0.5], [0.0, np.nan], [np.nan, 1.0], [0.0, np.inf]])
def test_decreasing_or_non_finite_times_are_refused(tmp_path, times):
    with pytest.raises(ValueError):
        write_stimulus(tmp_path / "a.stm", times, np.zeros((2, 3)))
    assert not (tmp_path / "a.stm").exists()


def test_an_unknown_kind_is_refused(tmp_path):
    with pytest.raises(ValueError, match="kind"):
        write_stimulus(tmp_path / "a.stm", [0.0], [[1.0]], kind="pressure")


INVALID_STIMULI = {  # case: (file content, regular expression of the error)
    "another format": (b"other", "starts with TAXELSTM"),
    "another version": (make_stimulus_bytes([], version=2), "version or kind"),
    "another kind": (make_stimulus_bytes([], kind=3), "version or kind"),
    "another number of taxels": (make_stimulus_bytes([], taxels=63), "expected values for 64 taxels, found 63"),
    "decreasing time": (make_stimulus_bytes([(0.01, 1), (0.02, 1), (0.01, 1)]), "earlier than the record before"),
    "NaN time": (make_stimulus_bytes([(0.01, 1), (float("nan"), 1)]), "time of a record is not a number"),
    "negative": (make_stimulus_bytes([(0.01, 1), (0.02, -1)]), "negative or not finite"),
    "NaN value": (make_stimulus_bytes([(0.01, float("nan"))]), "negative or not finite"),
    "truncated": (make_stimulus_bytes([(0.01, 1), (0.02, 1)])[:-1], "ends inside a record"),
}


@pytest.mark.parametrize("name", INVALID_STIMULI)
def test_the_emulator_refuses_an_invalid_stimulus_with_one_error_line(tmp_path, small_world, name):
    content, message = INVALID_STIMULI[name]
    path = tmp_path / "a.stm"
    path.write_bytes(content)
    with pytest.raises(LinkError, match=message) as caught:
        run_emulator(small_world, tmp_path / "a.bin", 0.1, stimulus=path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_emulator_accepts_a_stimulus_without_records(tmp_path, small_world):
    write_stimulus(tmp_path / "a.stm", [], np.zeros((0, 64)))
    assert run_emulator(small_world, tmp_path / "a.bin", 0.1, stimulus=tmp_path / "a.stm")["virtual_seconds"] == 0.1
