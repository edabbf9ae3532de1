"""Corrections of known faults: interpolation, gain, delay; and the alarms that lead to them."""

import numpy as np
import pytest

from host.tests.twin.synthetic_skin import TAXELS, SyntheticSkin, learn, make_tables
from taxel.twin import Alarm, ContactSchedule, Twin
from taxel.twin.events import Repaired
from taxel.twin.places import Place
from taxel.twin.repair import DELAY, GAIN, INTERPOLATED, Repair
from taxel.twin.self_repair import plan_repair
from taxel.twin.session import TwinSession
from taxel.twin.sources import Block


@pytest.fixture(scope="module")
def reference():
    return learn(SyntheticSkin(seed=5))


def make_repair(masked=(), gain=1.0, delay_s=0.0) -> Repair:
    """Create corrections that mask the taxels `masked`, and apply one gain and one delay to all taxels."""
    taxels, sensors = make_tables()
    is_masked = np.zeros(TAXELS, bool)
    is_masked[list(masked)] = True
    board = sensors.index_of(taxels)
    return Repair.make(is_masked, np.full(TAXELS, gain), np.full(TAXELS, delay_s), taxels.position, board)


def make_alarm(reference, quantity, amplitude, level="board", number=-1) -> Alarm:
    """Create an alarm at a place of the first board: the board itself, or a taxel or line with this number."""
    sensors = reference.sensors
    place = Place(level, int(sensors.address[0]), sensors.name[0], number)
    return Alarm(
        number=1,
        time_s=1.0,
        place=place,
        quantity=quantity,
        amplitude=amplitude,
        unit="",
        size_counts=None,
        onset_s=0.5,
        onset_ci95=(0.0, 1.0),
        words="",
    )


MASKED = 9
"""A taxel that is not on the border of its board."""


def make_linear_signal() -> np.ndarray:
    """Make signals f64[n] that increase linearly along the boards, counts."""
    taxels, _ = make_tables()
    return 100.0 + 1e4 * taxels.position[:, 0]


def test_masked_taxel_gets_the_value_that_its_neighbours_interpolate():
    signal = make_linear_signal()
    broken = signal.copy()
    broken[MASKED] = 0.0
    repaired = make_repair([MASKED]).apply(broken)
    assert repaired.signal[MASKED] == pytest.approx(signal[MASKED], rel=0.05)


def test_interpolation_of_a_masked_taxel_leaves_the_other_signals_unchanged():
    signal = make_linear_signal()
    repaired = make_repair([MASKED]).apply(signal)
    assert np.delete(repaired.signal, MASKED) == pytest.approx(np.delete(signal, MASKED))


def test_only_the_masked_taxel_is_flagged_as_interpolated():
    repaired = make_repair([MASKED]).apply(make_linear_signal())
    assert repaired.flags.tolist() == [INTERPOLATED if index == MASKED else 0 for index in range(TAXELS)]


def test_only_signals_of_a_board_without_an_intact_taxel_become_nan():
    taxels, sensors = make_tables()
    on_first_board = np.flatnonzero(sensors.index_of(taxels) == 0)
    signal = make_repair(on_first_board).apply(np.ones(TAXELS)).signal
    assert np.isnan(signal[on_first_board]).all()
    assert np.isfinite(np.delete(signal, on_first_board)).all()


def test_signals_are_divided_by_the_gain():
    repaired = make_repair(gain=0.5).apply(np.full(TAXELS, 50.0))
    assert repaired.signal == pytest.approx(np.full(TAXELS, 100.0))


def test_gain_and_delay_of_every_taxel_are_flagged():
    repaired = make_repair(gain=0.5, delay_s=0.1).apply(np.full(TAXELS, 50.0))
    assert set(repaired.flags.tolist()) == {GAIN + DELAY}


def test_gain_of_zero_raises_a_value_error():
    with pytest.raises(ValueError, match="mask a taxel"):
        make_repair(gain=0.0)


@pytest.mark.parametrize(
    ("quantity", "amplitude", "flag"),
    [("gain", -0.4, GAIN), ("gain", -0.9, INTERPOLATED), ("noise", -4.0, INTERPOLATED), ("delay", 0.1, DELAY)],
)
def test_alarm_of_a_taxel_leads_to_one_correction_of_this_taxel_alone(reference, quantity, amplitude, flag):
    """The amplitude of "gain" is a relative change: -40 % is corrected by a gain, -90 % by interpolation."""
    planned = plan_repair(reference, [make_alarm(reference, quantity, amplitude, level="taxel", number=3)])
    assert planned.repair.flags[3] == flag
    assert np.count_nonzero(planned.repair.flags) == 1
    assert len(planned.corrections) == 1


@pytest.mark.parametrize(("quantity", "amplitude"), [("rest", 30.0), ("noise", 4.0), ("shape", 2.0), ("missing", 0.3)])
def test_alarm_of_a_quantity_without_a_correction_is_not_corrected(reference, quantity, amplitude):
    planned = plan_repair(reference, [make_alarm(reference, quantity, amplitude)])
    assert planned.corrections == ()
    assert not planned.repair.flags.any()


@pytest.mark.parametrize("repairs", [True, False])
def test_session_reports_its_corrections_only_on_request(reference, repairs):
    skin = SyntheticSkin(seed=5)
    learn(skin)  # the same contacts as in the fixture, so that the skin continues after them
    first, before = skin.run_routine(10)
    skin.gain[:] = 0.5
    second, after = skin.run_routine(12)
    block = Block(*(np.concatenate(pair) for pair in zip(before, after, strict=True)))
    members = {"is_live": False, "is_continuous": False, "session_starts_s": ()}
    methods = {"blocks": lambda self: iter([block]), "get_unique_ids": lambda self: {}}
    source = type("Source", (), members | methods)()
    session = TwinSession(Twin(reference, ContactSchedule([*first, *second])), source, None, repairs)
    updates = list(session.updates())
    found = [event for update in updates for event in update.events if isinstance(event, Repaired)]
    assert bool(found) == repairs
    assert (updates[-1].repair is not None) == repairs
