"""Announced contacts and the steps of a stream."""

import numpy as np
import pytest

from taxel.twin import Contact, ContactSchedule, TwinInputError, read_schedule
from taxel.twin.steps import BEFORE, CLOSING, HOLD, REST, StepBuilder

HEADER = "closing_s,hold_s,release_s,recovery_s,end_s,object,approach\n"


def test_each_row_of_a_csv_file_is_read_as_a_contact(tmp_path):
    path = tmp_path / "contacts.csv"
    path.write_text(HEADER + "5,6,7,8,9,peg,press_1\n")
    assert list(read_schedule(path)) == [Contact((5.0, 6.0, 7.0, 8.0, 9.0), ("peg", "press_1"))]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,b\n1,2\n", "line 1: expected the columns"),
        (HEADER + "5,6,x,8,9,peg,press\n", "line 2: release_s"),
        (HEADER + "5,6,nan,8,9,peg,press\n", "line 2: release_s"),
        (HEADER + "9,8,7,6,5,peg,press\n", "increasing times"),
        (HEADER + "5,6,7,8,9,,press\n", "line 2: object: expected a name without surrounding spaces"),
        (HEADER + "5,6,7,8,9,peg,press,more\n", "line 2: expected 7 entries, found 8"),
        (HEADER + '5,6,7,8,9,peg,"pr\ness"\n', "approach: expected a name"),
        (HEADER + "5,6,7,8,9,peg,a\n8,9,10,11,12,peg,b\n", "a start at or after 9 s"),
    ],
)
def test_invalid_schedule_is_rejected_with_a_message_that_names_the_expected_content(tmp_path, text, message):
    path = tmp_path / "contacts.csv"
    path.write_text(text)
    with pytest.raises(TwinInputError, match=message):
        read_schedule(path)


def test_frames_of_a_contact_are_averaged_by_phase():
    contact = Contact((6.0, 7.0, 8.0, 9.0, 10.0), ("peg", "press"))
    builder = StepBuilder(ContactSchedule([contact]), np.zeros(1, np.int64), 1, baseline_s=2.0)
    times = np.arange(0.05, 12.0, 0.1)
    raw = np.where((times >= 7.0) & (times < 8.0), 900, 1000).astype(np.uint16)[:, None]
    (step,) = builder.take(times, raw, np.ones((len(times), 1), bool))
    means = step.compute_means()[:, 0]
    assert means[REST] == 1000.0
    assert (means[HOLD] == 900.0).all()
    assert (means[CLOSING] == 1000.0).all()
    # At 10 frames a second: 6 s without contact, of which the last 2 s are the baseline.
    assert step.count[[REST, BEFORE], 0].tolist() == [60, 20]


def test_long_interval_without_frames_gives_no_steps_of_its_own():
    builder = StepBuilder(ContactSchedule(), np.zeros(1, np.int64), 1)
    one_frame = np.ones((1, 1), np.uint16)
    builder.take(np.array([0.0]), one_frame, np.ones((1, 1), bool))
    steps = builder.take(np.array([1e6]), one_frame, np.ones((1, 1), bool))
    assert len(steps) == 1  # the step of the first frame
