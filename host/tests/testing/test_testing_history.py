"""History of tests: earlier results of a board, changes, and invalid files."""

import dataclasses
import math
import pickle
import sqlite3
import threading

import pytest

from taxel_tools.testing.drift import compare_value
from taxel_tools.testing.errors import HistoryError
from taxel_tools.testing.history import History
from taxel_tools.testing.record import Limit, Measurement, Outcome


@pytest.fixture
def path(tmp_path):
    return tmp_path / "history.sqlite"


@pytest.fixture
def make_board_record(make_record):
    """Factory of records of a board with a given white noise, each at a different time."""
    count = iter(range(1_000_000))

    def make(white, serial_number="AB-0001", place="TX 3"):
        """Create a record with the white noise of one place; each record has a later time."""
        record = make_record(lambda log: log.measure("white", white, "counts", place), serial_number=serial_number)
        return dataclasses.replace(record, started_utc=f"2026-01-31T09:30:00.{next(count):03}Z")

    return make


def make_measurement(value, limit=None):
    return Measurement("white", value, "counts", limit, "TX 3", Outcome.PASS)


def has_moved(value, earlier, limit=None):
    """Return whether a value is reported as moved, compared with earlier values (oldest first)."""
    return compare_value("noise", make_measurement(value, limit), earlier).has_moved


def test_a_board_is_compared_with_its_earlier_tests(path, make_board_record):
    with History(path) as history:
        history.add(make_board_record(4.0))
        history.add(make_board_record(5.0))
        history.add(make_board_record(1.0, serial_number="AB-0002"))  # another board, which is not compared
        (change,) = history.compare(make_board_record(4.2))
    assert (change.phase, change.measurement, change.place, change.unit) == ("noise", "white", "TX 3", "counts")
    assert (change.value, change.last, change.median, change.runs, change.has_moved) == (4.2, 5.0, 4.5, 2, False)


def test_a_record_is_compared_only_with_records_added_before_it(path, make_board_record):
    """The first record has no earlier record, and the second has one: no record is compared with itself or later ones.

    `runs` is the number of earlier records that contain the measurement.
    """
    first, second = make_board_record(4.0), make_board_record(4.4)
    with History(path) as history:
        history.add(first)
        history.add(second)
        assert history.compare(first) == []
        assert history.compare(second)[0].runs == 1


def test_the_same_record_is_stored_once(path, make_board_record):
    record = make_board_record(4.0)
    with History(path) as history:
        assert history.add(record) is True
        assert history.add(record) is False
        assert len(history.list_earlier("AB-0001")) == 1


def test_earlier_tests_are_listed_newest_first(path, full_record, make_board_record):
    with History(path) as history:
        history.add(full_record)
        history.add(make_board_record(4.0))
        newest, oldest = history.list_earlier("AB-0001")
    assert (newest.outcome, newest.faults) == (Outcome.PASS, [])
    assert (oldest.outcome, oldest.operator, oldest.station) == (Outcome.ERROR, "Zoë", "bench 1")
    assert oldest.faults == ["open TX line, TX 5", "noisy TX line, TX 3"]
    assert (oldest.plan_name, oldest.started_utc) == ("boards", full_record.started_utc)


def test_boards_without_a_serial_number_are_not_compared(path, make_board_record):
    with History(path) as history:
        history.add(make_board_record(4.0, serial_number=""))
        assert history.list_earlier("") == []
        assert history.compare(make_board_record(5.0, serial_number="")) == []


def test_a_history_is_persistent(path, make_board_record):
    with History(path) as history:
        history.add(make_board_record(4.0))
    with History(path) as history:
        assert len(history.list_earlier("AB-0001")) == 1


def test_hostile_text_is_stored_as_text(path, make_board_record):
    serial = "x'; DROP TABLE run; --"
    with History(path) as history:
        history.add(make_board_record(4.0, serial_number=serial))
        history.add(make_board_record(4.0, serial_number="Größe 黒", place="TX\x00\ud800"))
        assert [len(history.list_earlier(name)) for name in (serial, "Größe 黒", "x")] == [1, 1, 0]
        assert history.compare(make_board_record(4.0, serial_number="Größe 黒", place="TX\x00\ud800"))[0].runs == 1


def test_text_and_new_measurements_are_not_compared(path, full_record, make_board_record):
    """The record also has a text (firmware), and values that were not finite (TX 5) or missing (TX 6) before."""
    with History(path) as history:
        history.add(full_record)
        later = dataclasses.replace(full_record, started_utc="2027-01-31T09:30:00.000Z")
        changes = {(change.measurement, change.place): change for change in history.compare(later)}
    assert list(changes) == [("supply", ""), ("white", "TX 3"), ("white", "TX 4")]


def test_earlier_values_that_are_not_finite_are_ignored(path, make_board_record):
    with History(path) as history:
        for white in (math.inf, math.nan, None):
            history.add(make_board_record(white))
        assert history.compare(make_board_record(4.0)) == []
        history.add(make_board_record(3.5))
        assert history.compare(make_board_record(4.0))[0].runs == 1  # only the finite value


def test_values_in_different_units_are_not_compared(path, make_record):
    with History(path) as history:
        history.add(make_record(lambda log: log.measure("white", 4.0, "counts")))
        assert history.compare(make_record(lambda log: log.measure("white", 4.0, "mV"))) == []


def test_a_value_that_is_missing_or_not_finite_has_moved():
    assert has_moved(math.nan, [4.0])
    assert has_moved(None, [4.0])
    assert has_moved(math.inf, [4.0])


def test_with_five_earlier_tests_their_spread_is_the_scale():
    """A value has moved if it is more than five robust standard deviations from the median."""
    earlier = [10.0, 10.2, 9.8, 10.1, 9.9]  # Median absolute deviation 0.1, robust standard deviation 0.148.
    assert not has_moved(10.7, earlier)
    assert has_moved(10.75, earlier)
    assert has_moved(9.2, earlier)


def test_an_earlier_outlier_does_not_widen_the_spread():
    assert has_moved(12.0, [10.0, 10.2, 9.8, 10.1, 9.9, 500.0])


def test_identical_earlier_values_permit_a_change_of_five_percent():
    """A value may differ from the median by five standard deviations.

    The standard deviation is assumed to be at least 1 % of the median, which gives 5 % for identical earlier values.
    """
    assert not has_moved(104.0, [100.0] * 5)
    assert has_moved(106.0, [100.0] * 5)
    assert has_moved(1.0, [0.0] * 5)
    assert not has_moved(0.0, [0.0] * 5)


def test_with_fewer_earlier_tests_the_distance_to_the_limit_is_the_scale():
    """The permitted difference from the median is a quarter of the distance from the median to the bound.

    Here the median is 4 and the bound is 8: the distance is 4, and a difference of up to 1 is permitted.
    """
    limit = Limit(None, 8.0)
    assert not has_moved(4.9, [4.0], limit)
    assert has_moved(5.1, [4.0], limit)
    assert has_moved(2.9, [4.0], limit)


def test_with_two_bounds_the_bound_in_the_direction_of_the_change_is_the_scale():
    limit = Limit(0.0, 20.0)
    assert not has_moved(12.5, [16.0], limit)  # The distance to the lower bound is 16, to the upper bound 4.
    assert has_moved(12.5, [16.0], Limit(10.0, 20.0))
    assert has_moved(17.1, [16.0], limit)


def test_a_small_change_close_to_the_limit_is_permitted():
    assert not has_moved(7.8, [7.9], Limit(None, 8.0))
    assert has_moved(7.6, [7.9], Limit(None, 8.0))


def test_without_a_limit_few_tests_are_not_compared():
    assert not has_moved(400.0, [4.0, 4.0])


@pytest.mark.parametrize("content", [b"no database at all " * 100, b"SQLite format 3\0" + bytes(4000)])
def test_a_file_that_is_not_a_database_gives_one_error_line(path, content):
    path.write_bytes(content)
    with pytest.raises(HistoryError, match=r"history\.sqlite: expected a history of tests, found: ") as caught_error:
        History(path)
    assert "\n" not in str(caught_error.value)
    assert str(pickle.loads(pickle.dumps(caught_error.value))) == str(caught_error.value)
    assert path.read_bytes() == content


def test_the_database_of_another_program_is_not_changed(path):
    with sqlite3.connect(path) as other:
        other.execute("CREATE TABLE run (id INTEGER)")
        other.execute("PRAGMA user_version = 1")
    other.close()
    before = path.read_bytes()
    with pytest.raises(HistoryError, match="found the database of another program; choose another file"):
        History(path)
    assert path.read_bytes() == before


def test_a_newer_history_gives_one_error_line(path):
    History(path).close()
    with sqlite3.connect(path) as other:
        other.execute("PRAGMA user_version = 2")
    other.close()
    with pytest.raises(HistoryError, match="expected a history of version 1, found version 2; use a newer release"):
        History(path)


def test_a_damaged_history_gives_one_error_line(path, make_board_record):
    with History(path) as history:
        history.add(make_board_record(4.0))
    path.write_bytes(path.read_bytes()[:6000])

    def use_history():
        with History(path) as history:
            history.list_earlier("AB-0001")
            history.add(make_board_record(4.0))

    with pytest.raises(HistoryError, match="found: "):
        use_history()


def test_a_missing_folder_gives_one_error_line(tmp_path):
    with pytest.raises(
        HistoryError, match=r"h\.sqlite: cannot be used: unable to open database file; check the folder"
    ):
        History(tmp_path / "none" / "h.sqlite")


def test_stations_that_write_concurrently_lose_no_test(path, make_board_record):
    records = [
        [make_board_record(float(index), serial_number=f"S{station}") for index in range(6)] for station in range(4)
    ]
    failed = []

    def run_station(own_records):
        try:
            with History(path) as history:  # All four threads create the file concurrently.
                for record in own_records:
                    history.add(record)
        except Exception as error:
            failed.append(error)

    threads = [threading.Thread(target=run_station, args=(own_records,)) for own_records in records]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert failed == []
    with History(path) as history:
        assert [len(history.list_earlier(f"S{station}")) for station in range(4)] == [6] * 4


def test_a_test_whose_storage_fails_is_not_stored_and_can_be_added_again(path, make_board_record, monkeypatch):
    with History(path) as history:
        monkeypatch.setattr(history, "_add_details", lambda run, record: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            history.add(make_board_record(4.0))
        assert history.list_earlier("AB-0001") == []
        monkeypatch.undo()
        assert history.add(make_board_record(4.0)) is True


def test_a_locked_history_refuses_a_test_until_it_is_unlocked(path, make_board_record, monkeypatch):
    monkeypatch.setattr("taxel_tools.testing.history.LOCK_TIMEOUT_S", 0.0)
    with History(path) as history:
        other_connection = sqlite3.connect(path, isolation_level=None)
        other_connection.execute("BEGIN IMMEDIATE")
        with pytest.raises(HistoryError, match="database is locked"):
            history.add(make_board_record(4.0))
        other_connection.close()
        assert history.add(make_board_record(4.0)) is True
