"""The bring-up image on an emulated chip with planted faults: `taxel bringup` names each with its step."""

import json
import re

import pytest

from host.tests.command_line import run_taxel
from taxel_tools.bringup.capacitor import evaluate_counts
from taxel_tools.bringup.emulated_part import EmulatedPart, PartSettings, read_flash
from taxel_tools.bringup.findings import AS_ASSUMED, DIFFERS, NOT_MEASURED, list_findings
from taxel_tools.bringup.measuring import measure

KNOWN_PF = 2.2

FAULTS = {
    "irq_scb0=9": (4, "interrupt of SCB0", "write 9"),
    "irq_scb1=12": (4, "interrupt of SCB1", "write 12"),
    "irq_csd=14": (4, "interrupt of the converter", "write 14"),
    "clock_csd_sample=6": (5, "sample clock of the converter", "write 6"),
    "clock_csd_sense=7": (5, "sense clock of the converter", "write 7"),
    "clock_csd_sample=4,clock_csd_sense=5": (5, "sample clock of the converter", "write 4"),
    "clock_scb1=9": (1, "UART: text", "the UART has no clock"),
    "clock_rate=0.9": (1, "UART: text", "at another frequency the processor clock is wrong"),
    "clock_rate=0.97": (2, "processor clock", "trims"),
    "scl_stuck=1": (6, "I2C: released lines", "SCL"),
    "sda_stuck=1": (6, "I2C: released lines", "SDA"),
    "no_pull_ups=1": (6, "I2C: released lines", "pull-up"),
    "writes_no_flash=1": (7, "flash row", "ROM"),
    "keeps_no_ram=1": (8, "RAM over a reset: fault record", "does not survive"),
    "has_no_ilo=1": (9, "watchdog", "oscillator"),
    "rx_open=1": (3, "UART: received bytes", "wire of P0.4"),
    "capacitors=0": (10, "counts", "integration capacitor"),
    "capacitors=2": (10, "counts", "the circuit is the other one"),
    "capacitance_pf=0": (10, "counts", "known capacitor"),
    "idac_gain=1.3": (10, "step of the current source", "trim"),
}
"""Planted faults (settings of the emulated part) with the step, the point, and a part of the advice."""

CLOCK_PIN_HZ = {"clock_scb1=9": 1000.0, "clock_rate=0.9": 900.0}
"""Faults for which the advice of step 1 depends on the frequency of the clock pin, with this frequency."""


@pytest.fixture(scope="module")
def images(build_folder):
    return build_folder / "images"


@pytest.fixture(scope="module")
def flash(images):
    return read_flash(images / "bringup.hex")


def read_settings(text):
    pairs = (pair.split("=") for pair in text.split(","))
    return PartSettings(**{name: float(value) for name, value in pairs})


def run(flash, settings):
    """Run all tests of the bring-up image on an emulated part.

    Returns the measurements and the frequency of the clock pin in Hz.
    """
    part = EmulatedPart(flash, settings)
    try:
        return measure(part), part.measure_clock_pin()
    finally:
        part.close()


@pytest.mark.parametrize(("capacitors", "name"), [(1, "one capacitor"), (2, "CintA and CintB")])
def test_a_part_as_assumed_has_no_deviation(flash, capacitors, name):
    results, clock_pin_hz = run(flash, PartSettings(capacitors=capacitors))
    findings = list_findings(results, KNOWN_PF, capacitors=capacitors)
    assert {each.status for each in findings} == {AS_ASSUMED}
    assert next(each for each in findings if each.point == "counts").measured.startswith(f"with {name}")
    assert clock_pin_hz == pytest.approx(1000.0, rel=0.005)
    assert not results.missing


@pytest.mark.parametrize("fault", FAULTS)
def test_each_planted_fault_is_named_with_its_step(flash, fault):
    results, clock_pin_hz = run(flash, read_settings(fault))
    differing = [each for each in list_findings(results, KNOWN_PF) if each.status == DIFFERS]
    step, point, advice = FAULTS[fault]
    assert (step, point) in [(each.step, each.point) for each in differing]
    assert advice in next(each.advice for each in differing if each.point == point)
    assert {each.step for each in differing} == {step}
    if fault in CLOCK_PIN_HZ:
        assert clock_pin_hz == pytest.approx(CLOCK_PIN_HZ[fault], rel=0.01)


def test_the_wrong_variant_of_the_circuit_counts_nothing(flash):
    """The keys of `counts` are the number of capacitors of a variant, and a code of the current source."""
    for capacitors in (1, 2):
        results, _ = run(flash, PartSettings(capacitors=capacitors))
        assert any(count for (number, _), count in results.counts.items() if number == capacitors)
        assert not any(count for (number, _), count in results.counts.items() if number != capacitors)


@pytest.mark.parametrize("capacitance_pf", [1.0, 2.2, 5.0])
def test_the_capacitance_is_measured(flash, capacitance_pf):
    results, _ = run(flash, PartSettings(capacitance_pf=capacitance_pf))
    counts = {code: count for (number, code), count in results.counts.items() if number == 1}
    result = evaluate_counts(counts)
    assert result.follows_law
    assert result.capacitance_pf == pytest.approx(capacitance_pf, rel=0.02)
    assert result.compute_step_ua(capacitance_pf) == pytest.approx(1.2, rel=0.02)  # uA per code of the current source


def test_without_a_known_capacitor_the_current_is_not_judged(flash):
    results, _ = run(flash, PartSettings())
    assert [each.point for each in list_findings(results) if each.status == NOT_MEASURED] == [
        "step of the current source"
    ]


def test_the_command_writes_the_points_and_names_the_step(images, tmp_path, capsys):
    out = tmp_path / "board.json"
    arguments = ("bringup", "emulated:", "--image", images / "bringup.hex", "--capacitor-pf", 2.2, "--out", out)
    assert run_taxel(*arguments, "--part", "irq_csd=14") == 1
    printed = capsys.readouterr().out
    assert "step 4 of docs/bring-up.md: interrupt of the converter: write 14" in printed
    document = json.loads(out.read_text())
    assert (document["format"], document["version"], document["board"]) == ("taxel bringup", 1, "0102030405060708")
    assert "| 4 | interrupt of the converter | 15 | 14 | differs |" in out.with_suffix(".md").read_text()


def test_existing_result_files_are_replaced_only_with_the_option_overwrite(images, tmp_path, capsys):
    out = tmp_path / "board.json"
    out.write_text("earlier")
    arguments = ("bringup", "emulated:", "--image", images / "bringup.hex", "--capacitor-pf", 2.2, "--out", out)
    assert run_taxel(*arguments) == 1
    assert re.search(r"board.json: exists already.*--overwrite", capsys.readouterr().err)
    assert out.read_text() == "earlier"
    assert run_taxel(*arguments, "--overwrite") == 0
    assert json.loads(out.read_text())["format"] == "taxel bringup"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("emulated:",), "--image: emulated: needs the image"),
        (("/dev/ttyTaxelMissing",), "/dev/ttyTaxelMissing: cannot be opened"),
        (("/dev/ttyTaxelMissing", "--part", "irq_csd=14"), "--image, --part: only for the port emulated:"),
        (("emulated:", "--image", "missing.hex"), "missing.hex"),
        (("emulated:", "--image", "IMAGE", "--part", "irq=14"), "--part irq=14: expected NAME=NUMBER"),
        (("emulated:", "--image", "IMAGE", "--out", "points.md"), "points.md: expected a name such as bringup.json"),
    ],
)
def test_invalid_arguments_are_refused_in_one_line(images, arguments, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    replaced = [images / "bringup.hex" if each == "IMAGE" else each for each in arguments]
    assert run_taxel("bringup", *replaced) != 0
    captured = capsys.readouterr()
    assert message in captured.err
    assert len(captured.err.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())
