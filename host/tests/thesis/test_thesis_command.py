"""`taxel thesis` on a small campaign: tables, figures, findings, refused input."""

import csv
import json
import shutil

import h5py
import pytest
from matplotlib.figure import Figure

from host.tests.command_line import run_taxel
from taxel.cloud.accumulate import accumulate
from taxel.cloud.match import compute_likelihoods, match
from taxel.cloud.models import get_builtin_models
from taxel.output.figure import save_figure
from taxel.recording.grasp_dataset import GraspDataset
from taxel.thesis import figures, shape_matching
from taxel.thesis.skill import GROUPS, STATISTICS
from taxel.thesis.statements import STATEMENTS

DRAWN_FIGURES = {"figure_5_3", "figure_5_9", "figure_I_4"}
"""Figures that the quick tests draw: one of a grasp, one of the treatment, one of the shares."""


@pytest.fixture(scope="module")
def output(campaign, tmp_path_factory):
    """Run the command once with fewer models and figures; return its output folder."""
    out = tmp_path_factory.mktemp("thesis")
    with pytest.MonkeyPatch.context() as patch:
        # One more model than the objects: each model costs half a second.
        patch.setattr(shape_matching, "get_builtin_models", lambda: {"sphere": get_builtin_models()["sphere"]})
        # Most figures are constructed only, because the drawing of all takes as long as the analysis.
        patch.setattr(figures, "save_figure", draw_some_figures)
        run_thesis(campaign, out)
    return out


def draw_some_figures(figure, path, **options):
    """Save a figure of `DRAWN_FIGURES`; save an empty picture instead of any other figure."""
    save_figure(figure if path.stem in DRAWN_FIGURES else Figure(figsize=(1, 1)), path, **options)


def run_thesis(campaign, out):
    """Run `taxel thesis` on the small campaign without the gap diagnosis; it must succeed."""
    assert run_taxel("thesis", "--real", campaign[0], "--sim", campaign[1], "--no-gap", "--out", out) == 0


def test_every_table_and_figure_is_written(output):
    tables = {path.name for path in (output / "tables").iterdir()}
    assert {f"table_I_{number}.csv" for number in range(1, 19)} <= tables
    assert {f"table_5_{number}.csv" for number in (1, 2, 3, 4, 5, 13)} <= tables
    pictures = {path.name for path in (output / "figures").iterdir()}
    numbers = ["5_3", *(f"5_{number}" for number in range(6, 15)), *(f"I_{number}" for number in range(2, 7))]
    assert pictures == {f"figure_{number}.png" for number in numbers}
    page = (output / "thesis.html").read_text()
    assert page.count("<img ") == len(numbers) == 15
    assert page.count("<h3>Table ") == 24


def test_page_contains_the_inconsistencies_of_the_thesis(output):
    assert "Inconsistencies of the thesis" in (output / "thesis.html").read_text()


@pytest.mark.slow
def test_every_figure_is_drawn(campaign, tmp_path):
    run_thesis(campaign, tmp_path)
    pictures = [path.read_bytes() for path in sorted((tmp_path / "figures").iterdir())]
    assert len({len(picture) for picture in pictures}) == 15  # no picture is a copy of another one
    assert min(len(picture) for picture in pictures) > 10_000


def test_every_statement_is_reported_as_a_finding_with_numbers_and_a_reason_if_not_reproduced(output):
    summary = json.loads((output / "thesis.json").read_text())
    by_key = {finding["key"]: finding for finding in summary["findings"]}
    assert len(by_key) == len(STATEMENTS)
    # The numbers of the finding "denser" are ratios of the number of real points to the number of simulated points.
    assert by_key["denser"]["numbers"]["cylindrical"] > 1.0
    assert set(by_key["simulation_nearer"]["holds"]) == {"rectangular", "cylindrical", "triangular"}
    assert all(finding["reason"] for finding in by_key.values() if not finding["reproduced"])


def test_all_findings_but_the_contradicted_one_are_counted(output):
    summary = json.loads((output / "thesis.json").read_text())
    assert summary["counted"] == len(STATEMENTS) - 1
    assert summary["reproduced"]["median"] <= summary["counted"]


def test_page_states_that_the_datasets_existed(output):
    assert "Existing datasets" in (output / "thesis.html").read_text()


def test_identified_shapes_are_reported_for_whole_clouds_and_single_approaches_and_two_sets_of_models(output):
    shapes = {
        (item["group"], item["models"]): item for item in json.loads((output / "thesis.json").read_text())["shapes"]
    }
    assert set(shapes) == {(group, models) for group in ("whole clouds", "single approaches") for models in (3, 4)}
    assert shapes["single approaches", 3]["median"] >= 65.0  # percent; chance gives 33
    assert "single approaches, 3 models" in (output / "thesis.html").read_text()


def test_skill_below_one_is_reported_for_every_group_and_statistic(output):
    """A skill of 1 means that the values equal the printed values of the thesis.

    A skill of 0 means that the values are as near to the printed values as the best constant.
    """
    values = json.loads((output / "thesis.json").read_text())["skill"]
    skills = {(item["group"], item["statistic"]): item["median"] for item in values}
    assert {group for group, _ in skills} == set(GROUPS)
    assert all((group, column) in skills for group in GROUPS for column in STATISTICS)
    assert all(value < 1.0 for value in skills.values())  # the small board does not reproduce the hand of the thesis


def test_real_clouds_with_wide_and_displaced_contacts_have_larger_mean_distances_to_the_model(output):
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


def compute_likelihoods_of_cylinder(campaign):
    """Return the real cloud of the cylinder, two models, and the likelihoods of the grasps for these models."""
    with GraspDataset(campaign[0]) as data:
        cloud = accumulate(data, "cylinder")
    models = {name: mesh for name, mesh in get_builtin_models().items() if name in ("cylinder", "sphere")}
    return cloud, models, compute_likelihoods(cloud, models)


def test_best_model_of_each_approach_is_that_of_the_match(campaign):
    """`find_best_model` finds the same model as the complete comparison `match` with the same likelihoods."""
    cloud, models, likelihoods = compute_likelihoods_of_cylinder(campaign)
    for approach in cloud.approaches:
        part = cloud.select_approach(approach)
        expected = match(part, models, likelihoods=likelihoods, bootstrap_samples=0).best
        assert shape_matching.find_best_model(part, likelihoods, tuple(models)) == expected


def test_cloud_without_points_has_no_best_model(campaign):
    cloud, models, likelihoods = compute_likelihoods_of_cylinder(campaign)
    empty = cloud.select(cloud.counts < 0.0)
    assert shape_matching.find_best_model(empty, likelihoods, tuple(models)) is None
