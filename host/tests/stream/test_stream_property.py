"""The host decoder gives the same frames, fields and losses as construct, for any damaged stream."""

import importlib
import os
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from construct import Container
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from taxel.stream import StreamDecoder
from taxel.stream.frames import decode_messages
from taxel_protocol import FrameType, encode_frame
from taxel_protocol.frames import FRAMES
from taxel_protocol.layout import flatten
from taxel_protocol.limits import ADDRESS_MIN, WHO_AM_I

FOLDER = Path(__file__).resolve().parents[3] / "tools" / "fuzz"
MODULES = ("construct_oracle", "damage_campaign")
EXAMPLES = os.environ.get("TAXEL_PROPERTY_EXAMPLES")
property_settings = settings(
    max_examples=int(EXAMPLES or "150"), deadline=None, derandomize=EXAMPLES is None, database=None,
    suppress_health_check=list(HealthCheck),
)  # fmt: skip


TAXEL_KINDS = (FrameType.TAXELS, FrameType.COMPACT_TAXELS)


@pytest.fixture(scope="module")
def tool():
    """Modules of the folder tools/fuzz, as attributes."""
    sys.path.insert(0, str(FOLDER))
    yield SimpleNamespace(**{name: importlib.import_module(name) for name in MODULES})
    while str(FOLDER) in sys.path:
        sys.path.remove(str(FOLDER))


@st.composite
def sample_messages(draw):
    """Strategy for (type, sequence, payload) of a hub frame that is not a taxel frame."""
    kind = draw(st.sampled_from([kind for kind in FRAMES if kind < 0x80 and kind not in TAXEL_KINDS]))
    spec = FRAMES[kind]
    payload = bytearray(draw(st.binary(min_size=spec.minimum, max_size=spec.maximum)))
    if spec.has_address:
        payload[0] = ADDRESS_MIN + payload[0] % 3
    if kind == FrameType.BOARD_INFO:
        payload[0] = WHO_AM_I
    return int(kind), draw(st.integers(0, 65535)), bytes(payload)


def to_dict(value):
    """Convert a parsed construct container, also a nested one, into a dict."""
    if isinstance(value, Container):
        return {name: to_dict(inner) for name, inner in value.items() if name != "_io"}
    return value


@property_settings
@given(sent=st.lists(sample_messages(), max_size=8))
def test_messages_have_the_same_fields_as_with_construct(sent):
    """The library construct parses the payloads with the definitions of the protocol.

    The bytes at the end of a payload of variable length are not a named field of the decoded message. The message has
    them as `trailing_bytes`.
    """
    batches = StreamDecoder().push(b"".join(encode_frame(*frame) for frame in sent))
    decoded = [message for batch in batches for message in decode_messages(batch)]
    assert [int(message.type) for message in decoded] == [frame[0] for frame in sent]
    for message, (kind, _, payload) in zip(decoded, sent, strict=True):
        parsed = flatten(to_dict(FRAMES[FrameType(kind)].payload.parse(payload)))
        assert {name: parsed[name] for name in message.fields} == message.fields
        trailing_values = [value for name, value in parsed.items() if name not in message.fields]
        assert trailing_values == ([message.trailing_bytes] if trailing_values else [])


@property_settings
@given(sent=st.lists(sample_messages(), max_size=8), lost_indices=st.sets(st.integers(0, 7)))
def test_losses_of_any_sequence_numbers_agree_with_the_definition(tool, sent, lost_indices):
    # Sequence numbers in any order (repeated, decreasing, wrapped), with handshakes of a restarted hub.
    arrived = [frame for i, frame in enumerate(sent) if i not in lost_indices]
    decoder = StreamDecoder()
    decoder.push(b"".join(encode_frame(*frame) for frame in arrived))
    assert decoder.totals.tolist() == tool.construct_oracle.count_losses(arrived).to_totals()


@pytest.mark.parametrize("seed", [1, 2])
def test_damaged_streams_lose_only_the_damaged_frames(tool, seed):
    # Short run of tools/fuzz/damage_campaign.py.
    count = int(EXAMPLES or "1500")
    print(f"seed {seed}")
    tally, _, difference = tool.damage_campaign.check_range(seed, 0, count)
    assert difference is None
    assert tally["streams"] == count
    assert 0 < tally["intact"] < tally["frames"]


def test_a_decoder_that_loses_an_undamaged_frame_is_detected(tool, monkeypatch):
    campaign = tool.damage_campaign
    # The faulty decoder omits the first frame of the reference decoder.
    monkeypatch.setattr(campaign.Decoders, "decode_frames", lambda self, pieces: campaign.decode_reference(pieces)[1:])
    _, _, difference = campaign.check_range(1, 0, 50)
    assert difference is not None
    assert "C deframer differs" in difference
