"""The campaign of power cuts (tools/flash): what it cuts, that it would see a brick, and a short form of it."""

from __future__ import annotations

import importlib
import json
import sys
from pathlib import Path

import pytest

from taxel.errors import TaxelError

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools" / "flash"))
try:
    cut_plan, cut_runs, cut_table, cut_target, power_cuts, flash_speed = (
        importlib.import_module(name)
        for name in ("cut_plan", "cut_runs", "cut_table", "cut_target", "power_cuts", "flash_speed")
    )
finally:
    sys.path.remove(str(ROOT / "tools" / "flash"))

SEED = 7


def one_world(way="board, through an adapter", sequences=((2, 1, 0.005),), seed=SEED):
    """A world of these: rows, operation, seconds into its write."""
    cuts = tuple(cut_plan.CutSequence(rows, (cut_plan.Cut(operation, after),)) for rows, operation, after in sequences)
    return cut_plan.WorldPlan(0, seed, way, False, cuts)


def test_some_hundred_cuts_leave_the_old_or_the_new(tmp_path, capsys):
    status = power_cuts.main(
        f"--cuts 200 --seed {SEED} --jobs 2 --json {tmp_path / 'c.json'} --page {tmp_path / 'page.md'}".split()
    )
    out = capsys.readouterr().out
    print(out)
    assert status == 0
    assert f"seed {SEED}: " in out
    document = json.loads((tmp_path / "c.json").read_text())
    assert document["cuts"] >= 200
    assert (document["outcomes"]["bricked"], document["outcomes"]["damaged"], document["failures"]) == (0, 0, [])
    assert document["outcomes"]["old"] > 50 < document["outcomes"]["new"] + document["outcomes"]["cut_again"]
    assert all(sum(counts.values()) for counts in document["by_operation"].values())
    assert document["torn_rows"] > 100
    assert document["longest_gap_of_the_board_beside_s"] < 0.2
    page = (tmp_path / "page.md").read_text()
    assert "**Bricked: 0. Damaged images or records: 0.**" in page
    assert "{" not in page


def test_every_write_of_an_update_is_cut_at_every_point():
    plans = cut_plan.plan_worlds(10_000, 1)
    sequences = [one for plan in plans for one in plan.sequences if plan.way == "board, through an adapter"]
    firsts = {(one.rows, one.cuts[0].operation, one.cuts[0].after_s) for one in sequences}
    assert firsts == {
        (rows, operation, after)
        for rows in cut_plan.ROWS
        for operation in range(1, rows + 4)
        for after in cut_plan.POINTS_S
    }
    assert sum(len(one.cuts) for plan in plans for one in plan.sequences) >= 10_000
    assert {plan.way for plan in plans} == set(cut_plan.WAYS)


def test_the_same_seed_plans_the_same_cuts_and_another_one_others():
    assert cut_plan.plan_worlds(500, 1) == cut_plan.plan_worlds(500, 1)
    assert cut_plan.plan_worlds(500, 1) != cut_plan.plan_worlds(500, 2)


def test_a_world_that_is_run_again_gives_the_same_cuts():
    plan = cut_plan.plan_worlds(60, SEED)[0]
    first, second = power_cuts.run_world(plan), power_cuts.run_world(plan)
    assert first == second
    assert first.struck


def test_what_was_struck_is_named_by_what_was_to_be_written():
    """Two rows, pending, a try, confirmed; each cut before it happens."""
    plan = one_world(sequences=[(2, operation, 0.0) for operation in range(1, 6)])
    result = power_cuts.run_world(plan)
    assert not result.failures
    assert [one.operation for one in result.struck] == [
        "row of the image",
        "row of the image",
        "image made pending",
        "try counted",
        "image confirmed",
    ]
    assert {one.moment for one in result.struck} == {"before"}


def test_a_board_that_does_not_come_up_is_a_brick(monkeypatch):
    versions = iter([(0, 1, 0)])
    monkeypatch.setattr(cut_target.BoardWay, "version", lambda self: next(versions, None))
    result = power_cuts.run_world(one_world())
    assert [one.outcome for one in result.struck] == ["bricked"]
    assert "bricked: None runs, expected (0, 1, 0) or (1, 0, 0)" in result.failures[0]
    tally = cut_table.tally_of([result])
    assert "1 bricked" in cut_table.text_of(tally, SEED)
    assert "FAILED: world 0, sequence 0" in cut_table.text_of(tally, SEED)


def test_a_slot_in_use_that_was_written_is_damage(monkeypatch):
    """What a bootloader must never do: here the running image is said to have been another one."""
    monkeypatch.setattr(cut_runs._Update, "_slot", lambda self, flash, slot: flash[: next(counted)])
    counted = iter(range(100))
    result = power_cuts.run_world(one_world())
    assert [one.outcome for one in result.struck] == ["damaged"]


def test_an_image_that_runs_but_is_not_the_files_is_damage(monkeypatch):
    plan = one_world(sequences=[(2, 5, 0.0204)])
    other = cut_runs.firmware_of(cut_runs.BootDevice.BOARD, 2, (1, 0, 0), seed=99)
    update = cut_target.BoardWay.update
    monkeypatch.setattr(cut_target.BoardWay, "update", lambda self, firmware: update(self, other))
    result = power_cuts.run_world(plan)
    assert [one.outcome for one in result.struck] == ["damaged"]


def test_an_update_that_never_succeeds_is_a_failure(monkeypatch):
    def refuse(self, firmware):
        raise TaxelError("no")

    monkeypatch.setattr(cut_target.BoardWay, "update", refuse)
    result = power_cuts.run_world(one_world())
    assert "6 runs of the command did not finish the update; the last run ended with: no" in result.failures[0]


def test_a_hub_that_does_not_poll_is_a_failure(monkeypatch):
    monkeypatch.setattr(cut_target, "BESIDE", 0x52)
    result = power_cuts.run_world(one_world())
    assert "the hub has not gone on polling board 0x52" in result.failures[0]


def test_a_campaign_with_a_failure_ends_with_status_1(monkeypatch, capsys):
    failed = cut_runs.WorldResult(0, "board, through an adapter", [cut_runs.Struck("configuration", "after", "old")])
    failed.failures.append("why")
    monkeypatch.setattr(power_cuts, "run_worlds", lambda plans, jobs: iter([failed]))
    assert power_cuts.main(["--cuts", "10"]) == 1
    assert "FAILED: why" in capsys.readouterr().out


def test_the_speed_of_small_images_is_measured(tmp_path, capsys):
    assert flash_speed.main(["--rows", "4", "--json", str(tmp_path / "s.json")]) == 0
    figures = json.loads((tmp_path / "s.json").read_text())
    held, free = figures["boards"][0], figures["boards"][1]
    assert held["at_once_s"] < free["at_once_s"] < free["serial_s"]
    assert "the hub itself, each way: " in capsys.readouterr().out


@pytest.mark.parametrize(("after_s", "moment"), [(0.0, "before"), (0.004, "erasing"), (0.01, "programming")])
def test_moments_of_a_write_are_named(after_s, moment):
    assert cut_plan.moment_of(after_s) == moment
