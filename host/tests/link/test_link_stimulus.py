"""A stimulus file holds what it was given, and what cannot act on a skin is refused before it is written or run."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from taxel.link import LinkError, run_emulator, write_stimulus

HEADER = struct.Struct("<8sIIII")


def raw_stimulus(records, taxels=64, kind=0, version=1, magic=b"TAXELSTM"):
    body = b"".join(struct.pack("<d", time) + np.full(taxels, value, "<f4").tobytes() for time, value in records)
    return HEADER.pack(magic, version, kind, taxels, 0) + body


@given(
    values=hnp.arrays(
        np.float32, st.tuples(st.integers(0, 5), st.integers(1, 30)), elements=st.floats(0, 65535, width=32)
    ),
    kind=st.sampled_from(["force", "counts"]),
)
def test_a_stimulus_file_is_a_header_and_one_record_a_time(tmp_path_factory, values, kind):
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
def test_shapes_that_do_not_fit_are_refused(tmp_path, times, values):
    with pytest.raises(ValueError):
        write_stimulus(tmp_path / "a.stm", times, values)
    assert not (tmp_path / "a.stm").exists()


@pytest.mark.parametrize("value", [-1e-9, -1.0, np.nan, np.inf, -np.inf, 1e39])
def test_a_value_that_is_negative_or_not_finite_is_refused(tmp_path, value):
    with pytest.raises(ValueError):
        write_stimulus(tmp_path / "a.stm", [0.0], [[0.0, value]])
    assert not (tmp_path / "a.stm").exists()


@pytest.mark.parametrize("times", [[-1.0, 0.0], [1.0, 0.5], [0.0, np.nan], [np.nan, 1.0], [0.0, np.inf]])
def test_times_that_go_back_or_are_not_finite_are_refused(tmp_path, times):
    with pytest.raises(ValueError):
        write_stimulus(tmp_path / "a.stm", times, np.zeros((2, 3)))
    assert not (tmp_path / "a.stm").exists()


def test_an_unknown_kind_is_refused(tmp_path):
    with pytest.raises(ValueError, match="kind"):
        write_stimulus(tmp_path / "a.stm", [0.0], [[1.0]], kind="pressure")


BROKEN = {
    "no stimulus": (b"hello", "starts with TAXELSTM"),
    "another version": (raw_stimulus([], version=2), "version or kind"),
    "another kind": (raw_stimulus([], kind=3), "version or kind"),
    "another skin": (raw_stimulus([], taxels=63), "expected values for 64 taxels, found 63"),
    "back in time": (raw_stimulus([(0.01, 1), (0.02, 1), (0.01, 1)]), "earlier than the record before"),
    "no time": (raw_stimulus([(0.01, 1), (float("nan"), 1)]), "time of a record is not a number"),
    "negative": (raw_stimulus([(0.01, 1), (0.02, -1)]), "negative or not finite"),
    "not a number": (raw_stimulus([(0.01, float("nan"))]), "negative or not finite"),
    "cut": (raw_stimulus([(0.01, 1), (0.02, 1)])[:-1], "ends inside a record"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_the_emulator_refuses_a_broken_stimulus_with_one_line(tmp_path, small_world, name):
    content, words = BROKEN[name]
    path = tmp_path / "a.stm"
    path.write_bytes(content)
    with pytest.raises(LinkError, match=words) as caught:
        run_emulator(small_world, tmp_path / "a.bin", 0.1, stimulus=path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_stimulus_without_records_is_a_skin_that_nobody_touches(tmp_path, small_world):
    write_stimulus(tmp_path / "a.stm", [], np.zeros((0, 64)))
    assert run_emulator(small_world, tmp_path / "a.bin", 0.1, stimulus=tmp_path / "a.stm")["virtual_seconds"] == 0.1
