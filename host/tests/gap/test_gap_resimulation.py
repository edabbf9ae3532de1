"""Simulations with the most probable sets of effects: measurement, reuse, and decision between these sets."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from taxel.cli.main import build_app
from taxel.gap.apply import resimulation
from taxel.gap.apply.resimulation import BUILTIN, Resimulator, resimulate_sets
from taxel.gap.comparison.candidates import CandidateSets
from taxel.gap.comparison.compare import compare, weigh_sets
from taxel.gap.errors import GapInputError


def amplify_signal(force, signal_counts):
    """Multiply the signal of the real skin by 1.4."""
    return 1.4 * signal_counts


@pytest.fixture(scope="module")
def comparison(get_world_paths):
    return compare(*get_world_paths(effect=amplify_signal))


def test_the_measured_gap_of_a_simulation_is_stated_and_the_dataset_is_reused(comparison, tmp_path, monkeypatch):
    simulator = Resimulator(BUILTIN, tmp_path, budget=2)
    found = resimulate_sets(comparison, simulator)
    assert 1 <= len(found.results) <= 2
    best = found.results[0]
    assert best.path.is_file()
    assert best.after < 0.5 * best.before
    assert best.shrink.value == pytest.approx(1.0 - best.after / best.before, abs=0.02)
    monkeypatch.setattr(resimulation, "add_effects", lambda *_: pytest.fail("the dataset was made again"))
    assert resimulate_sets(comparison, simulator).results == found.results


def test_simulations_decide_between_the_simulated_sets_and_leave_their_common_level(comparison):
    """A set whose simulation equals the real data gets a larger weight than a set whose simulation improves nothing.

    The sum of the held-out log densities of both sets remains the same.
    """
    keys = sorted(comparison.weights, key=lambda key: -comparison.weights[key])[:2]
    fit_data = comparison.fit_data
    perfect, useless = np.nan_to_num(fit_data.target), fit_data.state.mean
    found = CandidateSets(comparison.sets, comparison.single_fits)
    simulated = {keys[0]: useless, keys[1]: perfect}
    after = weigh_sets(fit_data, comparison.tried, found, simulated=simulated)
    assert after.weights[keys[1]] > after.weights[keys[0]]
    before = weigh_sets(fit_data, comparison.tried, found)
    level = [sum(one.sets[key].held_out.sum() for key in keys) for one in (before, after)]
    assert level[0] == pytest.approx(level[1])


def test_the_command_of_a_simulator_gets_the_effects_of_each_set(get_world_paths, tmp_path):
    real, sim = get_world_paths(effect=amplify_signal)
    script = tmp_path / "simulator.py"
    script.write_text(
        "import json, shutil, sys\n"
        "effects, sim, out, log = sys.argv[1:]\n"
        "names = [one['name'] for one in json.load(open(effects))['effects']]\n"
        "open(log, 'a').write(' '.join(names) + '\\n')\n"
        "shutil.copy(sim, out)\n"
    )
    log, out = tmp_path / "log", tmp_path / "gap"
    command = f"{sys.executable} {script} {{effects}} {{sim}} {{out}} {log}"
    words = ["gap", "diagnose", real, sim, "--out", str(out), "--resim", command, "--resim-budget", "1"]
    result = CliRunner().invoke(build_app("gap"), words)
    assert result.exit_code == 0, result.output
    report = json.loads((out / "report.json").read_text())
    (entry,) = report["resimulated"]
    assert log.read_text().split() == entry["effects"]
    assert entry["after"] == pytest.approx(entry["before"])  # this simulator ignores the effects
    assert "Simulated again with the effects" in (out / "report.html").read_text()


@pytest.mark.parametrize(("command", "message"), [("false {effects} {out}", "succeeds"), ("simulate", "{effects}")])
def test_a_wrong_command_gives_one_line(comparison, tmp_path, command, message):
    with pytest.raises(GapInputError) as caught:
        resimulate_sets(comparison, Resimulator(command, tmp_path))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_simulation_of_other_grasps_is_rejected(comparison, get_world_paths, tmp_path):
    other = Path(get_world_paths(effect=amplify_signal, conditions=4)[1])
    with pytest.raises(GapInputError, match="same taxels, conditions"):
        resimulate_sets(comparison, Resimulator(f"sh -c 'cp {other} {{out}}; : {{effects}}'", tmp_path))
