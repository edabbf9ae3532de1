"""Phases and probes of other packages, found by entry points."""

import re
from pathlib import Path

import pytest

from host.tests.bench.conftest import find_value, make_short_plan
from host.tests.plugin_package import installed_package
from taxel.plugins import BENCH_PHASES, BENCH_PROBES, PluginError
from taxel_tools.bench import registry
from taxel_tools.bench.probe import NoProbe
from taxel_tools.bench.running import load_plan_phases
from taxel_tools.errors import PlanError
from taxel_tools.testing.operator import NoOperator
from taxel_tools.testing.plan import parse_plan
from taxel_tools.testing.record import Outcome

GUIDE = Path(__file__).parents[3] / "docs" / "how-to-add-a-bench-phase.md"
SOURCE = re.search(r"```python\n(.*?)```", GUIDE.read_text(), re.DOTALL)[1]
PROBE_SOURCE = """
from taxel_tools.bench.probe import NoProbe
class QuietProbe(NoProbe):
    name = "quiet probe"
def open_quiet_probe(request):
    assert request.url.startswith("quiet")
    return QuietProbe()
"""


def make_plan(name="warmup"):
    """Create a plan with a phase and the limit of its measurement `change`, and the merging phase."""
    text = f'taxel_test_plan = 1\nname = "x"\nversion = "1"\n[phases.{name}]\n[phases.{name}.limits]\n'
    return parse_plan((text + "change = { max = 50 }\n[phases.faults]\n").encode(), "plan.toml")


def test_a_phase_of_another_package_runs_in_a_plan(benches, tmp_path):
    with installed_package(tmp_path, "my_phases", SOURCE, {BENCH_PHASES: {"warmup": "my_phases:Warmup"}}):
        assert registry.list_phase_names()[-1] == "warmup"
        record = benches().run(make_plan())
    assert record.outcome is Outcome.PASS
    assert find_value(record, "warmup", "change") < 50.0


def test_without_its_package_the_phase_is_unknown():
    with pytest.raises(PlanError, match=r"phases\.warmup: expected the name of a phase, found an unknown one"):
        load_plan_phases(make_plan())


def test_a_probe_of_another_package_is_opened_by_name(benches, tmp_path):
    with installed_package(tmp_path, "my_probe", PROBE_SOURCE, {BENCH_PROBES: {"quiet": "my_probe:open_quiet_probe"}}):
        assert benches(probe="quiet:///dev/x").board.probe.name == "quiet probe"


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("Warmup = 3", r"TypeError: 'int' object is not callable"),
        ("def Warmup(): return 3", "expected a phase, found an object of type int"),
        ("def Warmup(): raise OSError('no sensor')", "OSError: no sensor"),
        (SOURCE.replace('name = "warmup"', 'name = "other"'), "expected the phase name 'warmup', found 'other'"),
    ],
)
def test_an_unusable_phase_gives_one_error_line_with_its_package(tmp_path, source, reason):
    with (
        installed_package(tmp_path, "my_phases", source, {BENCH_PHASES: {"warmup": "my_phases:Warmup"}}),
        pytest.raises(PluginError) as error,
    ):
        load_plan_phases(make_plan())
    assert str(error.value) == (
        f"entry point 'warmup' of group 'taxel.bench_phases' in package 'my_phases' cannot be used ({reason}); "
        "correct or uninstall that package"
    )


def test_a_phase_that_cannot_be_imported_gives_one_error_line_with_its_package(tmp_path):
    with (
        installed_package(tmp_path, "my_phases", "import missing_module", {BENCH_PHASES: {"warmup": "my_phases:X"}}),
        pytest.raises(PluginError, match=r"^entry point 'warmup' of group .* in package 'my_phases' cannot be loaded"),
    ):
        load_plan_phases(make_plan())


def test_an_unusable_phase_does_not_affect_plans_without_it(tmp_path):
    with installed_package(tmp_path, "my_phases", "Warmup = 3", {BENCH_PHASES: {"warmup": "my_phases:Warmup"}}):
        assert [phase.name for phase in load_plan_phases(make_short_plan("rest"))] == ["rest", "faults"]


def test_a_phase_name_of_the_project_cannot_be_used_by_another_package(tmp_path):
    expected = "entry point 'rest' of group 'taxel.bench_phases' is in two packages, 'taxel' and 'my_phases'"
    with (
        installed_package(tmp_path, "my_phases", SOURCE, {BENCH_PHASES: {"rest": "my_phases:Warmup"}}),
        pytest.raises(PluginError, match=expected),
    ):
        load_plan_phases(make_short_plan("rest"))


def test_a_probe_name_of_the_project_cannot_be_used_by_another_package(benches, tmp_path):
    expected = "entry point 'gcode' of group 'taxel.bench_probes' is in two packages, 'taxel' and 'my_probe'"
    with (
        installed_package(tmp_path, "my_probe", PROBE_SOURCE, {BENCH_PROBES: {"gcode": "my_probe:open_quiet_probe"}}),
        pytest.raises(PluginError, match=expected),
    ):
        benches()


@pytest.mark.parametrize(
    ("source", "reason"),
    [
        ("def open_it(request): return 3", "expected a probe, found an object of type int"),
        ("def open_it(): return 3", r"TypeError: open_it\(\) takes 0 positional arguments but 1 was given"),
    ],
)
def test_an_unusable_probe_gives_one_error_line_with_its_package(benches, tmp_path, source, reason):
    with (
        installed_package(tmp_path, "my_probe", source, {BENCH_PROBES: {"quiet": "my_probe:open_it"}}),
        pytest.raises(PluginError, match=rf"'quiet' of group 'taxel.bench_probes' in package 'my_probe' .*{reason}"),
    ):
        benches(probe="quiet")


def test_every_phase_of_the_project_can_be_loaded():
    assert [phase.name for phase in registry.load_phases(registry.list_phase_names())] == list(registry.PHASES)


def test_the_probe_named_none_is_opened():
    assert isinstance(registry.open_probe(registry.ProbeRequest("none", None, 0.005, NoOperator(), 0x2C)), NoProbe)
