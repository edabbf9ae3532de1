"""`taxel gap next`: ranking of further contacts by the information that they add to a diagnosis."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.effects.gain_mismatch import GainMismatch
from taxel.gap.effects.latency import Latency
from taxel.gap.effects.proximity import Proximity
from taxel.gap.effects.stiffness import Stiffness
from taxel.gap.experiment_design.candidates import generate_batches
from taxel.gap.experiment_design.contact_variance import ContactVariance
from taxel.gap.experiment_design.findings import Findings, fit_rivals
from taxel.gap.experiment_design.information import CandidatePrediction, CompositeInformation
from taxel.gap.experiment_design.ranking import rank_next_contacts
from taxel.gap.experiment_design.unrecorded_approaches import read_unrecorded
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.identifiability.identify import compute_similarities
from taxel.gap.page import write_page

GAIN, STIFF = "gain_mismatch", "stiffness"
TRIPLE_FORCE_BATCH = 4
"""Index of the batch with three times the force: after the repetition and the force factors 0.25, 0.5 and 2."""

INCLUDED = {"latency", "gain_mismatch", "stiffness", "hysteresis"}
SMALL_FORCE_N = 0.15
"""Force in N: a tenth of the half-force of the sensor model, so that the signal is nearly linear in the force."""


def soften(force, signal_counts):
    return 2000.0 * force / (force + 1.5 * 0.7)


def delay_first_board(force, signal_counts):
    """Delay the signal of the first board by 3 frames."""
    delayed = signal_counts.copy()
    delayed[3:, : signal_counts.shape[1] // 2] = signal_counts[:-3, : signal_counts.shape[1] // 2]
    return delayed


def make_fit_data(paths) -> FitData:
    pair = read_pair(*paths)
    return prepare_pair(pair)


def make_findings(fit_data, named, *others) -> Findings:
    """Return the findings of a diagnosis that names one effect, with the fitted rivals `others`."""
    composite = fit_data.fit_in_sample(CompositeModel((named,))).composite
    starts = {(named.effect.name, other.effect.name): [other] for other in others}
    return Findings(fit_data, composite, (named.effect.name,), fit_rivals(fit_data, composite, starts), ())


def make_effect(fit_data, effect, *values) -> FittedEffect:
    """Return an effect at its neutral values plus `values`, one for each parameter."""
    return FittedEffect(effect, effect.make_neutral_values(fit_data.state) + np.reshape(values, (-1, 1)))


def make_confounded_findings(fit_data) -> Findings:
    """Return the findings of a diagnosis that names a stiffness, confounded with a gain of each board."""
    return make_findings(
        fit_data, make_effect(fit_data, Stiffness(), 0.0), make_effect(fit_data, GainMismatch("board", 0.5), 0.0)
    )


@pytest.fixture(scope="module")
def small_force_pair(write_world, tmp_path_factory):
    """A softer real layer at forces so small that a larger gain has the same effect."""
    paths = write_world(
        tmp_path_factory.mktemp("small_force"), effect=soften, largest_force_n=SMALL_FORCE_N, sessions=3
    )
    return paths, make_fit_data(paths)


def compute_stiffness_angle(fit_data) -> float:
    """Return the angle in degrees between the change by the fitted stiffness and the changes that gains of boards can
    produce.
    """
    forms = {STIFF: (Stiffness(),), GAIN: (GainMismatch("board", 0.5),)}
    composite = fit_data.fit_in_sample(CompositeModel((make_effect(fit_data, Stiffness(), 0.0),))).composite
    stiffness = composite.fitted_effects[0]
    return next(one.angle_deg for one in compute_similarities(fit_data, forms, [stiffness]) if one.name == STIFF)


def test_larger_forces_are_proposed_first_for_effects_confounded_at_one_force(small_force_pair):
    found = rank_next_contacts(make_confounded_findings(small_force_pair[1]))
    assert found.criterion == "Confounded effects: stiffness and gain mismatch."
    assert len(found.contacts) == 10
    first = found.contacts[0]
    assert (first.contact.force_scale, first.separates) == (3.0, (STIFF, GAIN))
    assert first.contact.description.endswith("with 3 times the force")
    assert "standard deviations" in first.reason
    gains = [one.gain for one in found.contacts]
    assert gains == sorted(gains, reverse=True)
    assert {one.contact.force_scale for one in found.contacts} <= {2.0, 3.0}


def test_grasps_at_three_times_the_force_increase_the_angle_between_stiffness_and_gain(
    small_force_pair, write_world, tmp_path
):
    two_force_levels = make_fit_data(
        write_world(tmp_path, effect=soften, largest_force_n=SMALL_FORCE_N, sessions=3, force_scales=(1.0, 3.0))
    )
    assert compute_stiffness_angle(two_force_levels) > 1.5 * compute_stiffness_angle(small_force_pair[1])


def test_separation_and_variances_after_a_new_grasp_equal_a_fit_to_all_grasps(small_force_pair):
    """Reference: a linear fit whose rows are the recorded features, those of the new grasp, and the priors."""
    fit_data = small_force_pair[1]
    findings = make_confounded_findings(fit_data)
    found, other = (
        CompositeInformation.compute(fit_data, composite)
        for composite in (findings.composite, findings.rivals[STIFF, GAIN])
    )
    batches = list(generate_batches(fit_data.state, is_recorded=True, is_time_dependent=False, has_proximity=False))
    batch = batches[TRIPLE_FORCE_BATCH]
    prediction, rival_prediction = (
        CandidatePrediction.compute(found, batch.state),
        CandidatePrediction.compute(other, batch.state),
    )
    weight = ContactVariance.estimate(fit_data).compute_weight(batch.state.mean, prediction.features)
    old_difference, new_difference = other.features - found.features, rival_prediction.features - prediction.features
    # The new grasp repeats contact 2 of the batch. The design matrix has one column for each block of a parameter.
    contact = 2
    columns = []
    for column, new_column in zip(other.columns, rival_prediction.columns, strict=True):
        for block in range(column.count):
            rows = [one.change * (one.blocks == block)[:, None] for one in (column, new_column)]
            part = [np.sqrt(fit_data.weight) * rows[0], (np.sqrt(weight) * rows[1])[contact : contact + 1]]
            prior = np.zeros(2)
            prior[block] = np.sqrt(column.precision[block])
            columns.append(np.concatenate([part[0].ravel(), part[1].ravel(), prior]))
    target = [
        np.sqrt(fit_data.weight) * old_difference,
        (np.sqrt(weight) * new_difference)[contact : contact + 1],
        np.zeros(2),
    ]
    design, target = np.transpose(columns), np.concatenate([one.ravel() for one in target])
    residual = target - design @ np.linalg.lstsq(design, target, rcond=None)[0]
    after = other.compute_remaining(old_difference).compute_squared_length_after(
        rival_prediction.compute_added(contact, weight), new_difference[contact]
    )
    assert after == pytest.approx(float(residual @ residual), rel=1e-6)
    variance = np.diag(np.linalg.inv(design.T @ design))
    assert other.compute_variance_after(rival_prediction.compute_added(contact, weight)) == pytest.approx(
        variance, rel=1e-6
    )


def test_without_confounded_effects_grasps_are_ranked_by_interval_reduction(write_world, tmp_path):
    fit_data = make_fit_data(write_world(tmp_path, effect=delay_first_board, conditions=4, sessions=3))
    found = rank_next_contacts(make_findings(fit_data, make_effect(fit_data, Latency(), 0.05)), limit=40)
    assert found.criterion.startswith("No effects are confounded")
    first = found.contacts[0]
    assert first.separates[0].startswith("seconds of latency, ")
    assert "standard error" in first.reason
    assert first.contact.closing_scale < 1.0
    assert not any(" by 0 %" in one.reason or not one.reason for one in found.contacts)
    # A fast closing shows a latency better than a closing that is four times slower (`closing_scale` 4).
    gains = {
        (one.contact.approach, one.contact.closing_scale): one.gain
        for one in found.contacts
        if not one.contact.hold_scale > 1
    }
    quick = first.contact.closing_scale
    assert all(gains.get((f"press_{k}", 4.0), 0.0) < gains[f"press_{k}", quick] for k in range(4))


def test_a_proximity_effect_proposes_approaches_without_contact(small_force_pair):
    fit_data = small_force_pair[1]
    proximity = make_effect(fit_data, Proximity(), 0.0, 40.0)  # differences from the neutral range and counts
    found = rank_next_contacts(Findings(fit_data, CompositeModel((proximity,)), ("proximity",), {}, ()), limit=100)
    without_contact = [one for one in found.contacts if one.contact.apart_mm]
    assert without_contact
    assert without_contact[0].contact.description.endswith("held at a distance of 2 mm")


def test_without_a_named_effect_no_grasp_is_proposed(small_force_pair):
    found = rank_next_contacts(Findings(small_force_pair[1], CompositeModel(), (), {}, ()))
    assert found.contacts == ()
    assert "The verdict has no effect" in found.criterion


def test_simulated_approaches_are_ranked_together_with_recorded_approaches(small_force_pair, write_world, tmp_path):
    (tmp_path / "more").mkdir()
    more = write_world(tmp_path / "more", largest_force_n=SMALL_FORCE_N, conditions=3, force_scales=(1.0, 20.0))[1]
    fit_data = small_force_pair[1]
    state = read_unrecorded(fit_data.state, more, known=[("cube", "press_4")])
    assert state is None  # all six conditions are recorded
    with h5py.File(more, "r+") as file:
        for grasp in file["grasps"].values():
            grasp.attrs["approach"] = "hard_" + grasp.attrs["approach"]
    state = read_unrecorded(fit_data.state, more)
    assert len(state.pair.conditions) == 6
    found = rank_next_contacts(make_confounded_findings(fit_data), [state])
    assert not found.contacts[0].contact.is_recorded
    # The simulated conditions 3 to 5 have 20 times the force of the conditions 0 to 2.
    assert found.contacts[0].contact.approach in ("hard_press_3", "hard_press_4", "hard_press_5")
    assert "not yet recorded" in found.contacts[0].contact.description


# --- the command


@pytest.fixture(scope="module")
def diagnosed(write_world, tmp_path_factory):
    """Paths of both datasets (the real one has four of six simulated conditions), and the report of their diagnosis."""
    folder = tmp_path_factory.mktemp("diagnosed")
    paths = write_world(folder, effect=delay_first_board, recorded_conditions=4, sessions=3)
    exclusions = [word for name in sorted(set(OWN_EFFECTS) - INCLUDED) for word in ("--without", name)]
    assert run_taxel("gap", "diagnose", *paths, "--out", folder, *exclusions) == 0
    return paths, folder / "report.json"


def test_report_and_page_contain_the_proposed_grasps(diagnosed, tmp_path):
    report = json.loads(diagnosed[1].read_text())
    assert report["verdict"]["effects"][0] == "latency"
    contacts = report["next_presses"]
    assert 0 < len(contacts) <= 10
    assert {"press", "object", "approach", "force_scale", "separates", "gain", "why"} <= set(contacts[0])
    assert any(not one["recorded"] for one in contacts)
    write_page(report, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert "All recommended contacts" in page
    assert contacts[0]["press"] in page


def test_proposals_from_a_report_equal_the_proposals_of_its_diagnosis(capsys, diagnosed):
    paths, report = diagnosed
    assert run_taxel("gap", "next", report, "--json", "--top", 3) == 0
    proposals = json.loads(capsys.readouterr().out)
    diagnosis = json.loads(report.read_text())["next_presses"][:3]
    assert [one["press"] for one in proposals["next_presses"]] == [one["press"] for one in diagnosis]
    for one, other in zip(proposals["next_presses"], diagnosis, strict=True):
        assert one["gain"] == pytest.approx(other["gain"], rel=0.02)
    assert run_taxel("gap", "next", report, "--candidate", paths[1]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "all approaches of this dataset are recorded already" in out
    assert proposals["next_presses"][0]["press"].split()[-1] in out


def test_a_grasp_that_separates_two_rivals_is_proposed_for_a_report_that_names_no_effect(
    capsys, small_force_pair, tmp_path
):
    paths, _ = small_force_pair
    assert run_taxel("gap", "diagnose", *paths, "--out", tmp_path) == 0
    report = json.loads((tmp_path / "report.json").read_text())
    report["verdict"] |= {"status": "unknown", "effects": ["unknown"], "confounded_with": {STIFF: [GAIN]}}
    path = tmp_path / "either.json"
    path.write_text(json.dumps(report))
    capsys.readouterr()
    assert run_taxel("gap", "next", path, "--json") == 0
    proposed = json.loads(capsys.readouterr().out)["next_presses"]
    assert {STIFF, GAIN} <= set(proposed[0]["separates"])


def test_no_grasp_is_proposed_for_a_dropout(capsys, write_world, tmp_path):
    def silence_second_board(raw, valid, rng):
        valid = valid.copy()
        valid[:, 1] = False
        return raw, valid

    paths = write_world(tmp_path, raw_effect=silence_second_board, conditions=3, sessions=3)
    assert run_taxel("gap", "diagnose", *paths, "--out", tmp_path) == 0
    capsys.readouterr()
    assert json.loads((tmp_path / "report.json").read_text())["next_presses"] == []
    assert run_taxel("gap", "next", tmp_path / "report.json") == 0
    assert "no parameters that a further grasp could determine" in capsys.readouterr().out


def test_invalid_input_gives_one_error_line(capsys, diagnosed, small_force_pair, tmp_path):
    paths, report = diagnosed
    assert "SIM.h5" in run_refused_command(capsys, "gap", "next", paths[0])
    assert run_taxel("gap", "next", report, "--top", 0) == 2
    assert "'--top'" in capsys.readouterr().err
    assert "no-such" in run_refused_command(capsys, "gap", "next", tmp_path / "no-such.json")
    assert "/source" in run_refused_command(capsys, "gap", "next", report, "--candidate", paths[0])
    assert "sim.h5" in run_refused_command(capsys, "gap", "next", report, "--candidate", tmp_path / "sim.h5")
    other = tmp_path / "other.h5"
    other.write_bytes(Path(paths[1]).read_bytes())
    with h5py.File(other, "r+") as file:
        file["taxels/position"][3] = 0.5
    assert "/taxels/position[3]" in run_refused_command(capsys, "gap", "next", report, "--candidate", other)
    other.write_bytes(Path(paths[1]).read_bytes())
    with h5py.File(other, "r+") as file:
        for grasp in file["grasps"].values():
            grasp.attrs["approach"] = "new"
            del grasp["contact_force"], grasp["separation"]
    assert "contact_force" in run_refused_command(capsys, "gap", "next", report, "--candidate", other)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda report: report["inputs"]["real"].update(sha256="00"), "SHA-256 '00'"),
        (lambda report: report["inputs"]["sim"].update(path="gone.h5"), "the file gone.h5"),
        (lambda report: report["verdict"].update(confounded_with={"latency": ["magic"]}), "names of the catalogue"),
        (lambda report: report["verdict"].update(confounded_with=["latency"]), "verdict.confounded_with"),
        (lambda report: report["effects"][-1]["model"].update(blocks=[1, 2]), "latency.model.blocks"),
        (lambda report: report.pop("inputs"), "inputs"),
        (lambda report: report.update(version=3), "version"),
    ],
)
def test_a_malformed_report_gives_one_error_line(capsys, diagnosed, tmp_path, change, words):
    content = json.loads(diagnosed[1].read_text())
    assert list(OWN_EFFECTS)[-1] == content["effects"][-1]["name"] == "latency"
    change(content)
    path = tmp_path / "report.json"
    path.write_text(json.dumps(content))
    assert words in run_refused_command(capsys, "gap", "next", path)
