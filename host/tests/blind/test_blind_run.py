"""`taxel gap blind` from end to end: interrupted after a world, resumed, opened and scored."""

import json
import shutil
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import h5py
import pytest

from host.tests.command_line import run_taxel
from taxel.blind import run, sampling
from taxel.blind.records import RECORDS, read_records, write_records
from taxel.blind.run_folder import seal_worlds
from taxel.blind.sandboxed_run import SandboxedRunner
from taxel.blind.version import compute_diagnosis_version
from taxel.gap.effects.catalogue import OWN_EFFECTS

SEED = 121
"""World 0 hides a lag, whose true parameters are found by a fit, and is withheld; world 1 has no cause and a decoy."""

SHORT_CATALOGUE = {"noise", "gain_mismatch", "baseline_drift", "latency"}
"""Effects in the catalogue of these diagnoses."""


INTERRUPTED_REPORT = {"effects": "of a run that was interrupted"}
"""Report of the interrupted run; the resumed run must replace it."""


def read_json(path) -> dict:
    return json.loads(path.read_text())


@pytest.fixture(scope="module")
def small_worlds():
    """Patch the run to worlds of 18 indentations, one further analysis seed and a short catalogue."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (
            ("APPROACHES", (6, 6)),
            ("SESSIONS", (3, 3)),
            ("REPEATS", (1, 1)),
            ("INDENTATIONS", (18, 18)),
        ):
            patch.setattr(sampling, name, value)
        patch.setattr(run, "ANALYSIS_SEEDS", 2)
        patch.setattr(run, "SandboxedRunner", FastRunner)
        # Threads of this process, which has imported the emulator already. They set the variable in this process.
        patch.setattr(run, "ProcessPoolExecutor", lambda count, *context, **options: ThreadPoolExecutor(count))
        patch.setenv("SOURCE_DATE_EPOCH", "")
        yield


class FastRunner(SandboxedRunner):
    """A runner with a short catalogue of effects, with which a diagnosis takes a third of the time."""

    def diagnose(self, real, sim, out, without=(), seed=0):
        super().diagnose(real, sim, out, sorted({*without, *OWN_EFFECTS} - (SHORT_CATALOGUE - set(without))), seed)


class InterruptedRunner(FastRunner):
    """Writes the report of an interrupted run, and raises KeyboardInterrupt instead of a second diagnosis."""

    def diagnose(self, real, sim, out, without=(), seed=0):
        if out.name != "report.json":
            raise KeyboardInterrupt
        out.write_text(json.dumps(INTERRUPTED_REPORT))


@pytest.fixture(scope="module")
def interrupted(small_worlds, tmp_path_factory):
    """Run a check of two worlds that is interrupted after the first report of the first world.

    Returns a copy of its folder in this state; the fixture `check` resumes the original.
    """
    out = tmp_path_factory.mktemp("blind") / "check"
    withheld_world, world_without_cause = seal_worlds(out, 2, 0, SEED)
    assert (withheld_world.hidden.names, withheld_world.is_withheld, withheld_world.is_repeated) == (
        ("latency",),
        True,
        True,
    )
    assert (world_without_cause.hidden.kind, bool(world_without_cause.decoy)) == ("none", True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "SandboxedRunner", InterruptedRunner)
        with pytest.raises(KeyboardInterrupt):
            run.run_worlds(out, [withheld_world], 1)
    shutil.copytree(out, out.parent / "interrupted")
    return out.parent / "interrupted"


@pytest.fixture(scope="module")
def check(small_worlds, interrupted):
    """Resume the interrupted check with the command; return its folder."""
    out = interrupted.parent / "check"
    options = ("--jobs", 1, "--page", out.parent / "page" / "score.md")  # one job avoids the start of a second process
    assert run_taxel("gap", "blind", "--worlds", 2, "--out", out, *options) == 0
    return out


def test_commitments_are_older_than_every_dataset(check):
    published = (check / "commitments.json").stat().st_mtime_ns
    assert len(list(check.glob("worlds/*/*.h5"))) == 5  # two pairs, and one file with exchanged simulations
    assert all(path.stat().st_mtime_ns > published for path in check.glob("worlds/**/*.*"))


def test_each_world_has_the_diagnoses_that_it_was_sampled_with(check):
    """World 0 hides a latency. Its reports: all effects; the catalogue without latency; another analysis seed; the
    simulated conditions exchanged (shuffled). World 1 has no cause; its decoy report lacks an effect that is not
    hidden.
    """
    reports = {path.name: {file.name for file in path.glob("*.json")} for path in (check / "worlds").iterdir()}
    assert reports == {
        "0000": {"report.json", "without.json", "seed1.json", "shuffled.json"},
        "0001": {"report.json", "decoy.json"},
    }
    assert "latency" in {entry["name"] for entry in read_json(check / "worlds" / "0000" / "report.json")["effects"]}
    assert "latency" not in {
        entry["name"] for entry in read_json(check / "worlds" / "0000" / "without.json")["effects"]
    }


def test_reports_state_the_isolation_and_the_baseline_verdicts_but_no_path_of_the_check(check):
    for path in check.glob("worlds/*/report.json"):
        report = read_json(path)
        assert report["blindfold"] in ("landlock and audit hook", "audit hook")
        assert set(report["simpler"]) == {"rules", "effect_blind"}
        assert set(report["simpler"].values()) <= {*OWN_EFFECTS, "no_gap"}
        assert str(check) not in path.read_text()


def test_only_the_sealed_folder_contains_hidden_causes(check):
    score_files = {"score.json", "score.md", "answers.jsonl.gz"}
    assert {path.name for path in check.iterdir()} == {"commitments.json", "sealed", "worlds", *score_files}
    assert {path.name for path in (check / "sealed").iterdir()} == {"keys.json", "reference0000.json"}


def test_all_datasets_state_the_same_creation_time(check):
    times = set()
    for path in (*check.glob("worlds/*/real*.h5"), *check.glob("worlds/*/sim*.h5")):
        with h5py.File(path) as file:
            times.add(file.attrs["created"])
    assert len(times) == 1


def test_score_of_the_two_worlds_is_written(check):
    """The single cause of world 0 is named first, and is withheld from a second diagnosis.

    Only world 1 has no cause and can have a false alarm; the number of false alarms is 0 of 1.
    """
    score = read_json(check / "score.json")
    assert (score["worlds"], score["full_hand"], score["rig4"]["errors"]) == (2, None, [])
    assert score["rig4"]["false_alarms"] == {
        "count": 0,
        "of": 1,
        "share": 0.0,
        "ci95": score["rig4"]["false_alarms"]["ci95"],
    }
    assert score["rig4"]["counts"]["single"] == {"worlds": 1, "clear": 1}
    assert score["rig4"]["single_first"]["count"] == 1
    assert score["rig4"]["unknown_withheld"]["of"] == 1


def test_score_sheet_states_command_and_version_and_is_copied_to_the_page(check):
    text = (check / "score.md").read_text()
    provenance = "written by `taxel gap blind --worlds 2`; 2 worlds gave a report. Measured version of the diagnosis: "
    assert f"{provenance}{compute_diagnosis_version()} (" in text
    assert (check.parent / "page" / "score.md").read_text() == text


def test_command_on_a_finished_check_prints_its_score_without_a_diagnosis(check, monkeypatch, capsys):
    monkeypatch.setattr(run, "SandboxedRunner", None)  # a diagnosis would fail
    assert run_taxel("gap", "blind", "--worlds", 2, "--out", check, "--json") == 0
    assert json.loads(capsys.readouterr().out) == read_json(check / "score.json")


def test_results_of_both_worlds_are_written_with_the_version_of_the_diagnosis(check):
    results = read_records(check / RECORDS)
    assert [result.world.number for result in results] == [0, 1]
    assert {result.diagnosis_version for result in results} == {compute_diagnosis_version()}


def test_results_of_a_check_are_rejected_as_results_of_a_further_run(check, capsys):
    path = check / RECORDS
    assert run_taxel("gap", "blind", "--worlds", 2, "--out", check, "--add-answers", path) == 1
    assert "expected results of another run, found the same worlds" in " ".join(capsys.readouterr().err.split())


def test_results_of_another_version_are_rejected_before_a_world_is_made(check, tmp_path, capsys):
    other_results = tmp_path / RECORDS
    write_records(other_results, [replace(result, diagnosis_version="cd") for result in read_records(check / RECORDS)])
    assert run_taxel("gap", "blind", "--worlds", 2, "--out", tmp_path / "new", "--add-answers", other_results) == 1
    assert "expected results of the same version of the diagnosis" in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "new").exists()


def test_interrupted_world_is_repeated_with_the_same_datasets(check, interrupted):
    """The resumed check makes the same bytes of both datasets, and replaces the report of the interrupted run."""
    interrupted_world, resumed_world = (folder / "worlds" / "0000" for folder in (interrupted, check))
    assert {path.name for path in interrupted_world.iterdir()} == {"real.h5", "sim.h5", "report.json"}
    for name in ("real.h5", "sim.h5"):
        assert (interrupted_world / name).read_bytes() == (resumed_world / name).read_bytes()
    assert read_json(interrupted_world / "report.json") == INTERRUPTED_REPORT
    assert read_json(resumed_world / "report.json") != INTERRUPTED_REPORT


class FakeRunner:
    """Records its requests and answers at once; in the fifth world only after the run was interrupted.

    requests: "WORLD/REPORT" of each diagnosis. is_interrupted: set when the pool of threads is shut down.
    """

    requests: ClassVar[list[str]] = []
    is_interrupted = threading.Event()

    def __init__(self, out: Path, shares_cores: bool = False) -> None:
        pass

    def diagnose(self, real: Path, sim: Path, out: Path, without=(), seed=0) -> None:
        self.requests.append(f"{out.parent.name}/{out.name}")
        if len({name.partition("/")[0] for name in self.requests}) == 5:
            assert self.is_interrupted.wait(60)
        out.write_text(json.dumps({"error": "not diagnosed"}))

    def close(self) -> None:
        pass


class SignallingPool(ThreadPoolExecutor):
    """Signals its shutdown to `FakeRunner`."""

    def shutdown(self, wait=True, *, cancel_futures=False):
        super().shutdown(wait=False, cancel_futures=cancel_futures)
        FakeRunner.is_interrupted.set()
        super().shutdown(wait)


def test_check_interrupted_after_some_worlds_resumes_with_the_remaining_ones(monkeypatch, tmp_path):
    monkeypatch.setattr(FakeRunner, "requests", [])
    monkeypatch.setattr(FakeRunner, "is_interrupted", threading.Event())
    monkeypatch.setattr(run, "SandboxedRunner", FakeRunner)
    monkeypatch.setattr(run, "ThreadPoolExecutor", SignallingPool)
    monkeypatch.setattr(run, "ProcessPoolExecutor", lambda count, *context, **options: ThreadPoolExecutor(count))
    monkeypatch.setattr(run, "_make_datasets", lambda *arguments: 0)
    monkeypatch.setattr(run, "_fit_reference", lambda *arguments: {})
    monkeypatch.setattr(run, "write_shuffled_copy", lambda *arguments: None)
    out = tmp_path / "check"
    worlds = seal_worlds(out, 9, 0, seed=2)
    progress = []

    def interrupt(done: int, total: int) -> None:
        """Interrupt the run after four finished worlds, while the fifth runs."""
        progress.append((done, total))
        if done == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run.run_worlds(out, worlds, 1, interrupt)
    finished = {path.parent.name for path in out.glob("worlds/*/done")}
    assert len(finished) == 5  # the world that had started was finished
    first_requests = set(FakeRunner.requests)
    FakeRunner.requests.clear()
    run.run_worlds(out, seal_worlds(out, 9, 0, None), 2, lambda *counts: progress.append(counts))
    assert not {name.partition("/")[0] for name in FakeRunner.requests} & finished
    diagnosed = {name.partition("/")[0] for name in first_requests | set(FakeRunner.requests)}
    assert diagnosed == {f"{number:04d}" for number in range(9)}
    assert progress[:5] == [(done, 9) for done in range(5)]
    assert progress[5:] == [(done, 9) for done in range(len(finished), 10)]


def test_another_number_of_worlds_than_in_the_folder_is_rejected(check, capsys):
    assert run_taxel("gap", "blind", "--worlds", 3, "--out", check) == 1
    assert capsys.readouterr().err.strip().endswith("choose another --out")


def test_check_with_a_changed_key_is_rejected_without_a_traceback(check, tmp_path, capsys):
    copy = tmp_path / "check"
    shutil.copytree(check, copy)
    keys = read_json(copy / "sealed" / "keys.json")
    keys[0]["hidden"]["kind"] = "outside"
    (copy / "sealed" / "keys.json").write_text(json.dumps(keys))
    assert run_taxel("gap", "blind", "--worlds", 2, "--out", copy) == 1
    error = capsys.readouterr().err.strip()
    assert "world 0: the key does not match its commitment" in error
    assert "Traceback" not in error


@pytest.mark.parametrize(
    ("option", "value"), [("--worlds", 0), ("--full-hand-worlds", -1), ("--seed", -1), ("--jobs", 0)]
)
def test_option_out_of_range_is_rejected_before_a_folder_is_made(option, value, capsys, tmp_path):
    assert run_taxel("gap", "blind", "--worlds", 1, option, value, "--out", tmp_path / "check") == 2
    assert f"'{option}': {value}" in capsys.readouterr().err
    assert not (tmp_path / "check").exists()


def test_check_with_a_time_limit_of_0_minutes_scores_no_world(tmp_path, capsys):
    out = tmp_path / "check"
    assert run_taxel("gap", "blind", "--worlds", 3, "--minutes", 0, "--jobs", 1, "--out", out) == 0
    assert read_json(out / "score.json")["worlds"] == 0
    assert "0 worlds gave a report" in " ".join(capsys.readouterr().out.split())


def test_negative_time_limit_is_rejected(tmp_path, capsys):
    assert run_taxel("gap", "blind", "--worlds", 3, "--minutes", -1, "--out", tmp_path / "check") == 2
    assert "'--minutes': -1" in capsys.readouterr().err
