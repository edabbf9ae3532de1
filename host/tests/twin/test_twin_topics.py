"""Messages of the twin: frame, events and diagnostics."""

import json

import numpy as np
import pytest

from host.tests.twin.synthetic_skin import ADDRESSES, TAXELS, SyntheticSkin, learn
from taxel.ros.cdr import encode
from taxel.ros.diagnostics import ERROR, OK
from taxel.twin import ContactSchedule, Twin
from taxel.twin.session import TwinSession
from taxel.twin.sources import Block
from taxel.twin.topics import DIAGNOSTICS_TOPIC, EVENTS_TOPIC, FRAME_TOPIC, TwinTopics

BOARDS = dict(zip(ADDRESSES, ("left", "right"), strict=True))


class Source:
    """Blocks of a skin whose board at the first address becomes twice as sensitive after ten contacts."""

    is_live, is_continuous = False, False

    def __init__(self, skin):
        first, before = skin.run_routine(10)
        skin.gain[:] = 2.0
        second, after = skin.run_routine(10)
        self.contacts = [*first, *second]
        self.cycles = tuple(np.concatenate(pair) for pair in zip(before, after, strict=True))

    def blocks(self):
        for start in range(0, len(self.cycles[0]), 200):
            yield Block(*(column[start : start + 200] for column in self.cycles))


@pytest.fixture(scope="module")
def messages():
    skin = SyntheticSkin(seed=5)
    reference = learn(skin)
    source = Source(skin)
    session = TwinSession(Twin(reference, ContactSchedule(source.contacts)), source, None)
    topics = TwinTopics(BOARDS, epoch_offset_ns=10**18)
    return [message for update in session.updates() for message in topics.make(update, session.twin.active.values())]


def test_every_message_can_be_encoded(messages):
    assert {message.topic for message in messages} == {FRAME_TOPIC, EVENTS_TOPIC, DIAGNOSTICS_TOPIC}
    for message in messages:
        assert encode(message.type, message.message)
        assert message.time_ns >= 10**18


def test_frame_contains_measured_and_predicted_signals(messages):
    frames = [message.message for message in messages if message.topic == FRAME_TOPIC]
    assert len(frames) >= 10
    for frame in frames:
        assert len(frame["measured"]) == len(frame["predicted"]) == len(frame["residual"]) == TAXELS


def test_events_are_the_json_of_the_command(messages):
    events = [json.loads(message.message["data"]) for message in messages if message.topic == EVENTS_TOPIC]
    assert events[0]["event"] == "alarm"
    assert events[0]["place"]["address"] in {f"0x{address:02X}" for address in ADDRESSES}


def test_diagnostics_report_the_board_of_an_alarm(messages):
    statuses = [message.message["status"] for message in messages if message.topic == DIAGNOSTICS_TOPIC]
    assert {status["level"] for status in statuses[0]} == {OK}
    assert [status["name"] for status in statuses[0]] == ["taxel twin", "taxel twin: left", "taxel twin: right"]
    assert any(status["level"] == ERROR for status in statuses[-1])
