"""The measured touches in the package, compared with the source text, and the importer of that text."""

import importlib.util
import sys
from importlib.resources import files
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from taxel.recording import RecordingError, TouchRecording, list_recordings, load_recording

REPOSITORY = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def importer() -> ModuleType:
    """Module `tools/import_capfingerid.py`."""
    spec = importlib.util.spec_from_file_location("import_capfingerid", REPOSITORY / "tools" / "import_capfingerid.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def format_line(task="TAP", seconds="1508925142", nanoseconds="30093394", values=None, end=""):
    """Return a line of the source text: six fields, the last with time and 27 x 15 values.

    end: text after the last comma.
    """
    values = ["0"] * 405 if values is None else values
    return ";".join(["2", "right", "index", task, "-1", ",".join([seconds, nanoseconds, *values, end])])


def test_package_contains_two_recordings():
    assert list_recordings() == ["P20_thumb_right", "P2_index_right"]


@pytest.mark.parametrize(("name", "frames"), [("P2_index_right", 4232), ("P20_thumb_right", 3728)])
def test_recording_has_every_frame_of_the_source(name, frames):
    recording = load_recording(name)
    assert recording.values.shape == (frames, 27, 15)
    assert recording.values.dtype == np.int16
    assert recording.time_s.dtype == np.float64
    assert set(recording.task) == {"TAP", "SCROLL", "DRAG", "PAUSE"}


def test_values_of_the_index_finger_equal_the_source_text():
    """The expected numbers are those of the text, whose times are in nanoseconds; `time_s` begins at 0."""
    recording = load_recording("P2_index_right")
    assert recording.values[0, 0].tolist() == [0, -1, 0, -1, -1, 0, 1, 1, 0, 2, -3, 1, -2, 0, 1]
    assert recording.values[1999, 0, :8].tolist() == [181, 2, 1, 1, -2, 1, 2, 4]  # line 2000
    assert recording.values[1999, 9, 14] == -215
    assert recording.values[2328, 7, 0] == -256
    assert recording.task[1999] == "SCROLL"
    assert recording.time_s[1999] == (1508925257_917572777 - 1508925142_030093394) / 1e9


def test_values_of_the_thumb_equal_the_source_text():
    recording = load_recording("P20_thumb_right")
    assert recording.values[0, 0].tolist() == [0, -2, -1, -1, 0, 0, -3, 0, 0, 0, -2, -5, -2, -2, -2]
    assert recording.values[0, 4, 11] == 104
    assert recording.time_s[-1] == (1510666040_256491154 - 1510665822_285039572) / 1e9


def test_data_file_has_less_than_2_mb_and_comes_with_licence_and_origin():
    data = files("taxel.recording").joinpath("data")
    assert len(data.joinpath("capfingerid.npz").read_bytes()) < 2e6
    assert data.joinpath("capfingerid.LICENSE").read_text().startswith("MIT License")
    assert "10.1145/3301275.3302295" in data.joinpath("capfingerid.ORIGIN").read_text()


def test_error_for_an_unknown_recording_lists_the_available_ones():
    with pytest.raises(RecordingError, match=r"'P3'.*P20_thumb_right, P2_index_right"):
        load_recording("P3")


def test_selected_frames_keep_their_times():
    part = load_recording("P2_index_right").between(10.0, 20.0)
    assert part.time_s[0] >= 10.0
    assert part.time_s[-1] < 20.0
    assert len(part.time_s) == len(part.values) == len(part.task) > 100


def test_decreasing_times_are_refused():
    with pytest.raises(ValueError, match="do not decrease"):
        TouchRecording("x", np.array([1.0, 0.0]), np.zeros((2, 27, 15), np.int16), np.array(["TAP", "TAP"]))


def test_importer_reads_empty_and_dash_as_zero(importer):
    parsed = importer.parse_line(format_line(values=["", "-", "-7", *["0"] * 402]))
    assert parsed.values[:3] == [0, 0, -7]
    assert parsed.time_ns == 1508925142_030093394


@pytest.mark.parametrize("values", [["0"] * 404, ["0"] * 406, []])
def test_importer_skips_and_counts_frames_of_another_length(importer, tmp_path, values):
    """The first line has the 27 x 15 = 405 values of a frame; the second line has more or fewer values."""
    path = tmp_path / "CapMatrix_x.txt"
    path.write_text(format_line() + "\n" + format_line(values=values) + "\n")
    recording = importer.read_recording(path)
    assert (len(recording.values), recording.skipped) == (1, 1)


@pytest.mark.parametrize(
    ("invalid_line", "message"),
    [
        (format_line() + ";", "line 2: expected 6 fields"),
        (format_line(task="NAP"), "line 2: task: expected one of TAP"),
        (format_line(nanoseconds="1000000000"), "line 2: nanoseconds: expected an integer"),
        (format_line(values=["1.5", *["0"] * 404]), "line 2: value 0: expected an integer"),
        (format_line(values=["40000", *["0"] * 404]), "line 2: value 0: expected an integer from -32768"),
        (format_line(end="7"), "line 2: expected nothing after the last comma"),
        (format_line(seconds="1508925141"), "line 2: expected a time at or after"),
        (format_line().replace("index", "thumb"), "line 2: expected .*index.*found.*thumb"),
        ("", "line 2: expected 6 fields"),
    ],
)
def test_importer_names_the_invalid_line(importer, tmp_path, invalid_line, message):
    path = tmp_path / "CapMatrix_x.txt"
    path.write_text(format_line() + "\n" + invalid_line + "\n")
    with pytest.raises(importer.FormatError, match=message) as failure:
        importer.read_recording(path)
    assert str(path) in str(failure.value)


def test_importer_writes_the_values_of_the_text(importer, tmp_path):
    """Times are relative to the first line, at 1508925142 s and 30,093,394 ns; the second is at ...43 s and 99 ns.

    The number of the participant (2) is the first field of a line, not a part of the file name.
    """
    source, data = tmp_path / "source", tmp_path / "data"
    source.mkdir()
    data.mkdir()
    (source / "LICENSE").write_text("MIT License\n")
    later = format_line(task="DRAG", nanoseconds="99", seconds="1508925143", values=[str(i - 200) for i in range(405)])
    (source / "CapMatrix_P1_x.txt").write_text(format_line() + "\n" + later + "\n")
    assert "2 frames" in importer.import_folder(source, data)
    with np.load(data / "capfingerid.npz", allow_pickle=False) as archive:
        assert archive["P1_x.values"][1].tolist() == (np.arange(405) - 200).reshape(27, 15).tolist()
        assert archive["P1_x.task"].tolist() == ["TAP", "DRAG"]
        assert archive["P1_x.time_s"].tolist() == [0.0, (1_000_000_099 - 30_093_394) / 1e9]
        assert archive["P1_x.participant"] == 2
    assert (data / "capfingerid.LICENSE").read_text() == "MIT License\n"
