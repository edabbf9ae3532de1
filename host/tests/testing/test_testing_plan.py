"""Test plans: content, differences for a kind of board, and the error line for each invalid plan."""

import pickle

import pytest

from taxel_tools.errors import PlanError
from taxel_tools.testing.engine import check_plan
from taxel_tools.testing.errors import SerialNumberError
from taxel_tools.testing.plan import Options, parse_plan, read_plan
from taxel_tools.testing.record import Limit

PLAN_HEAD = 'taxel_test_plan = 1\nname = "boards"\nversion = "1"\n'

PLAN = """
serial_pattern = "[A-Z]{2}-[0-9]{4}"
stop_at_failure = true
[phases.supply]
[phases.noise]
seconds = 4.0
[phases.noise.limits]
white = { max = 8.0 }
gain = { min = 5, max = 20 }
[phases.force]
enabled = false
[kinds.fingertip.noise]
seconds = 2.0
[kinds.fingertip.noise.limits]
white = { max = 10.0 }
gain = { max = inf }
[kinds.fingertip.force]
enabled = true
"""


def test_phases_run_in_the_order_of_their_tables(make_plan):
    assert [phase.name for phase in make_plan(PLAN).enabled_phases("palm")] == ["supply", "noise"]


def test_a_plan_contains_its_name_version_digest_and_stop_condition(make_plan):
    plan = make_plan(PLAN)
    assert (plan.name, plan.version, plan.stop_at_failure, len(plan.sha256)) == ("boards", "1", True, 64)


def test_a_kind_changes_only_the_keys_in_its_table(make_plan):
    """Kind `fingertip`: other seconds, a higher limit of white, no upper limit of gain. `palm` has no table."""
    noise = make_plan(PLAN).enabled_phases("fingertip")[1]
    assert noise.options == {"seconds": 2.0}
    assert noise.limits == {"white": Limit(None, 10.0), "gain": Limit(5.0, None)}
    assert make_plan(PLAN).enabled_phases("palm")[1].limits == {"white": Limit(None, 8.0), "gain": Limit(5.0, 20.0)}


def test_a_phase_can_be_enabled_for_a_single_kind(make_plan):
    assert [phase.name for phase in make_plan(PLAN).enabled_phases("fingertip")] == ["supply", "noise", "force"]


def test_an_infinite_bound_removes_the_limit(make_plan):
    plan = make_plan("[phases.a.limits]\nx = { max = 8 }\n[kinds.k.a.limits]\nx = { max = inf }\n")
    assert plan.enabled_phases("k")[0].limits == {}


def test_a_plan_is_read_from_a_file(tmp_path):
    path = tmp_path / "plan.toml"
    path.write_text(PLAN_HEAD + PLAN)
    assert read_plan(path).serial_pattern == "[A-Z]{2}-[0-9]{4}"


def test_the_whole_serial_number_must_match_the_pattern(make_plan):
    plan = make_plan(PLAN)
    plan.check_serial_number("AB-0001")
    for invalid_serial in ("AB-00011", "xAB-0001", "", "AB-0001\n"):
        with pytest.raises(SerialNumberError, match="serial number: expected"):
            plan.check_serial_number(invalid_serial)


def test_without_a_pattern_a_serial_number_must_be_one_printable_line(make_plan):
    plan = make_plan("[phases.a]\n")
    plan.check_serial_number("")
    plan.check_serial_number("Größe 7")
    for invalid_serial in ("A\x1b[2J", "A" * 65):
        with pytest.raises(SerialNumberError):
            plan.check_serial_number(invalid_serial)


def test_an_unknown_kind_is_refused(make_plan):
    plan = make_plan(PLAN)
    plan.check_kinds(["fingertip", "palm"])
    with pytest.raises(PlanError, match=r"plan.toml: kinds.fingertip: .*did you mean fingertips\?"):
        plan.check_kinds(["fingertips"])


@pytest.mark.parametrize(
    ("text", "expected_text"),
    [
        ("", "plan.toml: taxel_test_plan: expected 1, found None; is this a test plan of this release?"),
        ("taxel_test_plan = 2", "plan.toml: taxel_test_plan: expected 1, found 2; is this a test plan"),
        ("taxel_test_plan = true", "plan.toml: taxel_test_plan: expected 1, found true"),
        ("taxel_test_plan = 1.0", "plan.toml: taxel_test_plan: expected 1, found 1.0"),
        ("taxel_test_plan = 1\nname = 'x'\n[phases.a]", "plan.toml: version: expected this key, found nothing; add"),
        ("taxel_test_plan = [", "plan.toml: end of document: expected valid TOML, found Invalid value"),
        ("name = 1\nname = 2", "plan.toml: end of document: expected valid TOML, found Cannot overwrite a value"),
        ("x = " + "[" * 200 + "\n" + "[" * 390, "plan.toml: file: expected a few nested lists, found hundreds"),
        (PLAN_HEAD, "plan.toml: phases: expected this key, found nothing; add phases"),
        (PLAN_HEAD + "phases = 3", "plan.toml: phases: expected a table, found 3; write a table"),
        (PLAN_HEAD + "[phases]", "plan.toml: phases: expected one phase or more, found none; add"),
        (
            PLAN_HEAD + "phase = 1\n[phases.a]",
            "phase: expected a known key, found an unknown one; did you mean phases?",
        ),
        (PLAN_HEAD + "[phases]\na = 1", "plan.toml: phases.a: expected a table, found 1"),
        (PLAN_HEAD + "[phases.'a b']", "plan.toml: phases.'a b': expected a letter, then letters, digits and _"),
        (
            PLAN_HEAD + "[phases.a]\nenabled = 1",
            "plan.toml: phases.a.enabled: expected true or false, found 1; correct",
        ),
        (PLAN_HEAD + "[phases.a]\nlimits = 1", "plan.toml: phases.a.limits: expected a table, found 1"),
        (PLAN_HEAD + "[phases.a.limits]\nx = 8", "plan.toml: phases.a.limits.x: expected a table, found 8"),
        (PLAN_HEAD + "[phases.a.limits]\nx = {}", "phases.a.limits.x: expected min, max or both, found neither; write"),
        (
            PLAN_HEAD + "[phases.a.limits]\nx = { maximum = 8 }",
            "limits.x.maximum: expected a known key, found an unknown one",
        ),
        (
            PLAN_HEAD + "[phases.a.limits]\nx = { max = '8' }",
            "limits.x.max: expected a number, or inf for no bound, found '8'",
        ),
        (PLAN_HEAD + "[phases.a.limits]\nx = { max = nan }", "phases.a.limits.x.max: expected a number, or inf"),
        (PLAN_HEAD + "[phases.a.limits]\nx = { max = -inf }", "phases.a.limits.x.max: expected a number, or inf"),
        (PLAN_HEAD + "[phases.a.limits]\nx = { min = true }", "phases.a.limits.x.min: expected a number, or -inf"),
        (
            PLAN_HEAD + f"[phases.a.limits]\nx = {{ max = 1{'0' * 350} }}",
            "x.max: expected an integer of 64 bits, found an integer of 1163 bits",
        ),
        (
            PLAN_HEAD + "[phases.a.limits]\nx = { min = 2, max = 1 }",
            "limits.x: expected min at most max, found min 2, max 1",
        ),
        (
            PLAN_HEAD + "[phases.a.limits]\nx = { min = 5 }\n[kinds.k.a.limits]\nx = { max = 4 }",
            "plan.toml: kinds.k.a.limits.x: expected min at most max, found min 5, max 4; correct one of the bounds",
        ),
        (PLAN_HEAD + "[phases.a]\n[kinds.k.b]", "plan.toml: kinds.k.b: expected a phase that is also listed in phases"),
        (PLAN_HEAD + "[phases.a]\n[kinds]\nk = 1", "plan.toml: kinds.k: expected a table, found 1"),
        (
            PLAN_HEAD + "serial_pattern = '['\n[phases.a]",
            "plan.toml: serial_pattern: expected a regular expression, found '['",
        ),
        (
            PLAN_HEAD + "serial_pattern = 'a{9999999999}'\n[phases.a]",
            "plan.toml: serial_pattern: expected a regular expr",
        ),
        (PLAN_HEAD + "serial_pattern = '[[a]'\n[phases.a]", "plan.toml: serial_pattern: expected a regular expression"),
        (PLAN_HEAD + "serial_pattern = 7\n[phases.a]", "plan.toml: serial_pattern: expected one line of text"),
        (
            PLAN_HEAD + "stop_at_failure = 'no'\n[phases.a]",
            "plan.toml: stop_at_failure: expected true or false, found 'no'",
        ),
        (PLAN_HEAD.replace('"1"', "1") + "[phases.a]", "plan.toml: version: expected one line of text, at most 200 ch"),
        (PLAN_HEAD.replace("boards", "a\\nb") + "[phases.a]", "plan.toml: name: expected one line of text"),
        (
            PLAN_HEAD + "x = '" + "y" * 500 + "'",
            "plan.toml: file: expected lines of at most 400 bytes, found one of 506",
        ),
        ("x = 1\n" * 60_000, "plan.toml: file: expected at most 262144 bytes, found more"),
        (b"x = '\xff'", "plan.toml: line 1: expected UTF-8 text, found byte 0xFF; correct the syntax"),
    ],
)
def test_every_error_in_a_plan_gives_one_error_line(text, expected_text):
    with pytest.raises(PlanError) as caught_error:
        parse_plan(text if isinstance(text, bytes) else text.encode(), "plan.toml")
    assert expected_text in str(caught_error.value)
    assert str(caught_error.value).isprintable()
    assert str(pickle.loads(pickle.dumps(caught_error.value))) == str(caught_error.value)


def test_a_missing_file_and_a_folder_are_refused_as_plan(tmp_path):
    with pytest.raises(PlanError, match=r"none\.toml: file: expected a readable test plan, found No such file"):
        read_plan(tmp_path / "none.toml")
    with pytest.raises(PlanError, match="found is a folder, no regular file"):
        read_plan(tmp_path)


def test_an_unknown_phase_is_refused_even_if_disabled(make_plan, phase):
    plan = make_plan("[phases.noize]\nenabled = false\n")
    with pytest.raises(PlanError, match=r"phases\.noize: expected the name of a phase.*did you mean noise\?"):
        check_plan(plan, [phase("noise")])


def test_an_unknown_limit_is_refused_for_every_kind(make_plan, phase):
    plan = make_plan("[phases.noise]\n[kinds.k.noise.limits]\nwhit = { max = 1 }\n")
    with pytest.raises(PlanError, match=r"kinds\.k\.noise\.limits\.whit: expected a measurement.*did you mean white\?"):
        check_plan(plan, [phase("noise", limits=("white",))])
    with pytest.raises(PlanError, match="this phase has no limits"):
        check_plan(plan, [phase("noise")])


def test_checkable_options_are_checked_before_the_test(make_plan, phase):
    noise = phase("noise")
    noise.check_options = lambda options: options.take_number("seconds", 1.0, 0.1, 60.0)
    check_plan(make_plan("[phases.noise]\nseconds = 2\n"), [noise])
    with pytest.raises(PlanError, match=r"phases\.noise\.seconds: expected a number from 0\.1 to 60, found 99"):
        check_plan(make_plan("[phases.noise]\nseconds = 99\n"), [noise])
    with pytest.raises(PlanError, match=r"phases\.noise\.second: expected an option.*did you mean seconds\?"):
        check_plan(make_plan("[phases.noise]\nsecond = 9\n"), [noise])
    with pytest.raises(PlanError, match=r"kinds\.k\.noise\.seconds: expected a number"):
        check_plan(make_plan("[phases.noise]\nseconds = 2\n[kinds.k.noise]\nseconds = 'x'\n"), [noise])


def test_options_have_the_values_of_the_plan():
    options = Options({"seconds": 2, "rounds": 3, "fast": True, "window": "hann"})
    assert options.take_number("seconds", 1.0) == 2.0
    assert options.take_integer("rounds", 1, 1, 9) == 3
    assert options.take_flag("fast", False) is True
    assert options.take_text("window", "none", ("hann", "none")) == "hann"
    options.refuse_unknown_keys()


def test_a_missing_option_has_its_default():
    assert Options({}).take_number("overlap", 0.5) == 0.5


@pytest.mark.parametrize(
    ("values", "read_option", "expected_text"),
    [
        ({"x": True}, lambda o: o.take_number("x", 1.0), "options: x: expected a number, found true; correct"),
        ({"x": float("nan")}, lambda o: o.take_number("x", 1.0), "x: expected a number, found nan"),
        ({"x": 10**400}, lambda o: o.take_number("x", 1.0), "x: expected a number, found an integer of 1329 bits"),
        ({"x": 0}, lambda o: o.take_number("x", 1.0, 1), "x: expected a number of at least 1, found 0"),
        ({"x": 9}, lambda o: o.take_number("x", 1.0, maximum=8), "x: expected a number of at most 8, found 9"),
        ({"x": 2.0}, lambda o: o.take_integer("x", 1), "x: expected an integer, found 2.0"),
        ({"x": 7}, lambda o: o.take_integer("x", 1, 1, 3), "x: expected an integer from 1 to 3, found 7"),
        ({"x": 1}, lambda o: o.take_flag("x", True), "x: expected true or false, found 1"),
        ({"x": 1}, lambda o: o.take_text("x", "a"), "x: expected text, found 1"),
        ({"x": "c"}, lambda o: o.take_text("x", "a", {"b", "a"}), "x: expected one of a, b, found 'c'"),
        (
            {"x": 1},
            lambda o: o.refuse_unknown_keys(),
            "x: expected an option of this phase, found an unknown key; this phase has no",
        ),
    ],
)
def test_an_invalid_option_gives_one_error_line(values, read_option, expected_text):
    with pytest.raises(PlanError) as caught_error:
        read_option(Options(values))
    assert expected_text in str(caught_error.value)
