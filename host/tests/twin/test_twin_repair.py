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
    taxels, sensors = make_tables()
    is_masked = np.zeros(TAXELS, bool)
    is_masked[list(masked)] = True
    board = sensors.index_of(taxels)
    return Repair.make(is_masked, np.full(TAXELS, gain), np.full(TAXELS, delay_s), taxels.position, board)


def make_alarm(reference, quantity, amplitude, level="board", number=-1, column=0) -> Alarm:
    sensors = reference.sensors
    place = Place(level, int(sensors.address[column]), sensors.name[column], number)
    return Alarm(1, 1.0, place, quantity, amplitude, "", None, 0.5, (0.0, 1.0), "")


def test_masked_taxel_gets_the_value_of_a_smooth_signal():
    taxels, _ = make_tables()
    signal = 100.0 + 1e4 * taxels.position[:, 0]
    broken = signal.copy()
    broken[9] = 0.0  # not on the border of the board
    repaired = make_repair([9]).apply(broken)
    assert repaired.signal[9] == pytest.approx(signal[9], rel=0.05)
    assert np.delete(repaired.signal, 9) == pytest.approx(np.delete(signal, 9))
    assert repaired.flags.tolist() == [INTERPOLATED if index == 9 else 0 for index in range(TAXELS)]


def test_board_without_an_intact_taxel_is_unknown():
    _, sensors = make_tables()
    own = np.flatnonzero(sensors.index_of(make_tables()[0]) == 0)
    signal = make_repair(own).apply(np.ones(TAXELS)).signal
    assert np.isnan(signal[own]).all()
    assert np.isfinite(np.delete(signal, own)).all()


def test_gain_and_delay_are_flagged():
    repaired = make_repair(gain=0.5, delay_s=0.1).apply(np.full(TAXELS, 50.0))
    assert repaired.signal == pytest.approx(np.full(TAXELS, 100.0))
    assert set(repaired.flags.tolist()) == {GAIN + DELAY}


def test_gain_of_zero_is_refused():
    with pytest.raises(ValueError, match="mask a taxel"):
        make_repair(gain=0.0)


@pytest.mark.parametrize(
    ("quantity", "amplitude", "flag"),
    [("gain", -0.4, GAIN), ("gain", -0.9, INTERPOLATED), ("noise", -4.0, INTERPOLATED), ("delay", 0.1, DELAY)],
)
def test_alarm_leads_to_its_correction(reference, quantity, amplitude, flag):
    planned = plan_repair(reference, [make_alarm(reference, quantity, amplitude, "taxel", 3)])
    assert planned.repair.flags[3] == flag
    assert np.count_nonzero(planned.repair.flags) == 1
    assert len(planned.corrections) == 1


@pytest.mark.parametrize(("quantity", "amplitude"), [("rest", 30.0), ("noise", 4.0), ("shape", 2.0), ("missing", 0.3)])
def test_other_changes_are_not_corrected(reference, quantity, amplitude):
    planned = plan_repair(reference, [make_alarm(reference, quantity, amplitude)])
    assert planned.corrections == ()
    assert not planned.repair.flags.any()


@pytest.mark.parametrize("repairs", [True, False])
def test_session_reports_its_corrections_only_on_request(reference, repairs):
    skin = SyntheticSkin(seed=5)
    learn(skin)
    first, before = skin.run_routine(10)
    skin.gain[:] = 0.5
    second, after = skin.run_routine(12)
    block = Block(*(np.concatenate(pair) for pair in zip(before, after, strict=True)))
    source = type("Source", (), {"is_live": False, "is_continuous": False, "blocks": lambda self: iter([block])})()
    session = TwinSession(Twin(reference, ContactSchedule([*first, *second])), source, None, repairs)
    updates = list(session.updates())
    found = [event for update in updates for event in update.events if isinstance(event, Repaired)]
    assert bool(found) == repairs
    assert (updates[-1].repair is not None) == repairs
