"""The history: what the same board showed before, what moved, and files that are none."""

from __future__ import annotations

import dataclasses
import math
import pickle
import sqlite3
import threading

import pytest

from taxel_tools.testing.drift import change_of
from taxel_tools.testing.errors import HistoryError
from taxel_tools.testing.history import History
from taxel_tools.testing.record import Limit, Measurement, Outcome


@pytest.fixture
def path(tmp_path):
    return tmp_path / "history.sqlite"


@pytest.fixture
def board(record_of):
    """A test of a board that showed this white noise; each at another time."""
    count = iter(range(1_000_000))

    def make(white, serial_number="AB-0001", place="TX 3"):
        record = record_of(lambda log: log.measure("white", white, "counts", place), serial_number=serial_number)
        return dataclasses.replace(record, started_utc=f"2026-01-31T09:30:00.{next(count):03}Z")

    return make


def measured(value, limit=None):
    return Measurement("white", value, "counts", limit, "TX 3", Outcome.PASS)


def moved(value, earlier, limit=None):
    return change_of("noise", measured(value, limit), earlier).moved


def test_a_board_that_is_tested_twice_is_compared_with_itself(path, board):
    with History(path) as history:
        history.add(board(4.0))
        history.add(board(5.0))
        history.add(board(1.0, serial_number="AB-0002"))
        (change,) = history.compare(board(4.2))
    assert (change.phase, change.measurement, change.place, change.unit) == ("noise", "white", "TX 3", "counts")
    assert (change.value, change.last, change.median, change.runs, change.moved) == (4.2, 5.0, 4.5, 2, False)


def test_a_record_is_not_its_own_past(path, board):
    first, second = board(4.0), board(4.4)
    with History(path) as history:
        history.add(first)
        history.add(second)
        assert history.compare(first) == []
        assert history.compare(second)[0].runs == 1


def test_the_same_record_is_kept_once(path, board):
    record = board(4.0)
    with History(path) as history:
        assert history.add(record) is True
        assert history.add(record) is False
        assert len(history.earlier("AB-0001")) == 1


def test_earlier_tests_are_told_the_newest_first(path, full_record, board):
    with History(path) as history:
        history.add(full_record)
        history.add(board(4.0))
        newest, oldest = history.earlier("AB-0001")
    assert (newest.outcome, newest.faults) == (Outcome.PASS, [])
    assert (oldest.outcome, oldest.operator, oldest.station) == (Outcome.ERROR, "Zoë", "bench 1")
    assert oldest.faults == ["open TX line, TX 5", "noisy TX line, TX 3"]
    assert (oldest.plan_name, oldest.started_utc) == ("boards", full_record.started_utc)


def test_boards_without_a_serial_number_are_not_one_board(path, board):
    with History(path) as history:
        history.add(board(4.0, serial_number=""))
        assert history.earlier("") == []
        assert history.compare(board(5.0, serial_number="")) == []


def test_a_history_outlives_the_program(path, board):
    with History(path) as history:
        history.add(board(4.0))
    with History(path) as history:
        assert len(history.earlier("AB-0001")) == 1


def test_hostile_text_stays_text(path, board):
    serial = "x'; DROP TABLE run; --"
    with History(path) as history:
        history.add(board(4.0, serial_number=serial))
        history.add(board(4.0, serial_number="Größe 黒", place="TX\x00\ud800"))
        assert [len(history.earlier(name)) for name in (serial, "Größe 黒", "x")] == [1, 1, 0]
        assert history.compare(board(4.0, serial_number="Größe 黒", place="TX\x00\ud800"))[0].runs == 1


def test_text_and_what_was_never_measured_have_no_change(path, full_record, board):
    with History(path) as history:
        history.add(full_record)
        later = dataclasses.replace(full_record, started_utc="2027-01-31T09:30:00.000Z")
        changes = {(one.measurement, one.place): one for one in history.compare(later)}
    assert list(changes) == [("supply", ""), ("white", "TX 3"), ("white", "TX 4")]


def test_what_was_not_finite_before_is_no_past(path, board):
    with History(path) as history:
        for white in (math.inf, math.nan, None):
            history.add(board(white))
        assert history.compare(board(4.0)) == []
        history.add(board(3.5))
        assert history.compare(board(4.0))[0].runs == 1


def test_other_units_are_not_compared(path, record_of):
    with History(path) as history:
        history.add(record_of(lambda log: log.measure("white", 4.0, "counts")))
        assert history.compare(record_of(lambda log: log.measure("white", 4.0, "mV"))) == []


def test_a_measurement_that_is_lost_now_has_moved():
    assert moved(math.nan, [4.0])
    assert moved(None, [4.0])
    assert moved(math.inf, [4.0])


def test_with_five_earlier_tests_their_own_spread_is_the_measure():
    earlier = [10.0, 10.2, 9.8, 10.1, 9.9]  # median absolute deviation 0.1, robust standard deviation 0.148
    assert not moved(10.7, earlier)
    assert moved(10.75, earlier)
    assert moved(9.2, earlier)


def test_one_earlier_outlier_does_not_widen_the_spread():
    assert moved(12.0, [10.0, 10.2, 9.8, 10.1, 9.9, 500.0])


def test_earlier_values_that_are_all_alike_allow_a_twentieth():
    assert not moved(104.0, [100.0] * 5)
    assert moved(106.0, [100.0] * 5)
    assert moved(1.0, [0.0] * 5)
    assert not moved(0.0, [0.0] * 5)


def test_with_fewer_the_way_to_the_limit_is_the_measure():
    limit = Limit(None, 8.0)
    assert not moved(4.9, [4.0], limit)
    assert moved(5.1, [4.0], limit)
    assert moved(2.9, [4.0], limit)


def test_with_two_bounds_the_one_that_it_moved_towards_counts():
    limit = Limit(0.0, 20.0)
    assert not moved(12.5, [16.0], limit)  # down it is 16 to the bound, up 4
    assert moved(12.5, [16.0], Limit(10.0, 20.0))
    assert moved(17.1, [16.0], limit)


def test_close_to_its_limit_a_value_may_still_tremble():
    assert not moved(7.8, [7.9], Limit(None, 8.0))
    assert moved(7.6, [7.9], Limit(None, 8.0))


def test_without_a_limit_few_tests_say_nothing():
    assert not moved(400.0, [4.0, 4.0])


@pytest.mark.parametrize("content", [b"no database at all " * 100, b"SQLite format 3\0" + bytes(4000)])
def test_a_file_that_is_no_database_is_one_line(path, content):
    path.write_bytes(content)
    with pytest.raises(HistoryError, match=r"history\.sqlite: expected a history of tests, found: ") as caught:
        History(path)
    assert "\n" not in str(caught.value)
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
    assert path.read_bytes() == content


def test_another_programs_database_is_left_alone(path):
    with sqlite3.connect(path) as other:
        other.execute("CREATE TABLE run (id INTEGER)")
        other.execute("PRAGMA user_version = 1")
    other.close()
    before = path.read_bytes()
    with pytest.raises(HistoryError, match="found another program's database; name another file"):
        History(path)
    assert path.read_bytes() == before


def test_a_newer_history_is_one_line(path):
    History(path).close()
    with sqlite3.connect(path) as other:
        other.execute("PRAGMA user_version = 2")
    other.close()
    with pytest.raises(
        HistoryError, match="expected a history of version 1, found version 2; use a release that knows"
    ):
        History(path)


def test_a_damaged_history_is_one_line(path, board):
    with History(path) as history:
        history.add(board(4.0))
    path.write_bytes(path.read_bytes()[:6000])

    def use():
        with History(path) as history:
            history.earlier("AB-0001")
            history.add(board(4.0))

    with pytest.raises(HistoryError, match="found: "):
        use()


def test_a_folder_that_is_not_there_is_one_line(tmp_path):
    with pytest.raises(
        HistoryError, match=r"h\.sqlite: cannot be used: unable to open database file; check its folder"
    ):
        History(tmp_path / "none" / "h.sqlite")


def test_stations_that_write_at_once_lose_no_test(path, board):
    records = [[board(float(index), serial_number=f"S{station}") for index in range(6)] for station in range(4)]
    failed = []

    def station(mine):
        try:
            with History(path) as history:  # the four make the file at once, too
                for record in mine:
                    history.add(record)
        except Exception as error:
            failed.append(error)

    threads = [threading.Thread(target=station, args=(mine,)) for mine in records]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed == []
    with History(path) as history:
        assert [len(history.earlier(f"S{station}")) for station in range(4)] == [6] * 4


def test_a_test_is_kept_whole_or_not_at_all(path, board, monkeypatch):
    with History(path) as history:
        monkeypatch.setattr(history, "_add_parts", lambda run, record: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            history.add(board(4.0))
        assert history.earlier("AB-0001") == []
        monkeypatch.undo()
        assert history.add(board(4.0)) is True


def test_a_station_that_waits_too_long_is_told(path, board, monkeypatch):
    monkeypatch.setattr("taxel_tools.testing.history.PATIENCE_S", 0.0)
    with History(path) as history:
        other = sqlite3.connect(path, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(HistoryError, match="database is locked"):
            history.add(board(4.0))
        other.close()
        assert history.add(board(4.0)) is True
