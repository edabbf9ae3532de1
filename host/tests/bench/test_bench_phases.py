"""The phases on an emulated board: what is measured, what is named, through the hub and through an adapter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from host.tests.bench.conftest import ADDRESS, faults_of, phase_of, short_plan, url_of, value_of
from taxel.hand import BoardKind, load_hand
from taxel_protocol.limits import REGISTER_SETTINGS
from taxel_tools.bench import running
from taxel_tools.bench.station import open_station
from taxel_tools.errors import BoardError, PlanError
from taxel_tools.procedure import Transfer
from taxel_tools.scheduler import run
from taxel_tools.testing.plan import parse_plan
from taxel_tools.testing.record import Outcome

WIRES = ("hub", "i2c")
BOARD = f"board=0x{ADDRESS:02X}"


@pytest.mark.parametrize("wire", WIRES)
def test_a_healthy_board_passes_and_its_figures_are_those_of_the_emulator(benches, wire):
    bench = benches(wire=wire)
    bench.station.draws = True
    record = bench.run(short_plan())
    assert (record.outcome, faults_of(record)) == (Outcome.PASS, [])
    assert value_of(record, "noise", "white") == pytest.approx(4.0, rel=0.1)
    assert value_of(record, "rest", "median") == pytest.approx(2440.0, abs=60.0)
    assert value_of(record, "electrical", "capacitance", "TX 3") == pytest.approx(1.0, abs=0.1)
    assert value_of(record, "presses", "response") == pytest.approx(730.0, rel=0.15)
    assert value_of(record, "presses", "snr") == pytest.approx(730.0 / 4.0, rel=0.2)
    assert value_of(record, "presses", "crosstalk", "along TX lines") < 0.01
    assert value_of(record, "loading", "hysteresis") < 0.02
    assert value_of(record, "loading", "fall") == pytest.approx(0.66, abs=0.03)
    assert 0.005 < value_of(record, "small_forces", "visible") < 0.03
    assert value_of(record, "frames", "bus_errors") == 0.0
    assert value_of(record, "frames", "rate_of_scans") > 0.6
    assert value_of(record, "identify", "kind") == "medial_front"
    pictures = [one.name for phase in record.phases for one in phase.attachments]
    assert pictures == [
        "capacitance.png",
        "rest.png",
        "spectrum.png",
        "noise.png",
        "drift.png",
        "presses.png",
        "loading.png",
        "small_forces.png",
    ]
    assert all(one.data.startswith(b"\x89PNG") for phase in record.phases for one in phase.attachments)
    assert record.device["probe"] == "emulated probe"


def test_an_adapter_measures_the_boards_clock(benches):
    record = benches("effect clock skew ppm=5000", wire="i2c").run(short_plan("frames"))
    plain = benches(wire="i2c").run(short_plan("frames"))
    difference = value_of(record, "frames", "clock") - value_of(plain, "frames", "clock")
    assert difference == pytest.approx(5000.0, abs=1500.0)  # 2 s of frames, each late by up to a scan


@pytest.mark.parametrize("wire", WIRES)
@pytest.mark.parametrize(
    ("effect", "fault"),
    [
        (f"line open {BOARD} axis=0 index=2", ("open line", "TX 2")),
        (f"line short {BOARD} axis=1 index=1", ("short", "RX 1 and RX 2")),
        (f"dead rest {BOARD} taxel=9", ("dead taxel", "taxel 9")),
    ],
)
def test_a_fault_is_named_at_its_place(benches, wire, effect, fault):
    record = benches(f"effect {effect}", wire=wire).run(short_plan("electrical", "rest", "presses"))
    assert (record.outcome, faults_of(record)) == (Outcome.FAIL, [fault])


@pytest.mark.parametrize(
    ("effect", "fault", "phases"),
    [
        (f"stuck_bit high bit=5 {BOARD}", ("stuck bit", "board"), ["rest"]),
        (f"dead stuck {BOARD} taxel=3 value=2400", ("dead taxel", "taxel 3"), ["rest"]),
        (f"gain electrode {BOARD} factor=0.02", ("low gain", "board"), ["rest", "presses"]),
        (f"gain idac {BOARD} factor=2.0", ("rest level", "board"), ["rest"]),
        ("coupling resistive tx_ohm=4000 rx_ohm=4000", ("crosstalk", "board"), ["presses"]),
        (f"drift warm_up {BOARD} counts=600 seconds=60", ("drift", "board"), ["drift"]),
    ],
)
def test_other_faults_are_named(benches, effect, fault, phases):
    record = benches(f"effect {effect}").run(short_plan(*phases))
    assert (record.outcome, faults_of(record)) == (Outcome.FAIL, [fault])


@pytest.mark.parametrize("wire", WIRES)
def test_a_bus_that_loses_reads_is_named(benches, wire):
    record = benches("effect silent flaky p=0.2 burst=1", wire=wire).run(short_plan("frames"))
    assert faults_of(record) == [("bus errors", "board")]
    # Of 1000. The adapter addresses the board twice a read, the hub once, unless the last read failed.
    assert value_of(record, "frames", "bus_errors") == pytest.approx(300.0 if wire == "hub" else 400.0, rel=0.25)


def test_a_board_without_signal_is_one_fault(benches):
    words = [f"effect gain electrode {BOARD} factor=0.01", f"effect gain idac {BOARD} factor=0.01"]
    record = benches(*words).run(short_plan("electrical"))
    assert faults_of(record) == [("no signal", "board")]


def test_phases_that_press_are_skipped_without_a_probe(benches):
    record = benches(probe="none").run(short_plan("electrical", "presses", "loading", "small_forces"))
    assert record.outcome is Outcome.PASS
    for name in ("presses", "loading", "small_forces"):
        assert phase_of(record, name).outcome is Outcome.SKIP
        assert phase_of(record, name).notes == ["cannot run here: no probe: give --probe"]
    assert "no taxel was pressed" in phase_of(record, "faults").notes[0]


@pytest.mark.parametrize("wire", WIRES)
def test_a_board_that_is_unplugged_half_way_ends_the_test_with_an_error(benches, wire):
    bench = benches(wire=wire)
    pulled = []

    def report(phase, fraction):
        if phase == "presses" and fraction > 0.5 and not pulled:
            pulled.append(phase)
            bench.world.inject("unplug", ADDRESS)

    record = bench.run(short_plan("rest", "presses", "small_forces"), report)
    assert record.outcome is Outcome.ERROR
    outcomes = {phase.name: phase.outcome for phase in record.phases}
    assert outcomes["rest"] is Outcome.PASS
    assert (outcomes["presses"], outcomes["small_forces"]) == (Outcome.ERROR, Outcome.ERROR)
    expected = "board 0x2C: has sent no frame for 2.0 s; check its plug and its power"
    assert phase_of(record, "presses").problem == expected


def test_the_error_flags_that_a_board_reports_are_named(benches):
    bench = benches(wire="i2c")

    def wrong_settings():
        yield Transfer(ADDRESS, bytes([REGISTER_SETTINGS]) + bytes(12))

    run(bench.station.wire, wrong_settings())
    record = bench.run(short_plan("identify"))
    assert faults_of(record) == [("board error", "board")]
    assert "it reports: settings rejected" in record.findings()[0].text


def test_the_plan_may_ask_for_a_firmware(benches):
    record = benches().run(short_plan("identify", **{"[phases.identify]": '[phases.identify]\nfirmware = "9.9.9"'}))
    assert faults_of(record) == [("wrong firmware", "board")]
    assert "runs 0.1.0, the plan asks for 9.9.9: flash it" in record.findings()[0].text


def test_a_crossing_map_of_another_design_is_named(benches):
    hand = load_hand("allegro")
    board = hand.get_board(ADDRESS)
    other = board.kind.crossings.copy()
    tx, rx = np.argwhere(other)[0]
    other[tx, rx], other[np.argwhere(~other)[0][0], np.argwhere(~other)[0][1]] = False, True
    kind = BoardKind("medial_front", board.kind.code, other)
    bench = benches()
    mistaken = replace(hand, boards=(replace(board, kind=kind),))
    bench.station = open_station(bench.station.wire, ADDRESS, mistaken)
    record = bench.run(short_plan("identify"))
    assert faults_of(record) == [("wrong crossing map", "board")]


def test_a_board_of_no_known_kind_is_tested_all_the_same(benches):
    bench = benches()
    bench.station = open_station(bench.station.wire, ADDRESS, load_hand("rig4"))
    record = bench.run(short_plan("identify", "electrical"))
    assert record.outcome is Outcome.PASS
    assert record.device["kind"] == "kind 4"
    assert "hand 'rig4' has no kind 4: compared with nothing" in phase_of(record, "identify").notes


def test_nobody_at_an_address_is_one_line(benches):
    with pytest.raises(BoardError, match="board 0x60: does not answer; taxel scan shows who does"):
        open_station(benches().station.wire, 0x60, None)


def test_a_bootloader_is_no_board_to_test(benches):
    with (
        running.open_bench(url_of(f"blank 0x{ADDRESS:02X}")) as (wire, _),
        pytest.raises(BoardError, match="board 0x77: runs no application of ours: taxel scan"),
    ):
        open_station(wire, 0x77, None)


def test_the_record_of_the_untouched_board_is_taken_once(benches):
    bench = benches()
    record = bench.run(short_plan("electrical", "rest", "noise", "drift"))
    assert [round(phase.seconds, 1) for phase in record.phases] == [3.0, 0.0, 0.0, 0.0, 0.0]


def test_too_few_frames_for_noise_are_one_line(benches, monkeypatch):
    bench = benches()
    bench.station.readout.begin()
    few = bench.station.frames(20)
    monkeypatch.setattr(bench.station, "untouched", lambda seconds, log: few)
    record = bench.run(short_plan("noise"))
    assert phase_of(record, "noise").problem.startswith(f"board 0x2C: gave {len(few)} frames in 0.")
    assert phase_of(record, "noise").problem.endswith("and noise needs 32; give it more seconds in the plan")


NAMING = """taxel_test_plan = 1
name = "x"
version = "1"
{phases}
"""


@pytest.mark.parametrize(
    ("phases", "found"),
    [
        ("[phases.electrical]", "'electrical'"),
        ("[phases.faults]\n[phases.electrical]", "'electrical'"),
        ("[phases.electrical]\n[phases.faults]\nenabled = false", "'electrical'"),
        ("[phases.faults]\nenabled = false", "none"),
        ("[phases.rest]\n[phases.faults]\n[kinds.palm.faults]\nenabled = false", "'rest'"),
    ],
)
def test_a_plan_that_would_not_name_what_is_found_is_refused(phases, found):
    plan = parse_plan(NAMING.format(phases=phases).encode(), "plan.toml")
    expected = f"plan.toml: phases: expected 'faults' as the last phase, found {found}; add"
    with pytest.raises(PlanError) as error:
        running.check_fit(plan)
    assert str(error.value).startswith(expected)


def test_a_kind_that_no_hand_has_is_refused():
    text = NAMING.format(phases="[phases.rest]\n[phases.faults]\n[kinds.plam.rest]\nseconds = 1.0")
    plan = parse_plan(text.encode(), "plan.toml")
    with pytest.raises(PlanError, match=r"kinds\.plam: expected a kind of board, found an unknown one; .*palm"):
        running.check_fit(plan, ["palm", "fingertip"])
    running.check_fit(plan)


def test_a_board_at_the_address_of_another_kind_is_noted(benches):
    bench = benches()
    hand = load_hand("allegro")
    moved = replace(hand, boards=(replace(hand.get_board(0x22), address=ADDRESS),))
    bench.station = open_station(bench.station.wire, ADDRESS, moved)
    record = bench.run(short_plan("identify"))
    assert "in hand 'allegro' the board of this address is of kind 'fingertip'" in phase_of(record, "identify").notes


def test_a_wire_that_ends_is_one_line(benches, monkeypatch):
    bench = benches()

    def end(timeout_s):
        raise EOFError

    def report(phase, fraction):
        if phase == "rest":
            monkeypatch.setattr(bench.station.wire.hub.stream, "poll", end)

    record = bench.run(short_plan("electrical", "rest", "frames"), report)
    assert record.outcome is Outcome.ERROR
    assert phase_of(record, "rest").outcome is Outcome.PASS  # it needs no more frames
    assert "virtual:: ended" in phase_of(record, "frames").problem
