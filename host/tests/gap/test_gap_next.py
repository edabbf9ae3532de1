"""`taxel gap next`: which press would tell most of what a diagnosis leaves open."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepared
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.effects.gain_mismatch import GainMismatch
from taxel.gap.effects.latency import Latency
from taxel.gap.effects.proximity import Proximity
from taxel.gap.effects.stiffness import Stiffness
from taxel.gap.experiment_design.candidates import batches
from taxel.gap.experiment_design.contact_variance import ContactVariance
from taxel.gap.experiment_design.findings import Findings, rivals_of
from taxel.gap.experiment_design.information import CompositeInformation, Felt
from taxel.gap.experiment_design.ranking import rank_next_contacts
from taxel.gap.experiment_design.unrecorded import unrecorded
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.judge import Judge
from taxel.gap.identifiability.identify import compute_similarities
from taxel.gap.page import write_page

GAIN, STIFF = "gain_mismatch", "stiffness"
TRIED = {"latency", "gain_mismatch", "stiffness", "hysteresis"}
LITTLE_N = 0.15
"""A tenth of the force of half the drop: drops grow with force as good as linearly."""


def softer(force, signal_counts):
    return 2000.0 * force / (force + 1.5 * 0.7)


def late(force, signal_counts):
    moved = signal_counts.copy()
    moved[3:, : signal_counts.shape[1] // 2] = signal_counts[:-3, : signal_counts.shape[1] // 2]
    return moved


def judge_of(paths) -> Judge:
    pair = read_pair(*paths)
    return prepared(pair)


def findings_of(judge, link, *others) -> Findings:
    """One effect and its rivals, all fitted."""
    composite = judge.in_sample(CompositeModel((link,))).composite
    starts = {(link.effect.name, other.effect.name): [other] for other in others}
    return Findings(judge, composite, (link.effect.name,), rivals_of(judge, composite, starts), ())


def plain(judge, effect, *values) -> FittedEffect:
    return FittedEffect(effect, effect.neutral(judge.state) + np.reshape(values, (-1, 1)))


def stiff_or_gain(judge) -> Findings:
    return findings_of(judge, plain(judge, Stiffness(), 0.0), plain(judge, GainMismatch("board", 0.5), 0.0))


@pytest.fixture(scope="module")
def gentle(world, tmp_path_factory):
    """A softer hand, pressed so little that its gain might be larger as well."""
    paths = world(tmp_path_factory.mktemp("gentle"), effect=softer, most=LITTLE_N, sessions=3)
    return paths, judge_of(paths)


def angle(judge) -> float:
    forms = {STIFF: (Stiffness(),), GAIN: (GainMismatch("board", 0.5),)}
    link = judge.in_sample(CompositeModel((plain(judge, Stiffness(), 0.0),))).composite.links[0]
    return next(one.degrees for one in compute_similarities(judge, forms, [link]) if one.name == STIFF)


def test_force_levels_are_proposed_first_for_effects_confounded_at_one_force(gentle, world, tmp_path):
    found = rank_next_contacts(stiff_or_gain(gentle[1]))
    assert found.line == "Confounded effects: stiffness and gain mismatch."
    assert len(found.contacts) == 10
    first = found.contacts[0]
    assert (first.contact.force_scale, first.separates) == (3.0, (STIFF, GAIN))
    assert first.contact.words.endswith("with 3 times the force")
    assert "standard deviations" in first.why
    gains = [one.gain for one in found.contacts]
    assert gains == sorted(gains, reverse=True)
    assert {one.contact.force_scale for one in found.contacts} <= {2.0, 3.0}
    laddered = judge_of(world(tmp_path, effect=softer, most=LITTLE_N, sessions=3, scales=(1.0, 3.0)))
    assert angle(laddered) > 1.5 * angle(gentle[1])


def test_separation_of_two_effects_is_measured_on_all_grasps_together(gentle):
    judge = gentle[1]
    findings = stiff_or_gain(judge)
    found, other = (
        CompositeInformation.of(judge, composite) for composite in (findings.composite, findings.rivals[STIFF, GAIN])
    )
    batch = list(batches(judge.state, recorded=True, memory=False, near=False))[4]
    felt, rival = Felt.of(found, batch.state), Felt.of(other, batch.state)
    weight = ContactVariance.of(judge).weight(batch.state.mean, felt.features)
    apart, new = other.features - found.features, rival.features - felt.features
    contact = 2
    columns = []
    for column, own in zip(other.columns, rival.columns, strict=True):
        for block in range(column.count):
            rows = (column.change * (column.blocks == block)[:, None], own.change * (own.blocks == block)[:, None])
            part = [np.sqrt(judge.weight) * rows[0], (np.sqrt(weight) * rows[1])[contact : contact + 1]]
            prior = np.zeros(2)
            prior[block] = np.sqrt(column.precision[block])
            columns.append(np.concatenate([part[0].ravel(), part[1].ravel(), prior]))
    target = [np.sqrt(judge.weight) * apart, (np.sqrt(weight) * new)[contact : contact + 1], np.zeros(2)]
    design, target = np.transpose(columns), np.concatenate([one.ravel() for one in target])
    residual = target - design @ np.linalg.lstsq(design, target, rcond=None)[0]
    after = other.left(apart).after(rival.added(contact, weight), new[contact])
    assert after == pytest.approx(float(residual @ residual), rel=1e-6)
    spread = np.diag(np.linalg.inv(design.T @ design))
    assert other.variance_after(rival.added(contact, weight)) == pytest.approx(spread, rel=1e-6)


def test_without_confounded_effects_grasps_are_ranked_by_interval_reduction(world, tmp_path):
    judge = judge_of(world(tmp_path, effect=late, conditions=4, sessions=3))
    found = rank_next_contacts(findings_of(judge, plain(judge, Latency(), 0.05)), most=40)
    assert found.line.startswith("No effects are confounded")
    first = found.contacts[0]
    assert first.separates[0].startswith("seconds of latency, ")
    assert "standard error" in first.why
    assert first.contact.closing_scale < 1.0
    assert not any(" by 0 %" in one.why or not one.why for one in found.contacts)
    gains = {
        (one.contact.approach, one.contact.closing_scale): one.gain
        for one in found.contacts
        if not one.contact.hold_scale > 1
    }
    quick = first.contact.closing_scale
    assert all(gains.get((f"press_{k}", 4.0), 0.0) < gains[f"press_{k}", quick] for k in range(4))


def test_a_proximity_effect_proposes_approaches_without_contact(gentle):
    judge = gentle[1]
    link = plain(judge, Proximity(), 0.0, 40.0)
    found = rank_next_contacts(Findings(judge, CompositeModel((link,)), ("proximity",), {}, ()), most=100)
    off = [one for one in found.contacts if one.contact.apart_mm]
    assert off
    assert off[0].contact.words.endswith("held at a distance of 2 mm")


def test_without_a_named_effect_no_grasp_is_proposed(gentle):
    found = rank_next_contacts(Findings(gentle[1], CompositeModel(), (), {}, ()))
    assert found.contacts == ()
    assert "The verdict has no effect" in found.line


def test_simulated_approaches_are_ranked_with_recorded_ones(gentle, world, tmp_path):
    (tmp_path / "more").mkdir()
    more = world(tmp_path / "more", most=LITTLE_N, conditions=3, scales=(1.0, 20.0))[1]
    judge = gentle[1]
    state = unrecorded(judge.state, more, known=[("cube", "press_4")])
    assert state is None  # six cells, all of them recorded
    with h5py.File(more, "r+") as file:
        for grasp in file["grasps"].values():
            grasp.attrs["approach"] = "hard_" + grasp.attrs["approach"]
    state = unrecorded(judge.state, more)
    assert len(state.pair.conditions) == 6
    found = rank_next_contacts(stiff_or_gain(judge), [state])
    assert not found.contacts[0].contact.recorded
    assert found.contacts[0].contact.approach in ("hard_press_3", "hard_press_4", "hard_press_5")
    assert "not yet recorded" in found.contacts[0].contact.words


# --- the command


@pytest.fixture(scope="module")
def diagnosed(world, tmp_path_factory):
    """Two files, four of six simulated approaches recorded, and the report of their diagnosis."""
    folder = tmp_path_factory.mktemp("diagnosed")
    paths = world(folder, effect=late, recorded=4, sessions=3)
    left_out = [word for name in sorted(set(OWN_EFFECTS) - TRIED) for word in ("--without", name)]
    assert run_taxel("gap", "diagnose", *paths, "--out", folder, *left_out) == 0
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


def test_proposals_from_a_report_equal_those_from_the_files(capsys, diagnosed):
    paths, report = diagnosed
    assert run_taxel("gap", "next", report, "--json", "--top", 3) == 0
    told = json.loads(capsys.readouterr().out)
    diagnosis = json.loads(report.read_text())["next_presses"][:3]
    assert [one["press"] for one in told["next_presses"]] == [one["press"] for one in diagnosis]
    for one, other in zip(told["next_presses"], diagnosis, strict=True):
        assert one["gain"] == pytest.approx(other["gain"], rel=0.02)
    assert run_taxel("gap", "next", report, "--candidate", paths[1]) == 0
    out = " ".join(capsys.readouterr().out.split())
    assert "all approaches of this dataset are recorded already" in out
    assert told["next_presses"][0]["press"].split()[-1] in out


def test_grasps_that_separate_two_rivals_are_proposed_for_a_report_that_names_no_effect(capsys, gentle, tmp_path):
    paths, _ = gentle
    assert run_taxel("gap", "diagnose", *paths, "--out", tmp_path) == 0
    report = json.loads((tmp_path / "report.json").read_text())
    report["verdict"] |= {"status": "unknown", "effects": ["unknown"], "confounded_with": {STIFF: [GAIN]}}
    path = tmp_path / "either.json"
    path.write_text(json.dumps(report))
    capsys.readouterr()
    assert run_taxel("gap", "next", path, "--json") == 0
    proposed = json.loads(capsys.readouterr().out)["next_presses"]
    assert {STIFF, GAIN} <= set(proposed[0]["separates"])


def test_no_grasp_is_proposed_for_a_dropout(capsys, world, tmp_path):
    def silence(raw, valid, rng):
        valid = valid.copy()
        valid[:, 1] = False
        return raw, valid

    paths = world(tmp_path, after=silence, conditions=3, sessions=3)
    assert run_taxel("gap", "diagnose", *paths, "--out", tmp_path) == 0
    capsys.readouterr()
    assert json.loads((tmp_path / "report.json").read_text())["next_presses"] == []
    assert run_taxel("gap", "next", tmp_path / "report.json") == 0
    assert "no parameters that a further grasp could determine" in capsys.readouterr().out


def test_invalid_input_gives_one_error_line(capsys, diagnosed, gentle, tmp_path):
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
