"""`taxel thesis` on a small campaign: tables, figures, findings, refused input."""

import csv
import json
import shutil

import h5py
import pytest

from host.tests.command_line import run_taxel


@pytest.fixture(scope="module")
def output(campaign, tmp_path_factory):
    """Output folder of one run."""
    out = tmp_path_factory.mktemp("thesis")
    assert run_taxel("thesis", "--real", campaign[0], "--sim", campaign[1], "--no-gap", "--out", out) == 0
    return out


def test_every_table_and_figure_is_written(output):
    tables = {path.name for path in (output / "tables").iterdir()}
    assert {f"table_I_{number}.csv" for number in range(1, 19)} <= tables
    assert {f"table_5_{number}.csv" for number in (2, 3, 4, 5, 13)} <= tables
    figures = {path.name for path in (output / "figures").iterdir()}
    assert figures == {f"figure_5_{number}.png" for number in range(6, 15)}
    page = (output / "thesis.html").read_text()
    assert page.count("<img ") == 9
    assert page.count("<h3>Table ") == 23
    assert "Inconsistencies of the thesis" in page


def test_findings_are_reported_with_their_numbers(output):
    summary = json.loads((output / "thesis.json").read_text())
    assert [finding["number"] for finding in summary["findings"]] == list(range(1, 13))
    by_number = {finding["number"]: finding for finding in summary["findings"]}
    assert by_number[1]["numbers"]["cylindrical"] > 1.0
    assert set(by_number[2]["holds"]) == {"rectangular", "cylindrical", "triangular"}


def test_identified_shapes_are_counted(output):
    summary = json.loads((output / "thesis.json").read_text())
    results = {result["says"]: result["numbers"] for result in summary["besides"]}
    whole_clouds = results["shapes identified among 6 models: whole clouds, real and simulated"]
    assert all(count.endswith(" of 2") for count in whole_clouds.values())
    single_approaches = results["shapes identified among 3 models: single approaches, real and simulated"]
    assert set(single_approaches) == {"rectangular", "cylindrical", "triangular"}
    assert all(count.endswith(" of 4") for count in single_approaches.values())
    assert sum(int(count.split()[0]) for count in single_approaches.values()) >= 8
    assert "single approaches, real and simulated" in (output / "thesis.html").read_text()


def test_agreement_of_distances_is_reported_with_the_largest_deviation(output):
    agreement = json.loads((output / "thesis.json").read_text())["distances"]
    assert agreement["factor"] == 1.5
    assert (
        agreement["near"] < agreement["distances"] <= 234
    )  # the small board does not reproduce the hand of the thesis
    assert "largest deviation: Table I-" in (output / "thesis.html").read_text()


def test_wide_and_displaced_contacts_have_larger_distances_to_the_model(output):
    with (output / "tables" / "table_5_3.csv").open() as file:
        rows = {(row["object"], row["side"]): float(row["mean_m_ours"]) for row in csv.DictReader(file)}
    for name in ("rectangular", "cylindrical", "triangular"):
        assert rows[name, "real"] > rows[name, "sim"]


def test_real_dataset_without_a_simulated_one_is_refused(capsys, campaign, tmp_path):
    assert run_taxel("thesis", "--real", campaign[0], "--out", tmp_path / "out") == 1
    assert "--real and --sim: expected both or none" in capsys.readouterr().err


def test_object_without_a_grasp_is_refused(capsys, campaign, tmp_path):
    """A dataset can contain the mesh of an object that was never grasped."""
    incomplete = tmp_path / "real.h5"
    shutil.copyfile(campaign[0], incomplete)
    with h5py.File(incomplete, "r+") as file:
        for name in [name for name, grasp in file["grasps"].items() if grasp.attrs["object"] == "rectangular_prism"]:
            del file["grasps"][name]
    assert run_taxel("thesis", "--real", incomplete, "--sim", campaign[1], "--no-gap", "--out", tmp_path / "out") == 1
    assert f"{incomplete}: rectangular_prism: expected grasps of this object, found none;" in capsys.readouterr().err


def test_negative_seed_is_refused(capsys, tmp_path):
    assert run_taxel("thesis", "--seed", "-1", "--out", tmp_path / "out") == 2
    assert "--seed" in capsys.readouterr().err
