"""Every error in a hand description is reported in one line that names the file and the field."""

import os
import pickle
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taxel.hand import HandDescriptionError, load_hand
from taxel.hand.schema import parse_hand

VALID = """\
format = "taxel-hand"
version = 1
name = "bench"
description = "Two boards of one kind, one of another"

[taxel]
pitch_m = 0.005
size_m = 0.003

[kinds.patch]
code = 1
tx = 2
rx = 3
taxels = 5
crossings = '''
###
.##
'''

[kinds.strip]
code = 2
tx = 1
rx = 2
taxels = 2
crossings = '##'

[[boards]]
name = "left"
kind = "patch"
address = 0x10

[[boards]]
name = "right"
kind = "patch"
address = 0x11

[[boards]]
name = "edge"
kind = "strip"
address = 0x12
"""

TAXELS_241 = "\n".join(["#" * 16] * 15 + ["#" + "." * 15])
BIG_KIND = f"[kinds.big]\ncode = 3\ntx = 16\nrx = 16\ntaxels = 241\ncrossings = '''\n{TAXELS_241}\n'''\n\n[[boards]]"

# Text in VALID, its replacement, the field in the error, and a part of the error message.
INVALID_EDITS: dict[str, tuple[str, str, str, str]] = {
    "not TOML": ("tx = 2", "tx = = 2", "line 12, column 6", "expected valid TOML, found 'Invalid value'"),
    "unclosed string": ('"bench"', '"bench', "line 3, column 14", "expected valid TOML"),
    "a kind twice": ("[kinds.strip]", "[kinds.patch]", "line 20, column 13", "Cannot declare"),
    "a number too long to read": ("code = 1", "code = " + "1" * 190, "kinds.patch.code", "of 628 bits"),
    "another format": ('"taxel-hand"', '"taxel-foot"', "format", "expected 'taxel-hand', found 'taxel-foot'"),
    "no format": ('format = "taxel-hand"\n', "", "format", 'add format = "taxel-hand"'),
    "another version": ("version = 1", "version = 2", "version", "expected 1, found 2"),
    "a version that only equals": ("version = 1", "version = 1.0", "version", "found 1.0"),
    "no version": ("version = 1\n", "", "version", "add version = 1"),
    "unknown key at the top": ("[taxel]", "[taxels]", "taxels", "did you mean taxel?"),
    "unknown key of a kind": ("code = 1", "code = 1\ncolour = 1", "kinds.patch.colour", "known names: code"),
    "unknown key of a board": (
        "address = 0x11",
        "adress = 0x11",
        "boards[1].adress",
        "did you mean address?",
    ),
    "unknown key with a line break": ("code = 1", 'code = 1\n"a\\nb" = 1', r"kinds.patch.'a\nb'", "unknown"),
    "missing key at the top": ('name = "bench"\n', "", "name", "expected a string, found nothing; add name"),
    "missing table": ("[taxel]\npitch_m = 0.005\nsize_m = 0.003\n", "", "taxel", "expected a table"),
    "missing key of a kind": ("taxels = 5\n", "", "kinds.patch.taxels", "add taxels"),
    "missing key of a board": ('name = "right"\n', "", "boards[1].name", "add name"),
    "missing key of the taxel": ("size_m = 0.003\n", "", "taxel.size_m", "expected a number, found nothing"),
    "a string for an integer": ("0x11", '"0x11"', "boards[1].address", "found '0x11'; remove the quotes"),
    "a fraction for an integer": ("tx = 2", "tx = 2.0", "kinds.patch.tx", "expected an integer, found 2.0"),
    "true for an integer": ("code = 1", "code = true", "kinds.patch.code", "expected an integer, found true"),
    "an integer for a string": ('name = "left"', "name = 7", "boards[0].name", "expected a string, found 7"),
    "a list for a map": ("'##'", "['##']", "kinds.strip.crossings", "expected a string, found a list"),
    "a string for a pitch": ("0.005", '"5 mm"', "taxel.pitch_m", "expected a number, found '5 mm'"),
    "a number for a table": (
        "[kinds.strip]",
        "[kinds]\nodd = 1\n[kinds.strip]",
        "kinds.odd",
        "expected a table",
    ),
    "address too low": ("0x11", "0x07", "boards[1].address", "from 0x08 to 0x77, found 0x07"),
    "address too high": ("0x11", "0x78", "boards[1].address", "from 0x08 to 0x77, found 0x78"),
    "address negative": ("0x11", "-1", "boards[1].address", "from 0x08 to 0x77, found -1"),
    "duplicate address": ("0x12", "0x10", "boards[2].address", "found 0x10, also in boards[0]"),
    "duplicate name": ('"edge"', '"left"', "boards[2].name", "found 'left', also in boards[0]"),
    "unknown kind": ('kind = "strip"', 'kind = "stripe"', "boards[2].kind", "did you mean strip?"),
    "hand name no identifier": ('"bench"', '"my bench"', "name", "found 'my bench'; rename it"),
    "board name no identifier": ('"edge"', '"../edge"', "boards[2].name", "found '../edge'; rename it"),
    "kind name no identifier": ("[kinds.strip]", "[kinds.2nd]", "kinds.'2nd'", "found '2nd'; rename it"),
    "name too long": ('"edge"', '"' + "e" * 65 + '"', "boards[2].name", "64 at most"),
    "control code in the description": ("Two boards", r"\u001b[2J", "description", "one printable line"),
    "rows of unequal length": (".##\n", ".#\n", "kinds.patch.crossings", "found 2 characters in row TX 1"),
    "an empty row": (".##\n", "\n.##\n", "kinds.patch.crossings", "found 0 characters in row TX 1"),
    "wrong character": (".##\n", ".x#\n", "kinds.patch.crossings", "found 'x' at TX 1, RX 1"),
    "too few rows": ("tx = 2", "tx = 3", "kinds.patch.crossings", "expected 3 rows"),
    "too many columns": ("rx = 3", "rx = 2", "kinds.patch.crossings", "expected 2 columns"),
    "an empty map": ("'##'", "''", "kinds.strip.crossings", "expected 2 columns"),
    "other number of taxels": ("taxels = 5", "taxels = 6", "kinds.patch.crossings", "expected 6 '#'"),
    "a TX line without a taxel": (
        "taxels = 5\ncrossings = '''\n###\n.##",
        "taxels = 3\ncrossings = '''\n###\n...",
        "kinds.patch.crossings",
        "TX line 1 has no taxel",
    ),
    "an RX line without a taxel": (
        "taxels = 5\ncrossings = '''\n###",
        "taxels = 4\ncrossings = '''\n.##",
        "kinds.patch.crossings",
        "RX line 0 has no taxel",
    ),
    "too many TX lines": ("tx = 2", "tx = 33", "kinds.patch.tx", "from 1 to 32, found 33"),
    "no RX line": ("rx = 3", "rx = 0", "kinds.patch.rx", "from 1 to 32, found 0"),
    "no taxel": ("taxels = 5", "taxels = 0", "kinds.patch.taxels", "from 1 to 240, found 0"),
    "too many taxels": ("[[boards]]", BIG_KIND, "kinds.big.taxels", "from 1 to 240, found 241"),
    "kind code 0": ("code = 1", "code = 0", "kinds.patch.code", "0 is a blank board"),
    "kind code of two bytes": ("code = 1", "code = 256", "kinds.patch.code", "from 1 to 255, found 256"),
    "duplicate kind code": ("code = 2", "code = 1", "kinds.strip.code", "found 1, also used by patch"),
    "no boards": (VALID[VALID.index("[[boards]]") :], "", "boards", "expected a list, found nothing"),
    "an empty list of boards": (
        VALID,
        VALID[: VALID.index("[[boards]]")].replace("[taxel]", "boards = []\n[taxel]", 1),
        "boards",
        "expected at least one board, found none",
    ),
    "one [boards] table": (VALID[VALID.index("[[boards]]") :], "[boards]\n", "boards", "put [[boards]]"),
    "pitch zero": ("0.005", "0.0", "taxel.pitch_m", "above 0"),
    "pitch negative": ("0.005", "-0.005", "taxel.pitch_m", "found -0.005"),
    "pitch not a number": ("0.005", "nan", "taxel.pitch_m", "found nan"),
    "pitch in millimetres": ("0.005", "5", "taxel.pitch_m", "write the length in metres"),
    "size zero": ("0.003", "0", "taxel.size_m", "above 0"),
    "size infinite": ("0.003", "inf", "taxel.size_m", "found inf"),
    "size above pitch": ("0.003", "0.006", "taxel.size_m", "at most the pitch (0.005 m), found 0.006"),
}


def load_error(path: Path | str) -> HandDescriptionError:
    """Return the error that loading a hand description raises."""
    with pytest.raises(HandDescriptionError) as caught:
        load_hand(path)
    return caught.value


def read_error_message(data: bytes) -> str | None:
    """Return the message of the error that parsing a hand description raises; None if there is no error."""
    try:
        parse_hand(data, "any.toml")
    except HandDescriptionError as error:
        return str(error)
    return None


def assert_one_line(error: HandDescriptionError, file: str, field: str) -> None:
    """Check that an error is one line with file, field, expected and found content, and remedy."""
    line = str(error)
    assert line.isprintable()
    assert line.startswith(f"{file}: {field}: expected ")
    assert ", found " in line
    assert "; " in line
    assert (error.file, error.field) == (file, field)


def test_the_unmodified_description_is_valid(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(VALID)
    hand = load_hand(path)
    assert [(b.name, b.address, b.kind.taxel_count) for b in hand.boards] == [
        ("left", 0x10, 5),
        ("right", 0x11, 5),
        ("edge", 0x12, 2),
    ]
    assert load_hand(str(path)) == hand


@pytest.mark.parametrize("edit", INVALID_EDITS)
def test_an_invalid_description_raises_a_one_line_error(edit: str, tmp_path: Path) -> None:
    old, new, field, message = INVALID_EDITS[edit]
    assert old in VALID
    path = tmp_path / "bench.toml"
    path.write_text(VALID.replace(old, new, 1))
    error = load_error(path)
    assert_one_line(error, str(path), field)
    assert message in str(error)


def test_blanks_around_the_map_are_ignored(tmp_path: Path) -> None:
    path = tmp_path / "bench.toml"
    path.write_text(VALID.replace("###\n.##\n", "\n\t###\r\n    .##  \n\n  ", 1))
    assert load_hand(path).n_taxels == 12


def test_the_error_of_a_missing_file_lists_the_packaged_names() -> None:
    error = load_error("alegro")
    assert_one_line(error, "alegro", "file")
    assert "no such file; the packaged hands are allegro, first_generation, flat8" in str(error)


@pytest.mark.parametrize("name", ["", "two\nlines", "nul\0byte", "a" * 5000])
def test_an_impossible_file_name_raises_a_one_line_error(name: str) -> None:
    error = load_error(name)
    assert str(error).isprintable()
    assert error.field == "file"


def test_a_directory_is_rejected(tmp_path: Path) -> None:
    assert_one_line(load_error(tmp_path), str(tmp_path), "file")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_pipe_is_rejected_without_waiting(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.toml"
    os.mkfifo(pipe)
    assert_one_line(load_error(pipe), str(pipe), "file")


def test_a_file_above_one_mebibyte_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "big.toml"
    path.write_text(VALID + "#\n" * (1 << 19))
    error = load_error(path)
    assert_one_line(error, str(path), "file")
    assert "1048576 bytes" in str(error)


def test_a_dotted_key_of_100000_parts_is_rejected_before_parsing(tmp_path: Path) -> None:
    path = tmp_path / "dots.toml"
    path.write_text("a." * 100_000 + "a = 1\n")
    assert_one_line(load_error(path), str(path), "line 1")


def test_deeply_nested_lists_are_rejected(tmp_path: Path) -> None:
    path = tmp_path / "deep.toml"
    path.write_text("a = " + "[\n" * 100_000)
    assert_one_line(load_error(path), str(path), "file")


def test_a_file_that_is_not_utf_8_is_rejected_with_the_line_number(tmp_path: Path) -> None:
    path = tmp_path / "latin1.toml"
    path.write_bytes(VALID.replace("Two boards", "Zwölf").encode("latin-1"))
    error = load_error(path)
    assert_one_line(error, str(path), "line 4")
    assert "byte 0xF6" in str(error)


def test_an_error_can_be_pickled() -> None:
    error = load_error("alegro")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


@given(st.binary(max_size=300))
def test_random_bytes_raise_a_one_line_error(data: bytes) -> None:
    with pytest.raises(HandDescriptionError) as caught:
        parse_hand(data, "any.toml")
    assert str(caught.value).isprintable()


@given(
    position=st.integers(0, len(VALID)),
    removed=st.integers(0, 12),
    inserted=st.text(st.sampled_from("\"'#.=[]{}\n 0123456789abx-_\\\r\u2028é"), max_size=6),
)
def test_a_random_edit_is_accepted_or_raises_a_one_line_error(position: int, removed: int, inserted: str) -> None:
    edited = VALID[:position] + inserted + VALID[position + removed :]
    line = read_error_message(edited.encode())
    assert line is None or (line.isprintable() and line.startswith("any.toml: "))
