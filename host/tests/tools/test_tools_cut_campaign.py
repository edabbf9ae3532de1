"""The campaign of power cuts (tools/flash): its plan, its detection of bricked and damaged devices, and a short run."""

import importlib
import json
import sys
from pathlib import Path

import pytest

from taxel.errors import TaxelError

ROOT = Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tools" / "flash"))
try:
    cut_plan, cut_runs, cut_table, cut_routes, power_cuts, flash_speed = (
        importlib.import_module(name)
        for name in ("cut_plan", "cut_runs", "cut_table", "cut_routes", "power_cuts", "flash_speed")
    )
finally:
    sys.path.remove(str(ROOT / "tools" / "flash"))

SEED = 7


def make_world_plan(route="board, through an adapter", sequences=((2, 1, 0.005),), seed=SEED):
    """Create the plan of one world.

    sequences: one update each, as (rows of the image, number of the flash operation to cut, seconds into this
    operation).
    """
    cuts = tuple(cut_plan.CutSequence(rows, (cut_plan.Cut(operation, after),)) for rows, operation, after in sequences)
    return cut_plan.WorldPlan(0, seed, route, False, cuts)


def test_a_short_campaign_leaves_the_old_or_the_new_version_after_each_cut(tmp_path, capsys):
    status = power_cuts.main(
        f"--cuts 200 --seed {SEED} --jobs 2 --json {tmp_path / 'c.json'} --page {tmp_path / 'page.md'}".split()
    )
    output = capsys.readouterr().out
    print(output)
    assert status == 0
    assert f"seed {SEED}: " in output
    document = json.loads((tmp_path / "c.json").read_text())
    assert document["cuts"] >= 200
    assert (document["outcomes"]["bricked"], document["outcomes"]["damaged"], document["failures"]) == (0, 0, [])
    # Cuts before and after the point at which the new image becomes effective both occur often.
    assert document["outcomes"]["old"] > 50 < document["outcomes"]["new"] + document["outcomes"]["cut_again"]
    assert all(sum(counts.values()) for counts in document["by_operation"].values())
    assert document["torn_rows"] > 100
    # Longest time without a frame of a second board, which keeps its power while the first board loses it.
    assert document["longest_gap_of_the_board_beside_s"] < 0.2
    page = (tmp_path / "page.md").read_text()
    assert "**Bricked: 0. Damaged images or records: 0.**" in page
    assert "{" not in page


def test_every_write_of_an_update_is_cut_at_every_point():
    plans = cut_plan.plan_worlds(10_000, 1)
    sequences = [sequence for plan in plans for sequence in plan.sequences if plan.route == "board, through an adapter"]
    first_cuts = {(sequence.rows, sequence.cuts[0].operation, sequence.cuts[0].after_s) for sequence in sequences}
    assert first_cuts == {
        (rows, operation, after)
        for rows in cut_plan.ROWS
        for operation in range(1, rows + 4)  # the rows, the record of the pending image, the attempt, the confirmation
        for after in cut_plan.POINTS_S
    }
    assert sum(len(sequence.cuts) for plan in plans for sequence in plan.sequences) >= 10_000
    assert {plan.route for plan in plans} == set(cut_plan.ROUTES)


def test_the_plan_of_the_cuts_depends_only_on_the_seed():
    assert cut_plan.plan_worlds(500, 1) == cut_plan.plan_worlds(500, 1)
    assert cut_plan.plan_worlds(500, 1) != cut_plan.plan_worlds(500, 2)


def test_a_repeated_world_has_the_same_cuts():
    plan = cut_plan.plan_worlds(60, SEED)[0]
    first_run, second_run = power_cuts.run_world(plan), power_cuts.run_world(plan)
    assert first_run == second_run
    assert first_run.cut_records


def test_an_interrupted_operation_is_named_by_the_data_to_be_written():
    """Two rows, pending, a boot attempt, confirmed; each is cut before it is written."""
    plan = make_world_plan(sequences=[(2, operation, 0.0) for operation in range(1, 6)])
    result = power_cuts.run_world(plan)
    assert not result.failures
    assert [cut.operation for cut in result.cut_records] == [
        "row of the image",
        "row of the image",
        "image made pending",
        "try counted",
        "image confirmed",
    ]
    assert {cut.moment for cut in result.cut_records} == {"before"}


def test_a_board_that_does_not_start_is_reported_as_bricked(monkeypatch):
    versions = iter([(0, 1, 0)])  # the version before the update; every later reading returns None
    monkeypatch.setattr(cut_routes.BoardRoute, "version", lambda self: next(versions, None))
    result = power_cuts.run_world(make_world_plan())
    assert [cut.outcome for cut in result.cut_records] == ["bricked"]
    assert "bricked: expected version (0, 1, 0) or (1, 0, 0), found None" in result.failures[0]
    tally = cut_table.build_tally([result])
    assert "1 bricked" in cut_table.render_text(tally, SEED)
    assert "FAILED: world 0, sequence 0" in cut_table.render_text(tally, SEED)


def test_a_changed_slot_in_use_is_reported_as_damaged(monkeypatch):
    """Each read of the slot returns one byte more than the read before, as if a bootloader had changed the slot."""
    monkeypatch.setattr(cut_runs._Update, "_read_slot", lambda self, flash, slot: flash[: next(lengths)])
    lengths = iter(range(100))
    result = power_cuts.run_world(make_world_plan())
    assert [cut.outcome for cut in result.cut_records] == ["damaged"]


def test_a_running_image_that_differs_from_the_file_is_reported_as_damaged(monkeypatch):
    plan = make_world_plan(sequences=[(2, 5, 0.0204)])  # cut after the fifth and last write of the update
    other_firmware = cut_runs.make_firmware_images(cut_runs.BootDevice.BOARD, 2, (1, 0, 0), seed=99)
    update = cut_routes.BoardRoute.update
    monkeypatch.setattr(cut_routes.BoardRoute, "update", lambda self, firmware: update(self, other_firmware))
    result = power_cuts.run_world(plan)
    assert [cut.outcome for cut in result.cut_records] == ["damaged"]


def test_an_update_that_never_succeeds_is_a_failure(monkeypatch):
    def refuse(self, firmware):
        raise TaxelError("no")

    monkeypatch.setattr(cut_routes.BoardRoute, "update", refuse)
    result = power_cuts.run_world(make_world_plan())
    assert "6 runs of the command did not finish the update; the last run ended with: no" in result.failures[0]


def test_a_hub_that_does_not_poll_is_a_failure(monkeypatch):
    monkeypatch.setattr(cut_routes, "NEIGHBOUR", 0x52)
    result = power_cuts.run_world(make_world_plan())
    assert "the hub has stopped polling board 0x52" in result.failures[0]


def test_a_campaign_with_a_failure_ends_with_status_1(monkeypatch, capsys):
    failed = cut_runs.WorldResult(0, "board, through an adapter", [cut_runs.CutRecord("configuration", "after", "old")])
    failed.failures.append("why")
    monkeypatch.setattr(power_cuts, "run_worlds", lambda plans, jobs: iter([failed]))
    assert power_cuts.main(["--cuts", "10"]) == 1
    assert "FAILED: why" in capsys.readouterr().out


def test_flow_control_and_concurrent_updates_shorten_the_measured_duration_of_updates(tmp_path, capsys):
    assert flash_speed.main(["--rows", "4", "--json", str(tmp_path / "s.json")]) == 0
    figures = json.loads((tmp_path / "s.json").read_text())
    flow_control, no_flow_control = figures["boards"][0], figures["boards"][1]
    assert flow_control["at_once_s"] < no_flow_control["at_once_s"] < no_flow_control["serial_s"]
    assert "the hub, each way: " in capsys.readouterr().out


@pytest.mark.parametrize(("after_s", "moment"), [(0.0, "before"), (0.004, "erasing"), (0.01, "programming")])
def test_the_phases_of_a_write_are_named(after_s, moment):
    assert cut_plan.name_moment(after_s) == moment
