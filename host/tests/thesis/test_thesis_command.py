"""`taxel thesis` on a small campaign: every table, figure and finding is there, and bad input is one line."""

from __future__ import annotations

import csv
import json
import shutil

import h5py
import pytest

from host.tests.command_line import exit_status


@pytest.fixture(scope="module")
def made(campaign, tmp_path_factory):
    """The folder after one run."""
    out = tmp_path_factory.mktemp("thesis")
    assert exit_status("thesis", "--real", campaign[0], "--sim", campaign[1], "--no-gap", "--out", out) == 0
    return out


def test_every_table_and_figure_is_there(made):
    tables = {path.name for path in (made / "tables").iterdir()}
    assert {f"table_I_{number}.csv" for number in range(1, 19)} <= tables
    assert {f"table_5_{number}.csv" for number in (2, 3, 4, 5, 13)} <= tables
    figures = {path.name for path in (made / "figures").iterdir()}
    assert figures == {f"figure_5_{number}.png" for number in range(6, 15)}
    page = (made / "thesis.html").read_text()
    assert page.count("<img ") == 9
    assert page.count("<h3>Table ") == 23
    assert "Where the thesis contradicts itself" in page


def test_findings_are_told_with_their_numbers(made):
    summary = json.loads((made / "thesis.json").read_text())
    assert [one["number"] for one in summary["findings"]] == list(range(1, 13))
    by_number = {one["number"]: one for one in summary["findings"]}
    assert by_number[1]["numbers"]["cylindrical"] > 1.0
    assert set(by_number[2]["holds"]) == {"rectangular", "cylindrical", "triangular"}


def test_which_shapes_are_told_right_is_counted(made):
    besides = {one["says"]: one["numbers"] for one in json.loads((made / "thesis.json").read_text())["besides"]}
    whole = besides["shapes told right among 6 models: whole clouds of both sides"]
    assert all(told.endswith(" of 2") for told in whole.values())
    single = besides["shapes told right among 3 models: single approaches of both sides"]
    assert set(single) == {"rectangular", "cylindrical", "triangular"}
    assert all(told.endswith(" of 4") for told in single.values())
    assert sum(int(told.split()[0]) for told in single.values()) >= 8
    assert "single approaches of both sides" in (made / "thesis.html").read_text()


def test_how_near_the_distances_are_is_told_with_the_farthest(made):
    told = json.loads((made / "thesis.json").read_text())["distances"]
    assert told["factor"] == 1.5
    assert told["near"] < told["distances"] <= 234  # a small board on objects is not the thesis's hand
    assert "the farthest: Table I-" in (made / "thesis.html").read_text()


def test_a_wider_and_displaced_cloud_lies_farther_from_its_model(made):
    with (made / "tables" / "table_5_3.csv").open() as file:
        rows = {(row["object"], row["side"]): float(row["mean_m_ours"]) for row in csv.DictReader(file)}
    for name in ("rectangular", "cylindrical", "triangular"):
        assert rows[name, "real"] > rows[name, "sim"]


def test_half_a_campaign_is_refused(capsys, campaign, tmp_path):
    assert exit_status("thesis", "--real", campaign[0], "--out", tmp_path / "out") == 1
    assert "--real and --sim: expected both or none" in capsys.readouterr().err


def test_an_object_that_was_never_grasped_is_refused(capsys, campaign, tmp_path):
    """Datasets name objects; that does not mean that somebody took them in hand."""
    cut = tmp_path / "real.h5"
    shutil.copyfile(campaign[0], cut)
    with h5py.File(cut, "r+") as file:
        for name in [name for name, grasp in file["grasps"].items() if grasp.attrs["object"] == "rectangular_prism"]:
            del file["grasps"][name]
    assert exit_status("thesis", "--real", cut, "--sim", campaign[1], "--no-gap", "--out", tmp_path / "out") == 1
    assert f"{cut}: rectangular_prism: expected grasps of this object, found none;" in capsys.readouterr().err


def test_negative_numbers_are_refused(capsys, tmp_path):
    assert exit_status("thesis", "--seed", "-1", "--out", tmp_path / "out") == 2
    assert "'--seed': -1 is not in the range" in capsys.readouterr().err
