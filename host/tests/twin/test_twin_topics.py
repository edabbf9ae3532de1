"""Messages of the twin: frame, events and diagnostics."""

import json

import numpy as np
import pytest

from host.tests.twin.synthetic_skin import ADDRESSES, TAXELS, SyntheticSkin, learn
from taxel.ros.cdr import encode
from taxel.ros.diagnostics import ERROR, OK
from taxel.ros.topics import NS_PER_S
from taxel.twin import ContactSchedule, Twin
from taxel.twin.session import TwinSession
from taxel.twin.sources import Block
from taxel.twin.topics import DIAGNOSTICS_TOPIC, EVENTS_TOPIC, FRAME_TOPIC, TwinTopics

BOARDS = dict(zip(ADDRESSES, ("left", "right"), strict=True))

EPOCH_OFFSET_NS = 10**18
"""Unix time minus stream time, nanoseconds."""


class Source:
    """Blocks of 200 poll cycles of a skin whose taxels all become twice as sensitive after ten contacts."""

    is_live, is_continuous, session_starts_s = False, False, ()

    def __init__(self, skin):
        first, before = skin.run_routine(10)
        skin.gain[:] = 2.0
        second, after = skin.run_routine(10)
        self.contacts = [*first, *second]
        self.cycles = tuple(np.concatenate(pair) for pair in zip(before, after, strict=True))

    def get_unique_ids(self):
        return {}

    def blocks(self):
        for start in range(0, len(self.cycles[0]), 200):
            yield Block(*(column[start : start + 200] for column in self.cycles))


@pytest.fixture(scope="module")
def messages():
    skin = SyntheticSkin(seed=5)
    reference = learn(skin)
    source = Source(skin)
    session = TwinSession(Twin(reference, ContactSchedule(source.contacts)), source, None)
    topics = TwinTopics(BOARDS, epoch_offset_ns=EPOCH_OFFSET_NS)
    return [message for update in session.updates() for message in topics.make(update, session.twin.active.values())]


def test_session_without_repair_sends_frames_events_and_diagnostics(messages):
    assert {message.topic for message in messages} == {FRAME_TOPIC, EVENTS_TOPIC, DIAGNOSTICS_TOPIC}


def test_every_message_can_be_encoded(messages):
    for message in messages:
        assert encode(message.type, message.message)


def test_times_of_messages_are_unix_times(messages):
    for message in messages:
        assert 0 <= message.time_ns - EPOCH_OFFSET_NS < 3600 * NS_PER_S


def test_frame_contains_measured_predicted_and_residual_signals_of_every_taxel(messages):
    frames = [message.message for message in messages if message.topic == FRAME_TOPIC]
    assert len(frames) >= 10
    for frame in frames:
        assert len(frame["measured"]) == len(frame["predicted"]) == len(frame["residual"]) == TAXELS


def test_alarm_is_sent_as_json_with_the_address_of_its_board(messages):
    events = [json.loads(message.message["data"]) for message in messages if message.topic == EVENTS_TOPIC]
    assert events[0]["event"] == "alarm"
    assert events[0]["place"]["address"] in {f"0x{address:02X}" for address in ADDRESSES}


def list_statuses(messages) -> list[list[dict]]:
    """Return the statuses of each diagnostics message, in order of time."""
    return [message.message["status"] for message in messages if message.topic == DIAGNOSTICS_TOPIC]


def test_diagnostics_contain_a_status_of_the_twin_and_of_each_board(messages):
    for statuses in list_statuses(messages):
        assert [status["name"] for status in statuses] == ["taxel twin", "taxel twin: left", "taxel twin: right"]


def test_diagnostics_of_the_healthy_skin_report_no_fault(messages):
    assert {status["level"] for status in list_statuses(messages)[0]} == {OK}


def test_diagnostics_report_an_error_of_exactly_the_boards_with_an_active_alarm(messages):
    events = [json.loads(message.message["data"]) for message in messages if message.topic == EVENTS_TOPIC]
    cleared = {event["alarm"] for event in events if event["event"] == "cleared"}
    active = [event for event in events if event["event"] == "alarm" and event["alarm"] not in cleared]
    expected = {f"taxel twin: {event['place']['sensor']}" for event in active}
    assert expected
    assert {status["name"] for status in list_statuses(messages)[-1] if status["level"] == ERROR} == expected
