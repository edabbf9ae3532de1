"""Files that cannot be imported: one error line with the file and the place, and no traceback."""

import os
import zipfile

import numpy as np
import pytest

from host.tests.command_line import run_refused_command
from host.tests.importers.files import make_time, make_values, number_columns, write_csv, write_lerobot
from taxel.recording.importers.source_csv import open_file


def write_ragged(path):
    """Write a CSV table whose line 7 has one entry too many."""
    lines = write_csv(path, {"time": make_time(), **number_columns("p", make_values(3))}).read_text().splitlines()
    lines[6] += ",9"
    path.write_text("\n".join(lines))


def write_text_entry(path):
    """Write a CSV table in which the first value of line 7 is no number."""
    lines = write_csv(path, {"time": make_time(), **number_columns("p", make_values(3))}).read_text().splitlines()
    lines[6] = lines[6].replace(",", ",minus", 1)
    path.write_text("\n".join(lines))


def write_objects(path):
    """Write a NumPy archive whose array contains Python objects."""
    np.savez(path, a=np.array([{}], dtype=object), allow_pickle=True)


def write_other_zip(path):
    """Write a ZIP archive without arrays."""
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.txt", "text")


INPUTS = {  # case: (file name, function that writes it, expected text of the error)
    "missing": ("a.npz", lambda path: None, "a.npz: /: expected a readable file, found No such file"),
    "empty": ("a.csv", lambda path: path.touch(), "expected a file with content, found an empty file"),
    "folder": ("a.csv", lambda path: path.mkdir(), "expected a file, found a folder"),
    "FIFO": ("a.csv", os.mkfifo, "expected a regular file, found a device, pipe or socket"),
    "suffix": ("a.xyz", lambda path: path.write_text("1"), "found the suffix .xyz"),
    "ragged rows": ("a.csv", write_ragged, "a.csv: /line 7: expected 4 entries as in the first line, found 5"),
    "header only": ("a.csv", lambda path: path.write_text("time,p0\n"), "expected rows below the header, found none"),
    "equal names": ("a.csv", lambda path: path.write_text("a,a\n1,2\n"), "/a: expected each column once, found 2"),
    "binary table": ("a.csv", lambda path: path.write_bytes(b"\xff\xfe\x00\x01"), "expected a table as UTF-8 text"),
    "no archive": ("a.npz", lambda path: path.write_text("no zip"), "expected a NumPy archive (.npz)"),
    "other archive": ("a.npz", write_other_zip, "expected a NumPy array"),
    "Python objects": ("a.npz", write_objects, "expected a NumPy array, found 'it contains Python objects or records'"),
    "no array": ("a.npy", lambda path: path.write_bytes(b"\x93NUMPY"), "expected a NumPy array"),
    "Parquet": ("a.parquet", lambda path: path.write_bytes(b"PAR1xxxxPAR1"), "expected a Parquet table"),
    "HDF5": ("a.h5", lambda path: path.write_text("text"), "expected an HDF5 file"),
    "bag": ("a.bag", lambda path: path.write_text("text"), "expected a complete ROS bag"),
    "MCAP": ("a.mcap", lambda path: path.write_text("text"), "expected a complete ROS bag"),
    "sqlite3": ("a.db3", lambda path: path.write_text("text"), "expected a complete ROS bag"),
}


@pytest.mark.parametrize("case", INPUTS)
def test_a_file_that_cannot_be_read_gives_one_error_line(tmp_path, capsys, case):
    name, write, message = INPUTS[case]
    write(tmp_path / name)
    assert message in run_refused_command(capsys, "import", "inspect", tmp_path / name)


def test_an_entry_that_is_no_number_is_quoted_in_the_error(tmp_path, capsys):
    write_text_entry(tmp_path / "a.csv")
    text = 'format = "taxel-import-map"\nversion = 1\nsource = "real"\n[time]\nfield = "time"\n[values]\nprefix = "p"\n'
    (tmp_path / "m.toml").write_text(text)
    arguments = ("import", "map", tmp_path / "a.csv", "--map", tmp_path / "m.toml", "--out", tmp_path / "o.h5")
    assert "a.csv: /p0: expected an array of numbers, found 'minus" in run_refused_command(capsys, *arguments)


LEROBOT = {  # case: (function that damages the folder, expected text of the error)
    "version": (lambda folder: (folder / "meta/info.json").write_text('{"codebase_version": "v1.6"}'), "found 'v1.6'"),
    "JSON": (lambda folder: (folder / "meta/info.json").write_text("{"), "expected a JSON file"),
    "no data": (lambda folder: [file.unlink() for file in (folder / "data/chunk-000").iterdir()], "episode_*.parquet"),
    "table": (lambda folder: (folder / "data/chunk-000/episode_000001.parquet").write_text("x"), "a Parquet table"),
    "tasks": (lambda folder: (folder / "meta/tasks.jsonl").write_text("{}"), "tasks.jsonl"),
}


@pytest.mark.parametrize("case", LEROBOT)
def test_a_damaged_lerobot_folder_gives_one_error_line(tmp_path, capsys, case):
    damage, message = LEROBOT[case]
    folder = write_lerobot(tmp_path / "robot", "v2.1", [make_values(8), make_values(8)])
    damage(folder)
    assert message in run_refused_command(capsys, "import", "inspect", folder)


@pytest.mark.parametrize("entry", ["\x1c8.25", "8.25\x1f", "\u0668.25", "8_2.5", "\u20038.25"])
@pytest.mark.parametrize("rows", [5, 9000])
def test_an_entry_that_python_would_accept_as_a_number_stays_text(tmp_path, entry, rows):
    """A table of 9,000 rows is read by NumPy, which also accepts control characters around a number."""
    lines = ["t,p", *(f"{number},{number}.5" for number in range(rows))]
    lines[3] = f"2,{entry}"
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    values = open_file(path).fields["p"].load()
    assert values.dtype.kind == "U"
    assert values[2] == entry
    assert open_file(path).fields["t"].load()[2] == 2.0
