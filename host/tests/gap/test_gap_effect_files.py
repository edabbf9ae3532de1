"""Effects that a Python file of the user defines."""

from __future__ import annotations

import json

import pytest

from host.tests.command_line import run_refused_command, run_taxel
from taxel.gap.effects import catalogue

FILE = """
from taxel.gap.effects.effect import Effect, Parameter


class Bend(Effect):
    name = "bend"
    order = 70

    def own_parameters(self):
        return (Parameter("bend", "1", -0.8, 0.8, 0.0, 0.1, prior=0.4),)

    def apply(self, state, signal, values):
        if not values.any():
            return signal
        (bend,) = self.spread_out(state, values)
        counts = state.to_signal_counts(signal)
        return signal.with_signal_counts(counts * (1.0 + bend * counts / 1000.0))


VARIANTS = (Bend(),)
"""


@pytest.fixture(autouse=True)
def own_catalogue(monkeypatch):
    """Remove the effects that a test adds to the catalogue."""
    monkeypatch.setattr(catalogue, "_ADDED", {})


def bend_signal(force, signal):
    return signal * (1.0 - 0.3 * signal / 1000.0)


def test_an_effect_of_a_file_is_the_most_probable_cause_and_can_be_applied(write_world, tmp_path):
    paths = write_world(tmp_path, effect=bend_signal)
    effects = tmp_path / "my.py"
    effects.write_text(FILE)
    others = [word for name in ("stiffness", "saturation", "gain_mismatch") for word in ("--without", name)]
    out = tmp_path / "out"
    assert run_taxel("gap", "diagnose", *paths, "--out", out, "--effects", effects, *others) == 0
    verdict = json.loads((out / "report.json").read_text())["verdict"]
    assert verdict["effects"][0] == "bend"
    assert "The real skin has bend" in verdict["headline"]
    applied = tmp_path / "sim2.h5"
    assert run_taxel("gap", "apply", out / "report.json", paths[1], "--out", applied, "--effects", effects) == 0
    assert applied.exists()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "expected a Python file"),
        ("import no_such_module", "ModuleNotFoundError"),
        ("VARIANTS = 3", "VARIANTS, a tuple"),
        (FILE.replace('"bend"\n', '"noise"\n'), "a name that no effect of the project has"),
    ],
)
def test_an_unsuitable_file_gives_one_error_line(capsys, tmp_path, content, words):
    effects = tmp_path / "my.py"
    if content is not None:
        effects.write_text(content)
    line = run_refused_command(
        capsys, "gap", "diagnose", "real.h5", "sim.h5", "--out", tmp_path / "out", "--effects", effects
    )
    assert words in line
