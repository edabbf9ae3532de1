"""`taxel gap blind` from end to end: cut after a world, gone on with, opened, scored."""

from __future__ import annotations

import json
import shutil
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import h5py
import pytest

from host.tests.command_line import exit_status
from taxel.blind import drawing, run
from taxel.blind.lane import Lane
from taxel.blind.records import RECORDS, read_records, write_records
from taxel.blind.version import diagnosis_version
from taxel.gap.catalogue import OWN_EFFECTS

SEED = 4400
"""World 0 hides a lag, whose seconds no definition fixes, and is withheld; world 1 hides nothing and has another effect
deleted.
"""

SHORT = {"noise", "gain_mismatch", "baseline_drift", "latency"}
"""All the effects that these diagnoses know."""


def read(path) -> dict:
    return json.loads(path.read_text())


def lasting(report: dict) -> dict:
    """Without what is another in every process: its folder, its time."""
    return {key: value for key, value in report.items() if key not in ("inputs", "runtime_s")}


@pytest.fixture(scope="module")
def small():
    """Worlds of 32 presses, one more analysis seed, a few effects."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (("APPROACHES", (8, 8)), ("SESSIONS", (4, 4)), ("REPEATS", (1, 1)), ("PRESSES", (32, 32))):
            patch.setattr(drawing, name, value)
        patch.setattr(run, "SEEDS", 2)
        patch.setattr(run, "Lane", ShortLane)
        yield patch


class ShortLane(Lane):
    """The process that diagnoses, with a catalogue of which a diagnosis takes a third of the time."""

    def diagnose(self, real, sim, out, without=(), seed=0):
        super().diagnose(real, sim, out, sorted({*without, *OWN_EFFECTS} - (SHORT - set(without))), seed)


class CutLane(ShortLane):
    """Is interrupted after its first answer."""

    def diagnose(self, real, sim, out, without=(), seed=0):
        if out.name != "report.json":
            raise KeyboardInterrupt
        super().diagnose(real, sim, out, without, seed)


@pytest.fixture(scope="module")
def cut(small, tmp_path_factory):
    """A check of two worlds, cut when the first had its report and no more."""
    out = tmp_path_factory.mktemp("blind") / "check"
    first, second = run.seal(out, 2, 0, SEED)
    assert (first.hidden.names, first.withheld, first.repeated) == (("latency",), True, True)
    assert (second.hidden.kind, bool(second.decoy)) == ("none", True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "Lane", CutLane)
        with pytest.raises(KeyboardInterrupt):
            run.run_worlds(out, [first], 1)
    shutil.copytree(out, out.parent / "cut")
    return out.parent / "cut"


@pytest.fixture(scope="module")
def check(small, cut):
    """The same after the command has gone on with it."""
    small.setenv("SOURCE_DATE_EPOCH", "")  # taken back afterwards: threads instead of processes set it here
    small.setattr(run, "ProcessPoolExecutor", lambda count, *context, **words: ThreadPoolExecutor(count))
    out = cut.parent / "check"
    options = ("--jobs", 1, "--page", out.parent / "page" / "score.md")  # a second process would only begin for nothing
    assert exit_status("gap", "blind", "--worlds", 2, "--out", out, *options) == 0
    return out


def test_commitments_are_older_than_every_dataset(check):
    published = (check / "commitments.json").stat().st_mtime_ns
    assert len(list(check.glob("worlds/*/*.h5"))) == 5  # two pairs and one with exchanged simulations
    assert all(path.stat().st_mtime_ns > published for path in check.glob("worlds/**/*.*"))


def test_each_world_is_diagnosed_as_it_was_drawn(check):
    found = {path.name: {file.name for file in path.glob("*.json")} for path in (check / "worlds").iterdir()}
    assert found == {
        "0000": {"report.json", "without.json", "seed1.json", "shuffled.json"},
        "0001": {"report.json", "decoy.json"},
    }
    assert "latency" in {entry["name"] for entry in read(check / "worlds" / "0000" / "report.json")["effects"]}
    assert "latency" not in {entry["name"] for entry in read(check / "worlds" / "0000" / "without.json")["effects"]}


def test_the_diagnosis_was_blind_and_simpler_diagnosers_answered(check):
    for path in check.glob("worlds/*/report.json"):
        report = read(path)
        assert report["blindfold"] in ("landlock and audit hook", "audit hook")
        assert set(report["simpler"]) == {"rules", "effect_blind"}
        assert set(report["simpler"].values()) <= {*OWN_EFFECTS, "no_gap"}
        assert str(check) not in path.read_text()


def test_published_folders_hold_nothing_of_the_truth(check):
    scored = {"score.json", "score.md", "answers.jsonl.gz"}
    assert {path.name for path in check.iterdir()} == {"commitments.json", "sealed", "worlds", *scored}
    assert {path.name for path in (check / "sealed").iterdir()} == {"keys.json", "reference0000.json"}


def test_both_datasets_of_all_worlds_say_that_they_were_made_when_the_seal_was(check):
    told = set()
    for path in check.glob("worlds/*/[rs][ei][am]*.h5"):
        with h5py.File(path) as file:
            told.add(file.attrs["created"])
    assert len(told) == 1


def test_the_score_and_its_sheet_are_written(check):
    found = read(check / "score.json")
    assert (found["worlds"], found["full_hand"], found["rig4"]["errors"]) == (2, None, [])
    assert found["rig4"]["false_alarms"] == {
        "right": 0,
        "of": 1,
        "share": 0.0,
        "ci95": found["rig4"]["false_alarms"]["ci95"],
    }
    assert found["rig4"]["counts"]["single"] == {"worlds": 1, "clear": 1}
    assert found["rig4"]["single_first"]["right"] == 1
    assert found["rig4"]["unknown_withheld"]["of"] == 1
    text = (check / "score.md").read_text()
    made = "Made by `taxel gap blind --worlds 2`; 2 worlds gave a report. Version of the diagnosis, by its sources: "
    assert f"{made}{diagnosis_version()}." in text
    assert (check.parent / "page" / "score.md").read_text() == text


def test_a_check_that_is_done_is_only_scored_again(check, monkeypatch, capsys):
    monkeypatch.setattr(run, "Lane", None)
    assert exit_status("gap", "blind", "--worlds", 2, "--out", check, "--json") == 0
    assert json.loads(capsys.readouterr().out) == read(check / "score.json")


def test_the_answers_are_kept_and_are_no_further_run(check, capsys):
    path = check / RECORDS
    assert [one.world.number for one in read_records(path)] == [0, 1]
    assert {one.diagnosis for one in read_records(path)} == {diagnosis_version()}
    assert exit_status("gap", "blind", "--worlds", 2, "--out", check, "--also", path) == 1
    assert "expected answers of another run, found the same worlds" in " ".join(capsys.readouterr().err.split())


def test_answers_of_another_diagnosis_are_refused_before_a_world_is_made(check, tmp_path, capsys):
    other = tmp_path / RECORDS
    write_records(other, [replace(one, diagnosis="cd") for one in read_records(check / RECORDS)])
    assert exit_status("gap", "blind", "--worlds", 2, "--out", tmp_path / "new", "--also", other) == 1
    assert "expected answers of the same diagnosis" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "new").exists()


def test_a_world_that_was_cut_is_made_anew_to_the_same_bytes_and_the_same_answer(check, cut):
    before, after = (folder / "worlds" / "0000" for folder in (cut, check))
    assert {path.name for path in before.iterdir()} == {"real.h5", "sim.h5", "report.json"}
    for name in ("real.h5", "sim.h5"):
        assert (before / name).read_bytes() == (after / name).read_bytes()
    assert lasting(read(before / "report.json")) == lasting(read(after / "report.json"))


class FakeLane:
    """Notes for which world it is asked, and answers at once; in the fifth world not before the run was cut."""

    asked: ClassVar[list[str]] = []
    cut = threading.Event()

    def __init__(self, out: Path) -> None:
        pass

    def diagnose(self, real: Path, sim: Path, out: Path, without=(), seed=0) -> None:
        self.asked.append(f"{out.parent.name}/{out.name}")
        if len({name.partition("/")[0] for name in self.asked}) == 5:
            assert self.cut.wait(60)
        out.write_text(json.dumps({"error": "none of it was looked at"}))

    def close(self) -> None:
        pass


class CutPool(ThreadPoolExecutor):
    """Tells `FakeLane` when it is shut down."""

    def shutdown(self, wait=True, *, cancel_futures=False):
        super().shutdown(wait=False, cancel_futures=cancel_futures)
        FakeLane.cut.set()
        super().shutdown(wait)


def test_a_check_that_was_cut_after_some_worlds_goes_on_with_the_others(monkeypatch, tmp_path):
    monkeypatch.setattr(FakeLane, "asked", [])
    monkeypatch.setattr(FakeLane, "cut", threading.Event())
    monkeypatch.setattr(run, "Lane", FakeLane)
    monkeypatch.setattr(run, "ThreadPoolExecutor", CutPool)
    monkeypatch.setattr(run, "ProcessPoolExecutor", lambda count, *context, **words: ThreadPoolExecutor(count))
    monkeypatch.setattr(run, "_make", lambda *arguments: 0)
    monkeypatch.setattr(run, "_reference", lambda *arguments: {})
    monkeypatch.setattr(run, "shuffled_copy", lambda *arguments: None)
    worlds = run.seal(tmp_path / "check", 9, 0, seed=2)
    told = []

    def stop(done: int, total: int) -> None:
        told.append((done, total))
        if done == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run.run_worlds(tmp_path / "check", worlds, 1, stop)
    finished = {path.parent.name for path in tmp_path.glob("check/worlds/*/done")}
    assert len(finished) == 5  # what had begun was finished
    first = set(FakeLane.asked)
    FakeLane.asked.clear()
    run.run_worlds(tmp_path / "check", run.seal(tmp_path / "check", 9, 0, None), 2, lambda *done: told.append(done))
    assert not {name.partition("/")[0] for name in FakeLane.asked} & finished
    assert {name.partition("/")[0] for name in first | set(FakeLane.asked)} == {f"{number:04d}" for number in range(9)}
    assert told[:5] == [(done, 9) for done in range(5)]
    assert told[5:] == [(done, 9) for done in range(len(finished), 10)]


def test_a_changed_key_or_another_number_is_refused_in_one_line(check, tmp_path, capsys):
    assert exit_status("gap", "blind", "--worlds", 3, "--out", check) == 1
    assert capsys.readouterr().err.strip().endswith("choose another --out")
    copy = tmp_path / "check"
    shutil.copytree(check, copy)
    keys = read(copy / "sealed" / "keys.json")
    keys[0]["hidden"]["kind"] = "outside"
    (copy / "sealed" / "keys.json").write_text(json.dumps(keys))
    assert exit_status("gap", "blind", "--worlds", 2, "--out", copy) == 1
    error = capsys.readouterr().err.strip()
    assert "world 0: key does not fit its commitment" in error
    assert "Traceback" not in error


@pytest.mark.parametrize(("arguments", "message"), [
    (("--worlds", 0), "--worlds: expected 1 or more"),
    (("--worlds", 1, "--full-hand", -1), "and --full-hand 0 or more"),
    (("--worlds", 1, "--seed", -1), "--seed: expected 0 or more, found -1"),
    (("--worlds", 1, "--jobs", 0), "--jobs: expected 1 or more, found 0"),
])  # fmt: skip
def test_wrong_numbers_are_refused_in_one_line(arguments, message, capsys, tmp_path):
    assert exit_status("gap", "blind", *arguments, "--out", tmp_path / "check") == 1
    assert message in capsys.readouterr().err
    assert not (tmp_path / "check").exists()


def test_a_check_that_may_begin_no_world_scores_none(tmp_path, capsys):
    out = tmp_path / "check"
    assert exit_status("gap", "blind", "--worlds", 3, "--minutes", 0, "--jobs", 1, "--out", out) == 0
    assert read(out / "score.json")["worlds"] == 0
    assert "0 worlds gave a report" in capsys.readouterr().out
    assert exit_status("gap", "blind", "--worlds", 3, "--minutes", -1, "--out", out) == 1
    assert "--minutes: expected 0 or more, found -1" in capsys.readouterr().err
