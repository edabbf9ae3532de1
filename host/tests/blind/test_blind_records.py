"""Answers as a file: what is read is what was written, and only answers of one diagnosis are scored together."""

from __future__ import annotations

import gzip
from dataclasses import replace

import pytest

from taxel.blind.answers import Answer, Compared, Named
from taxel.blind.drawing import drawn_worlds
from taxel.blind.errors import BlindRunError
from taxel.blind.records import read_records, together, write_records
from taxel.blind.score import score

SEED = 7100


def answers(seed: int = SEED) -> list[Answer]:
    """One of each kind of world at least, with all that an answer can hold."""
    worlds = drawn_worlds(40, 2, seed)
    row = Compared("noise", "noise white", "white_counts", "counts", 12.5, 12.0, 11.0, None, False)
    named = Named("explained", ("noise", "latency"), ("gain_mismatch",), {"noise": ("gain_mismatch",)})
    plain = [Answer(one, Named("no_gap", ()), gap=1.25, floor=2.0, diagnosis="ab") for one in worlds]
    full = {
        "shrink": (0.5, 0.25),
        "simpler": {"rules": "noise"},
        "parameters": (row, replace(row, low=None)),
        "found_places": True,
        "idle": ("dropout",),
        "without": named,
        "shuffled": Named("unknown", ("unknown",)),
        "decoy": named,
        "seeds": (named, named),
        "blindfold": "landlock",
    }
    broken = replace(plain[1], named=Named("error", ()), error="KeyError: 3", diagnosis="")
    return [replace(plain[0], named=named, **full), broken, *plain[2:]]


def test_what_is_read_is_what_was_written(tmp_path):
    path = tmp_path / "answers.jsonl.gz"
    write_records(path, answers())
    assert read_records(path) == answers()
    assert score(read_records(path)) == score(answers())
    before = path.read_bytes()
    write_records(path, read_records(path))
    assert path.read_bytes() == before


def test_two_runs_of_one_diagnosis_are_one_score():
    both = together(answers(), answers(SEED + 1), "b")
    assert score(both)["worlds"] == 84


def test_answers_of_another_diagnosis_are_refused():
    other = [replace(one, diagnosis="cd") for one in answers(SEED + 1)]
    message = "b: expected answers of the same diagnosis, found of ab, cd; score them apart"
    with pytest.raises(BlindRunError, match=message):
        together(answers(), other, "b")


def test_the_same_run_is_refused():
    with pytest.raises(BlindRunError, match="b: expected answers of another run, found the same worlds"):
        together(answers(), answers(), "b")


@pytest.mark.parametrize(
    "content",
    [b"", b"no gzip", b"\x1f\x8b\x08\x00", gzip.compress(b"{}\n", mtime=0), gzip.compress(b"x" * 99, mtime=0)[:-20]],
    ids=["empty", "text", "magic", "other records", "cut short"],
)
def test_what_is_no_file_of_answers_is_refused_in_one_line(tmp_path, content):
    path = tmp_path / "answers.jsonl.gz"
    path.write_bytes(content)
    with pytest.raises(
        BlindRunError, match=r"answers.jsonl.gz: expected the answers of a blind check, found .*give its"
    ):
        read_records(path)
