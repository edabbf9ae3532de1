"""Malformed recordings in Parquet and CSV: one line that names the column or the line."""

import os

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest

from taxel.hand import load_hand
from taxel.recording.formats import open_recording
from taxel.recording.formats.csv_format import COLUMNS, HEADER_FILE
from taxel.recording.formats.frame_table import RecordingFormatError, format_header
from taxel.recording.formats.parquet_format import open_parquet, read_parquet_joints
from taxel.skin import Skin

HAND = load_hand("flat8")
BOARD = HAND.boards[0]
TAXELS = BOARD.kind.taxel_count
HEADER = {"hand": "flat8", "clock": "host", "baud": 1e6}


def make_columns(**changes):
    """Make the columns of a table with two frames. changes: other columns; None removes a column."""
    columns = {
        "time_s": [1.0, 1.1],
        "address": [BOARD.address] * 2,
        "name": pyarrow.array([BOARD.name] * 2).dictionary_encode(),
        "sequence": [1, 2],
        "cycle": [1, 2],
        "board_time_us": [0, 1000],
        "hub_time_us": [0, 1000],
        "raw_counts": [[30_000] * TAXELS] * 2,
    }
    return {name: value for name, value in (columns | changes).items() if value is not None}


def write_parquet(folder, header=HEADER, **changes):
    """Write a Parquet recording of the columns `make_columns(**changes)`, and return its path."""
    table = pyarrow.table(make_columns(**changes)).replace_schema_metadata({"taxel": format_header(header)})
    pyarrow.parquet.write_table(table, folder / "a.parquet")
    return folder / "a.parquet"


def read_all(path):
    """Return all frames of a recording."""
    link, hand = open_recording(path)
    with Skin(link, hand) as skin:
        return list(skin)


def test_a_table_with_wider_integers_is_read(tmp_path):
    frames = read_all(write_parquet(tmp_path))
    assert [frame.cycle for frame in frames] == [1, 2]
    assert np.array_equal(frames[0].raw_counts, [30_000] * TAXELS)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time_s": ["a", "b"]}, "column time_s: expected double, found 'string'"),
        ({"address": [1e308, 1.0]}, "column address: expected uint8, found 'double'"),
        ({"cycle": ["1", "2"]}, "column cycle: expected uint16, found 'string'"),
        (
            {"raw_counts": [["x"], ["y"]]},
            "expected list<item: uint16>, found 'list<element: string>'",
        ),
        (
            {"raw_counts": [[0.5], [1.5]]},
            "expected list<item: uint16>, found 'list<element: double>'",
        ),
        ({"sequence": None}, "columns: expected time_s, address, name, sequence"),
        ({"joint_position": [["a"], ["b"]]}, "column joint_position: expected list<item: double>"),
        ({"time_s": [1e308, 1.0]}, "row 1, time_s: expected seconds, 0 or more, found 1e[+]308"),
        ({"time_s": [float("nan"), 1.0]}, "row 1, time_s: expected seconds, 0 or more, found nan"),
        ({"cycle": [1, 70_000]}, "row 2, cycle: expected 0 to 65535, found 70000"),
        ({"raw_counts": [[1, None], [2, 3]]}, "row 1, raw counts: expected 0 to 65535"),
        ({"raw_counts": [[2**63 - 1], [1]]}, "row 1, raw counts: expected 0 to 65535"),
        ({"time_s": [None, 1.0]}, "row 1, time_s: expected a value, found 'none'"),
    ],
)
def test_a_column_or_a_value_of_another_type_gives_one_error_line(tmp_path, changes, message):
    path = write_parquet(tmp_path, **changes)
    with pytest.raises(RecordingFormatError, match=message.replace("[+]", r"\+")):
        list(open_parquet(path)._frames)


@pytest.mark.parametrize("offset", [100, -40])
def test_damaged_bytes_of_a_parquet_file_give_one_error_line(tmp_path, offset):
    path = write_parquet(tmp_path)
    data = bytearray(path.read_bytes())
    data[offset : offset + 30] = b"\xff" * 30
    path.write_bytes(data)
    with pytest.raises(RecordingFormatError, match=r"a\.parquet: "):
        list(open_parquet(path)._frames)


def test_missing_joint_angles_give_one_error_line(tmp_path):
    path = write_parquet(tmp_path, joint_position=[[0.1, None], [0.2, 0.3]])
    with pytest.raises(RecordingFormatError, match="row 1, joint_position: expected 2 finite angles"):
        read_parquet_joints(path, ["a", "b"])


def test_a_pipe_as_a_parquet_file_is_refused_without_waiting(tmp_path):
    os.mkfifo(tmp_path / "a.parquet")
    with pytest.raises(RecordingFormatError, match="found 'is a pipe, no regular file"):
        open_recording(tmp_path / "a.parquet")


def write_csv(folder, row):
    """Write a CSV recording with one row (bytes), and return its path, a folder."""
    (folder / "a.csv").mkdir()
    (folder / "a.csv" / HEADER_FILE).write_text(format_header(HEADER))
    heading = ",".join((*COLUMNS, *(f"taxel_{index}" for index in range(TAXELS))))
    (folder / "a.csv" / f"{BOARD.name}.csv").write_bytes(heading.encode() + b"\n" + row + b"\n")
    return folder / "a.csv"


GOOD_ROW = b"0,%d,1.0,1,1,0,0," % BOARD.address + b",".join([b"30000"] * TAXELS)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b",1.0,", b",1.\xff,", r"line 2: expected numbers"),
        (b",1.0,", b",1_0.0,", r"line 2: expected numbers"),
        (b",1.0,", b",1e308,", r"line 2, time_s: expected seconds"),
        (b",1.0,", b',"' + b"x\n" * 70_000, r"line \d+: expected comma-separated values"),
        (b",1,1,", b",1,,", r"line 2: expected numbers"),
    ],
)
def test_a_malformed_line_of_a_csv_file_is_named(tmp_path, old, new, message):
    assert len(read_all(write_csv(tmp_path, GOOD_ROW))) == 1
    (tmp_path / "b").mkdir()
    path = write_csv(tmp_path / "b", GOOD_ROW.replace(old, new, 1))
    with pytest.raises(RecordingFormatError, match=message):
        read_all(path)
