"""Regular files of bounded size, and the limits of the parsers of TOML and JSON."""

import gzip
import os
import socket

import numpy as np
import pytest

from taxel.input_files import (
    InputFileError,
    TextError,
    is_regular_file,
    open_regular_file,
    parse_json,
    parse_toml,
    read_regular_file,
)
from taxel.input_files.csv_rows import parse_float, parse_integer, read_csv_rows
from taxel.input_files.gzip_text import expand_gzip
from taxel.input_files.numpy_archive import ArchiveError, NumpyArchive


def make_special_file(kind, folder):
    path = folder / kind
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(os.fspath(path))
    return path


@pytest.mark.parametrize("kind", ["pipe", "folder", "device", "socket"])
def test_a_special_file_is_refused_without_waiting(tmp_path, kind):
    path = make_special_file(kind, tmp_path)
    assert not is_regular_file(path)
    for read in (open_regular_file, lambda each: read_regular_file(each, 10)):
        with pytest.raises(InputFileError) as caught:
            read(path)
        assert caught.value.filename == os.fspath(path)
        assert caught.value.strerror == f"is a {kind}, no regular file; copy the data to a file, and give the file"


def test_a_file_name_too_long_for_the_system_is_shortened_in_the_error():
    with pytest.raises(InputFileError, match="name too long") as caught:
        read_regular_file("/a/" + "b" * 100_000, 10)
    assert len(str(caught.value)) < 300


def test_a_file_of_the_permitted_size_is_read_and_a_larger_one_is_refused(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"0123456789")
    assert is_regular_file(path)
    assert read_regular_file(path, 10) == b"0123456789"
    with open_regular_file(path) as file:
        assert file.read() == b"0123456789"
    with pytest.raises(InputFileError, match="has more than 9 bytes"):
        read_regular_file(path, 9)


def test_a_file_that_states_no_size_is_limited_while_it_is_read():
    assert os.stat("/proc/self/mountinfo").st_size == 0
    with pytest.raises(InputFileError, match="has more than 3 bytes"):
        read_regular_file("/proc/self/mountinfo", 3)


def test_a_missing_file_is_reported_as_missing(tmp_path):
    assert not is_regular_file(tmp_path / "none")
    with pytest.raises(FileNotFoundError):
        open_regular_file(tmp_path / "none")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"a = " + b"[" * 100_000, "file: expected a few nested lists, found hundreds of nested lists"),
        (b"a = " + b"[" * 64 + b"]" * 64, "file: expected at most 64 nested tables and lists, found more"),
        (b"a = 1\n" + b"b." * 33 + b"c = 1", "line 2: expected keys of at most 32 parts, found a longer dotted key"),
        (b"a = 1\n[" + b"'b' . " * 40 + b"c]", "line 2: expected keys of at most 32 parts, found a longer dotted key"),
        (b"a = 1\nb = '\xff'", "line 2: expected UTF-8 text, found byte 0xFF"),
        (b"a = 1\nb = ?", "line 2, column 5: expected valid TOML, found Invalid value"),
        (b"a = " + b"9" * 5000, "file: expected valid TOML, found Exceeds the limit"),
        (b"a = 0x" + b"9" * 5000, "a: expected an integer of 64 bits, found an integer of 20000 bits"),
        (
            b"c = 1\na = [0, { b = 9223372036854775808 }]",
            "a[1].b: expected an integer of 64 bits, found an integer of 64",
        ),
        (b"#" * 101, "file: expected at most 100 bytes, found more than 100 bytes"),
    ],
)
def test_an_invalid_toml_text_gives_one_error(data, message):
    with pytest.raises(TextError) as caught:
        parse_toml(data, 100 if data.startswith(b"##") else 1 << 20)
    assert str(caught.value).startswith(message)


def test_numbers_and_texts_with_dots_are_no_dotted_keys():
    numbers = ", ".join(["0.5"] * 100)
    sentence = "a. b. c. " * 5
    assert parse_toml(f"# {'.' * 100}\na = [{numbers}]\nb = '{sentence}'".encode())["b"] == sentence


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"[" * 100_000, "file: expected JSON of at most 100 levels, found more"),
        (b"[" * 101 + b'"[]"' + b"]" * 101, "file: expected JSON of at most 100 levels, found more"),
        (b'{"a": [' + b"0," * 50 + b"0]}", "file: expected at most 40 values, found more"),
        (b"[1e999]", "file: expected numbers of at most 1.8e308, found 1e999"),
        (b"[-Infinity]", "file: expected JSON, found -Infinity, which JSON does not have"),
        (b'{"a": 1, "a": 2}', "file: expected each key of an object once, found 'a' twice"),
        (b'[1,\n"\xff"]', "line 2: expected UTF-8 text, found byte 0xFF"),
        (b"[1,\n2", "line 2: expected valid JSON, found Expecting ',' delimiter in column 2"),
        (b"[18446744073709551616]", "file: expected integers of at most 64 bits, found an integer of 20 characters"),
        (b"9" * 10_000, "file: expected integers of at most 64 bits, found an integer of 10000 characters"),
    ],
)
def test_an_invalid_json_text_gives_one_error(data, message):
    with pytest.raises(TextError) as caught:
        parse_json(data, values_max=40 if data.startswith(b'{"a": [') else 1 << 22)
    assert str(caught.value) == message


def test_brackets_in_strings_are_no_nesting():
    text = '["' + "[{" * 500 + '\\"' + '", 1]'
    assert parse_json(text.encode())[1] == 1


def test_half_of_a_character_is_refused_where_a_text_must_be_encoded_again():
    data = rb'{"hand": "\ud800"}'  # JSON encodes a character above 0xFFFF as two halves (surrogates)
    with pytest.raises(TextError, match="file: expected texts of whole characters"):
        parse_json(data)
    assert parse_json(data, permits_surrogates=True) == {"hand": "\ud800"}
    assert parse_json(rb'["\ud83d\ude00"]') == ["\U0001f600"]


def test_rows_of_a_table_are_read_with_the_numbers_of_their_lines(tmp_path):
    """The table has a byte order mark, a byte that is no UTF-8, an empty line, and a field of two lines.

    A field of more than 131,072 characters is refused.
    """
    path = tmp_path / "a.csv"
    path.write_bytes(b'\xef\xbb\xbfa,b\r\n1,\xff\n\n"2\n3",4\n')
    assert list(read_csv_rows(path)) == [(1, ["a", "b"]), (2, ["1", "\ufffd"]), (3, []), (5, ["2\n3", "4"])]
    path.write_text("a,b\n" + '"' + "x\n" * 70_000)
    with pytest.raises(TextError, match=r"line \d+: expected comma-separated values, found field larger"):
        list(read_csv_rows(path))


@pytest.mark.parametrize("text", ["1_0", "１", "", "x", "0x10", "\x1c1", "1\x1f"])
def test_an_entry_that_is_no_plain_number_is_refused(text):
    for parse in (parse_float, parse_integer):
        with pytest.raises(ValueError):
            parse(text)


def write_archive(path, **arrays):
    np.savez_compressed(path, **arrays)
    return path


def test_arrays_of_an_archive_are_read(tmp_path):
    arrays = {"a": np.arange(6.0).reshape(2, 3), "b": np.array(["x", "yz"]), "c": np.asfortranarray(np.eye(3)[:2])}
    with NumpyArchive(write_archive(tmp_path / "a.npz", **arrays)) as archive:
        assert archive.names == ("a", "b", "c")
        for name, array in arrays.items():
            read = archive.read(name, 1000)
            assert read.dtype == array.dtype
            assert np.array_equal(read, array)
        with pytest.raises(ArchiveError, match="it has more than 40 bytes"):
            archive.read("a", 40)


def test_a_small_archive_that_expands_to_gigabytes_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("taxel.input_files.numpy_archive.EXPANDED_BYTES_MAX", 1000)
    with (
        NumpyArchive(write_archive(tmp_path / "a.npz", a=np.zeros(1_000_000))) as archive,
        pytest.raises(ArchiveError, match=r"\d+ stored bytes expand to 8000128"),  # with a header of 128 bytes
    ):
        archive.read("a", 10**9)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.array([{}], dtype=object), "it contains Python objects or records"),
        (np.zeros(2, [("x", "f8")]), "it contains Python objects or records"),
        (np.array([0x110000], "<u4").view("<U1"), "a text contains a code that is no character"),
    ],
)
def test_an_array_without_plain_values_is_refused(tmp_path, array, message):
    with (
        NumpyArchive(write_archive(tmp_path / "a.npz", a=array)) as archive,
        pytest.raises(ArchiveError, match=message),
    ):
        archive.read("a", 1000)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (gzip.compress(b"a" * 101, mtime=0), "expected at most 100 bytes after expansion"),
        (gzip.compress(b"abc", mtime=0)[:-1], "found a truncated one"),
        (gzip.compress(b"abc", mtime=0) + b"x", "found more data"),
        (b"abc", "expected data compressed by gzip"),
    ],
)
def test_a_wrong_gzip_stream_is_refused(data, message):
    with pytest.raises(TextError, match=message):
        expand_gzip(data, 100)
    assert expand_gzip(gzip.compress(b"abc", mtime=0), 100) == b"abc"
