"""tools/mutants: every bug of the list can be planted, and the suite's output is parsed."""

import importlib
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools" / "mutants"))
try:
    bugs = importlib.import_module("bugs")
    sandbox = importlib.import_module("sandbox")
finally:
    sys.path.remove(str(ROOT / "tools" / "mutants"))

BUGS_MIN = 24


def write_bug_list(folder: Path, *tables: str) -> Path:
    """Write a bug list of these tables; return its path."""
    path = folder / "bugs.toml"
    path.write_text("".join(f"[[bug]]\n{table}\n" for table in tables))
    return path


@pytest.mark.parametrize("bug", bugs.load_bugs(), ids=lambda bug: bug.name)
def test_every_bug_can_be_planted(bug):
    """A planted bug is a deliberate error; its description `what` is one line. A stage is a part of the test suite."""
    text = (ROOT / bug.file).read_text()
    assert bug.plant_in(text) != text
    assert bugs.select_stages(bug)
    assert bug.what
    assert "\n" not in bug.what


def test_the_list_of_planted_bugs_covers_every_part_of_the_code():
    """Planted bugs are deliberate errors that the test suite must detect."""
    listed_bugs = bugs.load_bugs()
    assert len(listed_bugs) >= BUGS_MIN
    parts = ("firmware/codec/", "firmware/sensor/", "firmware/hub/", "protocol/taxel_protocol/", "host/taxel/stream/")
    for part in (*parts, "host/taxel/signal/", "host/taxel/link/", "host/taxel/skin/skin.py"):
        assert any(bug.file.startswith(part) for bug in listed_bugs), part


def test_a_bug_whose_text_does_not_occur_exactly_once_is_rejected():
    bug = bugs.Bug("off", "codec.c", "off by one", "a < b", "a <= b")
    assert bug.plant_in("if (a < b)") == "if (a <= b)"
    for text, count in (("if (b)", 0), ("a < b; a < b", 2)):
        with pytest.raises(bugs.PlantError, match=f"off: its text occurs {count} times in codec.c, expected once"):
            bug.plant_in(text)


def test_a_list_with_a_duplicate_name_or_an_ineffective_bug_is_rejected(tmp_path):
    table = 'name = "one"\nfile = "a.c"\nwhat = "x"\nold = "a"\nnew = "b"'
    assert [bug.name for bug in bugs.load_bugs(write_bug_list(tmp_path, table))] == ["one"]
    with pytest.raises(bugs.PlantError, match="two bugs have the name one"):
        bugs.load_bugs(write_bug_list(tmp_path, table, table))
    with pytest.raises(bugs.PlantError, match="one: changes nothing"):
        bugs.load_bugs(write_bug_list(tmp_path, table.replace('"b"', '"a"')))


def test_an_unknown_bug_name_is_rejected():
    with pytest.raises(bugs.PlantError, match="unknown bug unlisted; --list shows the names"):
        bugs.select_bugs(bugs.load_bugs(), ["unlisted"])


def test_the_stages_are_those_that_can_detect_the_bug():
    """A stage is a part of the test suite. The tests of the bug's own package come first, then stages by duration."""

    def list_names(file: str) -> list[str]:
        """List the names of the stages for a bug in `file`."""
        return [stage.name for stage in bugs.select_stages(bugs.Bug("x", file, "", "a", "b"))]

    assert list_names("firmware/codec/a.c") == [
        "C firmware",
        "C all",
        "protocol tests",
        "host tests",
        "hil tests",
    ]
    assert list_names("firmware/hub/hub.c") == ["C firmware", "C all", "host tests", "hil tests"]
    assert list_names("protocol/taxel_protocol/framing.py") == ["protocol tests", "host tests", "hil tests"]
    assert list_names("host/taxel/skin/skin.py") == ["skin tests", "host tests", "hil tests"]


def test_the_tests_that_import_the_module_of_a_bug_run_before_the_others_of_its_package():
    stage = bugs.make_package_stage("host/taxel/gap/comparison/density.py")
    assert stage is not None
    imports = ["taxel.gap.comparison.density" in (ROOT / test).read_text() for test in stage.tests]
    assert True in imports
    assert imports == sorted(imports, reverse=True)  # all True (the test imports the module) come before all False
    assert len(stage.tests) == len(list((ROOT / "host/tests/gap").glob("test_*.py")))
    assert bugs.make_package_stage("firmware/hub/hub.c") is None


@pytest.mark.parametrize(
    ("output", "first"),
    [
        (
            "  a.c:3: expected x\nFAILED frames (2 checks)\n\n"
            "The following tests FAILED:\n\t 12 - test_hub_uart (Failed)\n",
            "test_hub_uart: frames",
        ),
        (
            "==1==ERROR: AddressSanitizer: stack-buffer-overflow on address\nThe following tests FAILED:\n"
            "\t  3 - fuzz_codec_corpus (Failed)\n",
            "fuzz_codec_corpus: AddressSanitizer: stack-buffer-overflow",
        ),
        ("The following tests FAILED:\n\t  3 - stress_world (Timeout)\n", "stress_world: timeout"),
        ("FAILED hil_tests/test_x.py::test_a[two words] - assert 1 == 2\n", "hil_tests/test_x.py::test_a[two words]"),
        ("ERROR host/tests/test_y.py - TypeError: no\n", "host/tests/test_y.py"),
        ('Fatal Python error: Aborted\n  File "t.py", line 9 in test_z\n', "test_z: the interpreter crashed"),
        ("no tests\n", "no tests"),
        ("", "no output"),
    ],
)
def test_the_first_failing_test_is_named(output, first):
    assert sandbox.find_first_failure(output) == first
