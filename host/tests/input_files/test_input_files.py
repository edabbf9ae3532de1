"""Regular files of bounded size, and the limits of the parsers of TOML and JSON."""

import os
import socket

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
        (b"9" * 10_000, "file: expected JSON, found an integer of thousands of digits"),
    ],
)
def test_an_invalid_json_text_gives_one_error(data, message):
    with pytest.raises(TextError) as caught:
        parse_json(data, values_max=40 if data.startswith(b'{"a": [') else 1 << 22)
    assert str(caught.value) == message


def test_brackets_in_strings_are_no_nesting():
    text = '["' + "[{" * 500 + '\\"' + '", 1]'
    assert parse_json(text.encode())[1] == 1
