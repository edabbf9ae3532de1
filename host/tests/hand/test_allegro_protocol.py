"""Every message of the Allegro hand is encoded and decoded; every invalid frame raises a one-line error."""

import math
import pickle

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.hand.allegro import AllegroFrameError
from taxel.hand.allegro.messages import (
    Config,
    FingerPose,
    HandInfo,
    Imu,
    Message,
    MessageId,
    Request,
    Serial,
    SetPeriod,
    SetPose,
    SetTorque,
    SystemOff,
    SystemOn,
    Temperature,
)
from taxel.hand.allegro.protocol import FULL_PWM, RAD_PER_COUNT, decode, encode, get_device_id, make_arbitration_id

FINGER = st.integers(0, 3)
I16 = st.integers(-0x8000, 0x7FFF)
U16 = st.integers(0, 0xFFFF)
U8 = st.integers(0, 0xFF)


def make_four(integers: st.SearchStrategy[int], scale: float) -> st.SearchStrategy[tuple[float, ...]]:
    return st.tuples(*[integers.map(lambda i: i * scale)] * 4)


ANGLES = make_four(I16, RAD_PER_COUNT)
MESSAGES: st.SearchStrategy[Message] = st.one_of(
    st.just(SystemOn()),
    st.just(SystemOff()),
    st.builds(SetTorque, FINGER, st.tuples(*[st.integers(-FULL_PWM, FULL_PWM).map(lambda i: i / FULL_PWM)] * 4)),
    st.builds(SetPose, FINGER, ANGLES),
    st.builds(FingerPose, FINGER, ANGLES),
    st.builds(SetPeriod, U16, U16, U16),
    st.builds(Config, st.none() | FINGER, st.none() | st.integers(0, 0xFFFF_FFFF)),
    st.builds(HandInfo, U16, U16, U8, U8, st.booleans(), st.booleans(), st.booleans()),
    st.builds(Serial, st.text(st.characters(min_codepoint=32, max_codepoint=126), min_size=1, max_size=8)),
    st.builds(Imu, st.tuples(I16, I16, I16)),
    st.builds(Temperature, FINGER, st.integers(-(2**31), 2**31 - 1)),
    st.builds(Request, st.sampled_from([MessageId.FINGER_POSE, MessageId.TEMPERATURE]), FINGER),
    st.builds(Request, st.sampled_from([MessageId.IMU, MessageId.HAND_INFO, MessageId.SERIAL])),
)


def make_frame(identifier: int, data: bytes = b"", *, remote: bool = False) -> can.Message:
    return can.Message(arbitration_id=identifier, data=data, is_extended_id=False, is_remote_frame=remote)


@settings(deadline=None)
@given(MESSAGES, st.integers(0, 3))
def test_decoding_inverts_encoding(message: Message, device_id: int) -> None:
    sent = encode(message, device_id)
    assert decode(sent) == message
    assert get_device_id(sent) == device_id
    assert not sent.is_extended_id
    assert sent.arbitration_id < 0x800


@settings(deadline=None)
@given(U16.filter(lambda i: i < 0x800), st.binary(max_size=8), st.booleans())
def test_any_frame_is_a_message_none_or_a_frame_error(identifier: int, data: bytes, remote: bool) -> None:
    message = text = None
    try:
        message = decode(make_frame(identifier, b"" if remote else data, remote=remote))
    except AllegroFrameError as error:
        text = str(error)
    if get_device_id(make_frame(identifier)) is None:
        assert (message, text) == (None, None)
    else:
        assert (message is None) != (text is None)
    assert text is None or ("\n" not in text and f"0x{identifier:03X}" in text)


# Bytes according to the manufacturer's table.
@pytest.mark.parametrize(
    ("message", "identifier", "data"),
    [
        (SystemOn(), 0x40 << 2, ""),
        (SystemOff(), 0x41 << 2, ""),
        (SetTorque(2, (1.0, -1.0, 0.0, 0.5)), 0x62 << 2, "b004 50fb 0000 5802"),
        (SetPose(3, (RAD_PER_COUNT, -RAD_PER_COUNT, 0.0, 256 * RAD_PER_COUNT)), 0xE3 << 2, "0100 ffff 0000 0001"),
        (SetPeriod(3, 10, 1000), 0x81 << 2, "0300 0a00 e803"),
        (HandInfo(0x0400, 0x0102, 0, 42, True, False, True), 0x80 << 2, "0004 0201 00 2a 05"),
        (Serial("SAH040"), 0x88 << 2, "534148303430 0000"),
        (FingerPose(1, (0.0, RAD_PER_COUNT, 0.0, 0.0)), 0x21 << 2, "0000 0100 0000 0000"),
        (Imu((1, -1, 2)), 0x30 << 2, "0100 ffff 0200"),
        (Temperature(3, 40), 0x3B << 2, "2800 0000"),
        (Config(device_id=2), 0x68 << 2, "01 02 00000000"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_encoded_bytes_agree_with_the_table(message: Message, identifier: int, data: str) -> None:
    sent = encode(message)
    assert (sent.arbitration_id, bytes(sent.data)) == (identifier, bytes.fromhex(data))


def test_an_angle_is_333_3_degrees_over_65536_counts() -> None:
    message = decode(make_frame(0x20 << 2, bytes.fromhex("0040 0000 0000 0000")))
    assert isinstance(message, FingerPose)
    assert message.angles[0] == pytest.approx(math.radians(333.3 / 4))


@pytest.mark.parametrize("angle", [0.1, -0.1, 1.0, 1e-4])
def test_an_angle_is_rounded_to_the_nearest_count(angle: float) -> None:
    message = decode(encode(FingerPose(0, (angle, 0.0, 0.0, 0.0))))
    assert isinstance(message, FingerPose)
    assert abs(message.angles[0] - angle) <= RAD_PER_COUNT / 2


@pytest.mark.parametrize(("torque", "pwm"), [(1.5, 1200), (-9.0, -1200), (0.25, 300), (0.0, 0)])
def test_a_torque_is_clipped_to_full_pwm(torque: float, pwm: int) -> None:
    assert int.from_bytes(encode(SetTorque(0, (torque, 0.0, 0.0, 0.0))).data[:2], "little", signed=True) == pwm


@pytest.mark.parametrize(
    ("message_id", "length"),
    [(0x40, 0), (0x41, 0), (0x60, 8), (0xE0, 8), (0x81, 6), (0x68, 6), (0x80, 7), (0x88, 8), (0x20, 8), (0x30, 6),
     (0x38, 4)],
)  # fmt: skip
def test_a_frame_with_another_length_than_its_message_is_rejected(message_id: int, length: int) -> None:
    for wrong in set(range(9)) - {length}:
        with pytest.raises(AllegroFrameError, match=f"expected {length} bytes of .*, found {wrong} bytes"):
            decode(make_frame(message_id << 2, bytes(wrong)))


@pytest.mark.parametrize("message_id", [0x40, 0x41, 0x60, 0xE3, 0x81, 0x68])
def test_a_command_cannot_be_requested(message_id: int) -> None:
    with pytest.raises(AllegroFrameError, match="as a data frame, found a remote frame"):
        decode(make_frame(message_id << 2, remote=True))
    with pytest.raises(ValueError, match="cannot be requested"):
        encode(Request(MessageId.SYSTEM_ON))


def test_frames_of_other_protocols_are_ignored() -> None:
    extended = can.Message(arbitration_id=0x40 << 2, is_extended_id=True)
    flexible = can.Message(arbitration_id=0x40 << 2, is_extended_id=False, is_fd=True)
    failed = can.Message(arbitration_id=0x40 << 2, is_extended_id=False, is_error_frame=True)
    for other in (extended, flexible, failed, make_frame(0x7FF), make_frame(0x64 << 2)):
        assert decode(other) is None
        assert get_device_id(other) is None


@pytest.mark.parametrize("content", [b"\0" * 8, b"SAH\x07abcd", b"SAH\xff1234", b"A\0B\0\0\0\0\0"])
def test_an_unprintable_serial_number_is_rejected(content: bytes) -> None:
    with pytest.raises(AllegroFrameError, match="printable ASCII"):
        decode(make_frame(0x88 << 2, content))


def test_a_config_with_an_invalid_device_id_is_rejected() -> None:
    with pytest.raises(AllegroFrameError, match="device id of 0 to 3"):
        decode(make_frame(0x68 << 2, bytes.fromhex("01 09 00000000")))


@pytest.mark.parametrize(
    "message",
    [
        SetTorque(4, (0.0,) * 4),
        SetTorque(0, (math.nan,) * 4),
        SetPose(0, (3.0, 0.0, 0.0, 0.0)),
        FingerPose(-1, (0.0,) * 4),
        SetPeriod(-1, 0, 0),
        SetPeriod(70_000, 0, 0),
        Config(device_id=4),
        Config(rs485_baud=-1),
        HandInfo(0, 0, 256, 0, True, False, False),
        Serial(""),
        Serial("too long for it"),
        Serial("Größe"),
        Temperature(4, 0),
        Request(MessageId.IMU, 1),
    ],
)
def test_values_out_of_the_range_of_their_field_are_rejected(message: Message) -> None:
    with pytest.raises(ValueError):
        encode(message)


def test_a_device_id_has_two_bits() -> None:
    assert make_arbitration_id(MessageId.SET_POSE, 3, 3) == 0xE3 << 2 | 3
    with pytest.raises(ValueError, match="expected 0 to 3, found 4"):
        encode(SystemOn(), 4)


def test_a_frame_error_can_be_pickled() -> None:
    error = AllegroFrameError(0x80, "8 bytes", "7 bytes")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)
