"""Pins of a board from a KiCad netlist or a CSV file: the table of pins.toml, and one line for each error."""

import sys
import tomllib
from types import SimpleNamespace

import pytest

from host.tests.firmware_images.conftest import PORT

SENSOR_NETS = {"SCL": "P4.0", "SDA": "P4.1", "CMOD": "P4.2", "TX0": "P2.0", "TX1": "P2.1", "RX0": "P0.0", "RX1": "P0.1"}


def format_kicad(nets, part="U1"):
    """Format a netlist as KiCad writes it, with the supply and a second part at each net."""
    nodes = "".join(
        f'(net (code "{code}") (name "/mcu/{net}") (node (ref "{part}") (pin "{code}") (pinfunction '
        f'"{pin.replace(".", "[")}]") (pintype "bidirectional")) (node (ref "J1") (pin "{code}")))\n'
        for code, (net, pin) in enumerate(nets.items(), 1)
    )
    supply = f'(net (code "99") (name "+3V3") (node (ref "{part}") (pin "40") (pinfunction "VDD")))'
    return f'(export (version "E") (components (comp (ref "{part}") (value "CY8C4245")))\n(nets {nodes}{supply}))\n'


def format_csv(nets):
    return "net,pin\n" + "".join(f"{net},{pin}\n" for net, pin in nets.items())


@pytest.fixture
def run(tools, tmp_path, monkeypatch, capsys):
    """Function that runs the tool on a file with a text."""
    monkeypatch.chdir(tmp_path)

    def run_tool(text, *options, name="board.txt"):
        """Write a file (None: no file) and run the tool on it; return exit status and outputs."""
        if text is not None:
            (tmp_path / name).write_text(text)
        monkeypatch.setattr(sys, "argv", ["import_pins.py", name, *options])
        status = tools.import_pins.main()
        printed = capsys.readouterr()
        return SimpleNamespace(returncode=status, stdout=printed.out, stderr=printed.err)

    return run_tool


@pytest.mark.parametrize("format_nets", [format_kicad, format_csv])
def test_the_pins_of_a_sensor_board_are_imported(run, format_nets):
    completed = run(format_nets(SENSOR_NETS | {"LED": "P1.6"}))
    assert completed.returncode == 0, completed.stderr
    assert tomllib.loads(completed.stdout)["sensor"] == {
        "scl": "P4.0",
        "sda": "P4.1",
        "cmod": "P4.2",
        "tx": ["P2.0", "P2.1"],
        "rx": ["P0.0", "P0.1"],
    }
    assert completed.stderr.strip().startswith("not used: P1.6:")


@pytest.mark.parametrize("kind", ["palm", "finger_tip"])
def test_the_pins_of_an_original_board_are_imported_from_a_netlist_of_these_pins(run, tmp_path, kind):
    sensor = tomllib.loads((PORT / "original" / f"{kind}.toml").read_text())["sensor"]
    single = {name.upper(): sensor[name] for name in ("scl", "sda", "cint_a", "cint_b")}
    lines = {f"{use.upper()}{number}": pin for use in ("tx", "rx") for number, pin in enumerate(sensor[use])}
    completed = run(format_kicad(single | lines), "--out", "pins.toml")
    assert completed.returncode == 0, completed.stderr
    imported = tomllib.loads((tmp_path / "pins.toml").read_text())["sensor"]
    assert all(imported[name] == sensor[name] for name in ("scl", "sda", "cint_a", "cint_b", "tx", "rx"))
    assert run(format_kicad(single | lines), "--out", "pins.toml").returncode == 1  # the existing file is not replaced


def test_the_pins_of_a_hub_are_imported(run):
    hub = {"SCL": "P4.0", "SDA": "P4.1", "UART_RX": "P0.4", "UART_TX": "P0.5", "UART_RTS": "P0.6"}
    completed = run(format_kicad(hub, "U7"), "--part", "U7")
    assert set(tomllib.loads(completed.stdout)["hub"]) == {"scl", "sda", "uart_rx", "uart_tx", "uart_rts"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (format_kicad(SENSOR_NETS, "U2"), "board.txt: U1: expected nets at port pins such as P2.0, found none"),
        (format_kicad(SENSOR_NETS)[:200], "board.txt: file: expected a complete KiCad netlist"),
        ("(" * 100000, "board.txt: file: expected a complete KiCad netlist"),
        (format_kicad(SENSOR_NETS) + ")", "board.txt: file: expected a complete KiCad netlist"),
        ("name;pin\n", "board.txt: line 1: expected the columns net and pin"),
        (format_csv({"TX0": "7"}), "board.txt: line 2, pin: expected a port pin such as P2.0, found '7'"),
        (format_csv(SENSOR_NETS | {"TX3": "P2.3"}), "board.txt: TX2: expected nets numbered from 0 without a gap"),
        (format_csv(SENSOR_NETS | {"RX0 ": "P0.5"}), "board.txt: RX0: expected one pin, found P0.0 and P0.5"),
        (format_csv(SENSOR_NETS | {"SCL": "P3.0"}), "board.txt: sensor.scl: expected P4.0, found 'P3.0'"),
        (format_csv(SENSOR_NETS | {"TX1": "P3.2"}), "board.txt: sensor.tx: expected a pin other than the debugger's"),
        (format_csv({"SCL": "P4.0", "SDA": "P4.1", "CMOD": "P4.2"}), "board.txt: TX0, RX0: expected a net"),
    ],
)
def test_a_wrong_netlist_is_refused_in_one_line(run, text, message):
    completed = run(text)
    assert completed.returncode == 1
    assert completed.stderr.startswith(f"import_pins: {message}"), completed.stderr
    assert len(completed.stderr.strip().splitlines()) == 1


def test_a_missing_file_is_refused_in_one_line(run):
    completed = run(None, name="missing.net")
    assert (completed.returncode, len(completed.stderr.strip().splitlines())) == (1, 1)
