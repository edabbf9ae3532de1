"""Phases on an emulated board: measurements and faults, through the hub and over an adapter."""

from dataclasses import replace

import numpy as np
import pytest

from host.tests.bench.conftest import ADDRESS, find_phase, find_value, list_faults, make_bench_url, make_short_plan
from taxel.hand import BoardKind, load_hand
from taxel_protocol.limits import REGISTER_SETTINGS
from taxel_tools.bench import running
from taxel_tools.bench.board_under_test import open_board
from taxel_tools.errors import BoardError, PlanError
from taxel_tools.procedure import Transfer
from taxel_tools.scheduler import run
from taxel_tools.testing.plan import parse_plan
from taxel_tools.testing.record import Outcome

WIRES = ("hub", "i2c")
BOARD = f"board=0x{ADDRESS:02X}"


@pytest.mark.parametrize("wire", WIRES)
def test_a_healthy_board_passes_with_the_values_of_the_emulator(benches, wire):
    """Values of the emulated board: noise 4 counts, count at rest 2440, response 730 counts at 1 N.

    `fall` is the share of the count at rest by which the largest force of the phase "loading" lowers the count.
    """
    bench = benches(wire=wire)
    bench.board.draws_pictures = True
    record = bench.run(make_short_plan())
    assert (record.outcome, list_faults(record)) == (Outcome.PASS, [])
    assert find_value(record, "noise", "white") == pytest.approx(4.0, rel=0.1)
    assert find_value(record, "rest", "median") == pytest.approx(2440.0, abs=60.0)
    assert find_value(record, "electrical", "capacitance", "TX 3") == pytest.approx(1.0, abs=0.1)
    assert find_value(record, "presses", "response") == pytest.approx(730.0, rel=0.15)
    assert find_value(record, "presses", "snr") == pytest.approx(730.0 / 4.0, rel=0.2)
    assert find_value(record, "presses", "crosstalk", "along TX lines") < 0.01
    assert find_value(record, "loading", "hysteresis") < 0.02
    assert find_value(record, "loading", "fall") == pytest.approx(0.66, abs=0.03)
    assert 0.005 < find_value(record, "small_forces", "visible") < 0.03
    assert find_value(record, "frames", "bus_errors") == 0.0
    assert find_value(record, "frames", "rate_of_scans") > 0.6
    assert find_value(record, "identify", "kind") == "medial_front"
    pictures = [attachment.name for phase in record.phases for attachment in phase.attachments]
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
    assert all(attachment.data.startswith(b"\x89PNG") for phase in record.phases for attachment in phase.attachments)
    assert record.device["probe"] == "emulated probe"


def test_the_clock_of_the_board_is_measured_over_an_adapter(benches):
    record = benches("effect clock skew ppm=5000", wire="i2c").run(make_short_plan("frames"))
    reference = benches(wire="i2c").run(make_short_plan("frames"))
    difference = find_value(record, "frames", "clock") - find_value(reference, "frames", "clock")
    assert difference == pytest.approx(5000.0, abs=1500.0)  # ppm; each of the frames in 2 s may be late by one scan


@pytest.mark.parametrize("wire", WIRES)
@pytest.mark.parametrize(
    ("effect", "fault"),
    [
        (f"line open {BOARD} axis=0 index=2", ("open line", "TX 2")),
        (f"line short {BOARD} axis=1 index=1", ("short", "RX 1 and RX 2")),
        (f"dead rest {BOARD} taxel=9", ("dead taxel", "taxel 9")),
    ],
)
def test_a_fault_is_reported_at_its_location(benches, wire, effect, fault):
    record = benches(f"effect {effect}", wire=wire).run(make_short_plan("electrical", "rest", "presses"))
    assert (record.outcome, list_faults(record)) == (Outcome.FAIL, [fault])


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
def test_a_fault_is_reported_by_the_phases_that_detect_it(benches, effect, fault, phases):
    record = benches(f"effect {effect}").run(make_short_plan(*phases))
    assert (record.outcome, list_faults(record)) == (Outcome.FAIL, [fault])


@pytest.mark.parametrize("wire", WIRES)
def test_a_bus_that_loses_reads_is_reported(benches, wire):
    record = benches("effect silent flaky p=0.2 burst=1", wire=wire).run(make_short_plan("frames"))
    assert list_faults(record) == [("bus errors", "board")]
    # Failures per 1000 reads; one addressing in five fails. The adapter addresses the board twice for each read (400).
    # The hub addresses the board once, and twice after a failed read, so its rate lies between 200 and 400.
    assert find_value(record, "frames", "bus_errors") == pytest.approx(300.0 if wire == "hub" else 400.0, rel=0.25)


def test_a_board_without_signal_has_one_fault(benches):
    lines = [f"effect gain electrode {BOARD} factor=0.01", f"effect gain idac {BOARD} factor=0.01"]
    record = benches(*lines).run(make_short_plan("electrical"))
    assert list_faults(record) == [("no signal", "board")]


def test_phases_with_indentations_are_skipped_without_a_probe(benches):
    record = benches(probe="none").run(make_short_plan("electrical", "presses", "loading", "small_forces"))
    assert record.outcome is Outcome.PASS
    for name in ("presses", "loading", "small_forces"):
        assert find_phase(record, name).outcome is Outcome.SKIP
        assert find_phase(record, name).notes == ["cannot run: no probe; choose one with --probe"]
    assert "no taxel was indented" in find_phase(record, "faults").notes[0]


@pytest.mark.parametrize("wire", WIRES)
def test_unplugging_the_board_during_the_test_is_an_error(benches, wire):
    bench = benches(wire=wire)
    unplugged_in = []

    def report(phase, fraction):
        if phase == "presses" and fraction > 0.5 and not unplugged_in:
            unplugged_in.append(phase)
            bench.world.inject("unplug", ADDRESS)

    record = bench.run(make_short_plan("rest", "presses", "small_forces"), report)
    assert record.outcome is Outcome.ERROR
    outcomes = {phase.name: phase.outcome for phase in record.phases}
    assert outcomes["rest"] is Outcome.PASS
    assert (outcomes["presses"], outcomes["small_forces"]) == (Outcome.ERROR, Outcome.ERROR)
    expected = "board 0x2C: no frame for 2.0 s; check plug and power"
    assert find_phase(record, "presses").problem == expected


def test_error_flags_of_the_board_are_reported(benches):
    bench = benches(wire="i2c")

    def write_invalid_settings():
        yield Transfer(ADDRESS, bytes([REGISTER_SETTINGS]) + bytes(12))

    run(bench.board.wire, write_invalid_settings())
    record = bench.run(make_short_plan("identify"))
    assert list_faults(record) == [("board error", "board")]
    assert "reported error flags: settings rejected" in record.findings()[0].text


def test_the_plan_can_require_a_firmware_version(benches):
    record = benches().run(
        make_short_plan("identify", **{"[phases.identify]": '[phases.identify]\nfirmware = "9.9.9"'})
    )
    assert list_faults(record) == [("wrong firmware", "board")]
    assert "firmware 0.1.0, the plan requires 9.9.9; use taxel flash" in record.findings()[0].text


def test_a_wrong_crossing_map_is_reported(benches):
    """In the changed description of the board, one crossing is at another place than on the emulated board."""
    hand = load_hand("allegro")
    board = hand.get_board(ADDRESS)
    crossings = board.kind.crossings.copy()
    tx, rx = np.argwhere(crossings)[0]
    crossings[tx, rx], crossings[np.argwhere(~crossings)[0][0], np.argwhere(~crossings)[0][1]] = False, True
    kind = BoardKind("medial_front", board.kind.code, crossings)
    bench = benches()
    wrong_hand = replace(hand, boards=(replace(board, kind=kind),))
    bench.board = open_board(bench.board.wire, ADDRESS, wrong_hand)
    record = bench.run(make_short_plan("identify"))
    assert list_faults(record) == [("wrong crossing map", "board")]


def test_a_board_of_unknown_kind_is_tested(benches):
    bench = benches()
    bench.board = open_board(bench.board.wire, ADDRESS, load_hand("rig4"))
    record = bench.run(make_short_plan("identify", "electrical"))
    assert record.outcome is Outcome.PASS
    assert record.device["kind"] == "kind 4"
    assert "hand 'rig4' has no kind 4; the board was not compared with it" in find_phase(record, "identify").notes


def test_an_address_without_a_board_gives_one_error_line(benches):
    with pytest.raises(BoardError, match="board 0x60: does not answer; run taxel scan to list the boards"):
        open_board(benches().board.wire, 0x60, None)


def test_a_board_in_its_bootloader_is_refused(benches):
    """A blank board has no address of its own: its bootloader answers at the default address 0x77."""
    with (
        running.open_bench(make_bench_url(f"blank 0x{ADDRESS:02X}")) as (wire, _),
        pytest.raises(BoardError, match="board 0x77: runs no taxel application; identify it with taxel scan"),
    ):
        open_board(wire, 0x77, None)


def test_the_record_of_the_untouched_board_is_shared(benches):
    bench = benches()
    record = bench.run(make_short_plan("electrical", "rest", "noise", "drift"))
    assert [round(phase.seconds, 1) for phase in record.phases] == [3.0, 0.0, 0.0, 0.0, 0.0]


def test_too_few_frames_for_the_noise_give_one_error_line(benches, monkeypatch):
    bench = benches()
    bench.board.readout.start()
    capture = bench.board.read_frames(20)
    monkeypatch.setattr(bench.board, "read_at_rest", lambda seconds, log: capture)
    record = bench.run(make_short_plan("noise"))
    problem = find_phase(record, "noise").problem
    assert problem.startswith(f"board 0x2C: expected at least 32 frames for the noise, found {len(capture)} in 0.")
    assert problem.endswith("increase 'seconds' in the plan")


MERGING_PLAN = """taxel_test_plan = 1
name = "x"
version = "1"
{phases}
"""


@pytest.mark.parametrize(
    ("phases", "found_phase"),
    [
        ("[phases.electrical]", "'electrical'"),
        ("[phases.faults]\n[phases.electrical]", "'electrical'"),
        ("[phases.electrical]\n[phases.faults]\nenabled = false", "'electrical'"),
        ("[phases.faults]\nenabled = false", "none"),
        ("[phases.rest]\n[phases.faults]\n[kinds.palm.faults]\nenabled = false", "'rest'"),
    ],
)
def test_a_plan_without_the_merging_phase_at_its_end_is_refused(phases, found_phase):
    plan = parse_plan(MERGING_PLAN.format(phases=phases).encode(), "plan.toml")
    expected = f"plan.toml: phases: expected 'faults' as the last phase, found {found_phase}; add"
    with pytest.raises(PlanError) as error:
        running.load_plan_phases(plan)
    assert str(error.value).startswith(expected)


def test_a_kind_that_is_not_in_the_hand_description_is_refused():
    text = MERGING_PLAN.format(phases="[phases.rest]\n[phases.faults]\n[kinds.plam.rest]\nseconds = 1.0")
    plan = parse_plan(text.encode(), "plan.toml")
    with pytest.raises(PlanError, match=r"kinds\.plam: expected a kind of board, found an unknown one; .*palm"):
        running.load_plan_phases(plan, ["palm", "fingertip"])


def test_kinds_are_not_checked_without_a_hand_description():
    text = MERGING_PLAN.format(phases="[phases.rest]\n[phases.faults]\n[kinds.plam.rest]\nseconds = 1.0")
    phases = running.load_plan_phases(parse_plan(text.encode(), "plan.toml"))
    assert [phase.name for phase in phases] == ["rest", "faults"]


def test_a_board_at_the_address_of_another_kind_is_noted(benches):
    bench = benches()
    hand = load_hand("allegro")
    changed_hand = replace(hand, boards=(replace(hand.get_board(0x22), address=ADDRESS),))
    bench.board = open_board(bench.board.wire, ADDRESS, changed_hand)
    record = bench.run(make_short_plan("identify"))
    assert "in hand 'allegro' the board at this address is of kind 'fingertip'" in find_phase(record, "identify").notes


def test_the_end_of_the_link_gives_one_error_line(benches, monkeypatch):
    bench = benches()

    def raise_end_of_file(timeout_s):
        raise EOFError

    def report(phase, fraction):
        if phase == "rest":
            monkeypatch.setattr(bench.board.wire.hub.stream, "poll", raise_end_of_file)

    record = bench.run(make_short_plan("electrical", "rest", "frames"), report)
    assert record.outcome is Outcome.ERROR
    assert find_phase(record, "rest").outcome is Outcome.PASS  # This phase uses the existing record.
    assert "virtual:: the link ended" in find_phase(record, "frames").problem
