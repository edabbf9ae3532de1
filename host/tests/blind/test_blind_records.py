"""File of results: round trip, and rejection of results of different versions of the diagnosis."""

import gzip
from dataclasses import replace

import pytest

from taxel.blind.errors import BlindRunError
from taxel.blind.records import merge_results, read_records, write_records
from taxel.blind.results import ParameterComparison, ReportedVerdict, WorldResult
from taxel.blind.sampling import sample_worlds
from taxel.blind.score import score

SEED = 7100


def make_results(seed: int = SEED) -> list[WorldResult]:
    """Make the results of 42 worlds of all kinds: the first has a value in every field, the second has no report."""
    worlds = sample_worlds(40, 2, seed)
    row = ParameterComparison("noise", "noise white", "white_counts", "counts", 12.5, 12.0, 11.0, None, False)
    verdict = ReportedVerdict("explained", ("noise", "latency"), ("gain_mismatch",), {"noise": ("gain_mismatch",)})
    no_gap = ReportedVerdict("no_gap", ())
    results = [WorldResult(world, no_gap, gap=1.25, floor=2.0, diagnosis_version="ab") for world in worlds]
    fields = {
        "shrink": (0.5, 0.25),
        "baseline_verdicts": {"rules": "noise"},
        "parameters": (row, replace(row, low=None)),
        "is_location_found": True,
        "unobservable_causes": ("dropout",),
        "verdict_withheld": verdict,
        "verdict_shuffled": ReportedVerdict("unknown", ("unknown",)),
        "verdict_decoy": verdict,
        "verdicts_by_seed": (verdict, verdict),
        "isolation": "landlock",
    }
    failed = replace(results[1], verdict=ReportedVerdict("error", ()), error="KeyError: 3", diagnosis_version="")
    return [replace(results[0], verdict=verdict, **fields), failed, *results[2:]]


def test_written_results_are_read_unchanged(tmp_path):
    path = tmp_path / "answers.jsonl.gz"
    write_records(path, make_results())
    assert read_records(path) == make_results()


def test_equal_results_give_files_with_equal_bytes(tmp_path):
    first, second = tmp_path / "first.jsonl.gz", tmp_path / "second.jsonl.gz"
    write_records(first, make_results())
    write_records(second, read_records(first))
    assert first.read_bytes() == second.read_bytes()


def test_two_runs_of_one_version_are_scored_together():
    both = merge_results(make_results(), make_results(SEED + 1), "b")
    assert score(both)["worlds"] == 2 * 42


def test_results_of_another_version_of_the_diagnosis_are_rejected():
    other = [replace(result, diagnosis_version="cd") for result in make_results(SEED + 1)]
    message = "b: expected results of the same version of the diagnosis, found ab, cd; score the runs separately"
    with pytest.raises(BlindRunError, match=message):
        merge_results(make_results(), other, "b")


def test_results_of_the_same_run_are_rejected():
    with pytest.raises(BlindRunError, match="b: expected results of another run, found the same worlds"):
        merge_results(make_results(), make_results(), "b")


@pytest.mark.parametrize(
    "content",
    [b"", b"no gzip", b"\x1f\x8b\x08\x00", gzip.compress(b"{}\n", mtime=0), gzip.compress(b"x" * 99, mtime=0)[:-20]],
    ids=["empty", "text", "magic", "other records", "truncated"],
)
def test_file_without_results_is_rejected_in_one_line(tmp_path, content):
    path = tmp_path / "answers.jsonl.gz"
    path.write_bytes(content)
    with pytest.raises(
        BlindRunError, match=r"answers.jsonl.gz: expected the results of a blind check, found .*give the"
    ):
        read_records(path)
