"""Choice of the slow tests: within the budget, with a short form of each file."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
_spec = importlib.util.spec_from_file_location("choose_slow_tests", ROOT / "tools/test_times/choose_slow_tests.py")
choose_slow_tests = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(choose_slow_tests)
FILE = "host/tests/tools/test_tools_test_times.py"


def test_longest_tests_are_chosen_until_the_others_fit():
    """The sum of all times is 18 s; it is 9 s without the longest test, and 4 s without the two longest tests."""
    times = {"a.py::one": 9.0, "a.py::two": 3.0, "b.py::one": 5.0, "b.py::two": 1.0}
    assert choose_slow_tests.choose(times, 100.0) == []
    assert choose_slow_tests.choose(times, 10.0) == ["a.py::one"]
    assert choose_slow_tests.choose(times, 5.0) == ["a.py::one", "b.py::one"]


def test_each_file_keeps_its_quickest_test_and_quick_tests_are_never_chosen():
    times = {"a.py::one": 9.0, "b.py::one": 0.9 * choose_slow_tests.SHORTEST_S, "b.py::two": 0.01}
    assert choose_slow_tests.choose(times, 0.0) == []


def test_names_of_a_junit_file_are_converted_to_node_ids(tmp_path):
    path = tmp_path / "times.xml"
    module = FILE.removesuffix(".py").replace("/", ".")
    path.write_text(
        "<testsuites><testsuite>"
        f'<testcase classname="{module}" name="test_a[b.c]" time="1.5"/>'
        f'<testcase classname="{module}.TestClass" name="test_d" time="2"/>'
        f'<testcase classname="{module}" name="test_skipped" time="0"><skipped/></testcase>'
        "</testsuite></testsuites>"
    )
    assert choose_slow_tests.read_times(path) == {f"{FILE}::test_a[b.c]": 1.5, f"{FILE}::TestClass::test_d": 2.0}


def test_an_unknown_module_in_a_junit_file_ends_the_program_with_an_error_line(tmp_path):
    path = tmp_path / "times.xml"
    path.write_text('<testsuite><testcase classname="nowhere.test_x" name="test_a" time="1"/></testsuite>')
    with pytest.raises(SystemExit, match=r"nowhere\.test_x: expected the module of a test"):
        choose_slow_tests.read_times(path)


def test_every_listed_test_is_in_an_existing_file():
    lines = choose_slow_tests.LIST.read_text().splitlines()
    files = {line.split("::")[0] for line in lines if not line.startswith("#")}
    assert [file for file in files if not (ROOT / file).is_file()] == []
