"""Encoding and decoding of the CAN messages of the Allegro hand V4.

11-bit identifiers, ``message id << 2 | device id``; payloads are little-endian. Source of identifiers and payloads:
the manufacturer's CAN definitions for V4 as used by public drivers. Angles are radians, torques are fractions of full
PWM, -1 to 1; the integers of the frames are used only in this module.

Public sources disagree about the layout of Config (assumed: mask of set fields, device id, 32-bit baud rate) and do not
give the unit of the IMU values (kept as raw values). The driver never sends Config.
"""

import math
import struct
from collections.abc import Sequence
from typing import Final

import can

from taxel.hand.allegro.errors import AllegroFrameError
from taxel.hand.allegro.messages import (
    Config,
    FingerPose,
    FingerValues,
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

BITRATE: Final = 1_000_000  # bits per second
MAX_DEVICE_ID: Final = 3
FULL_PWM: Final = 1200  # torque command of 1
RAD_PER_COUNT: Final = math.radians(333.3 / 65536)  # encoder scale
SERIAL_LENGTH: Final = 8  # characters

_FOUR_INT16 = struct.Struct("<4h")
_INFO = struct.Struct("<HHBBB")
_PERIOD = struct.Struct("<3H")
_CONFIG = struct.Struct("<BBI")
_IMU = struct.Struct("<3h")
_TEMPERATURE = struct.Struct("<i")
_SERVO_ON, _HIGH_TEMPERATURE, _COMMUNICATION_FAULT = 1, 2, 4
_SET_DEVICE_ID, _SET_BAUD = 1, 2

_IDS_OF_FOUR = frozenset({MessageId.FINGER_POSE, MessageId.TEMPERATURE, MessageId.SET_TORQUE, MessageId.SET_POSE})
_REQUESTABLE = frozenset(
    {MessageId.FINGER_POSE, MessageId.IMU, MessageId.TEMPERATURE, MessageId.HAND_INFO, MessageId.SERIAL}
)
# Message id in a frame -> (MessageId, index of finger or sensor).
_MESSAGE_OF_ID = {
    int(message) + k: (message, k) for message in MessageId for k in (range(4) if message in _IDS_OF_FOUR else range(1))
}


def make_arbitration_id(message: MessageId, index: int = 0, device_id: int = 0) -> int:
    """Make the 11-bit identifier of a CAN frame: message id plus `index` in bits 2 to 10, device id in bits 0 and 1.

    index: number of the finger or sensor, 0 for other messages. Raises ValueError for an index or a device id out of
    range.
    """
    if not 0 <= index < (4 if message in _IDS_OF_FOUR else 1):
        raise ValueError(f"index of {message.name}: expected 0 to {3 if message in _IDS_OF_FOUR else 0}, found {index}")
    if not 0 <= device_id <= MAX_DEVICE_ID:
        raise ValueError(f"device_id: expected 0 to {MAX_DEVICE_ID}, found {device_id}")
    return (message + index) << 2 | device_id


def get_device_id(frame: can.Message) -> int | None:
    """Return the device id of a frame of this protocol; None for any other frame (extended, CAN FD, error, unknown)."""
    if frame.is_extended_id or frame.is_error_frame or frame.is_fd or frame.arbitration_id >> 2 not in _MESSAGE_OF_ID:
        return None
    return frame.arbitration_id & MAX_DEVICE_ID


def encode(message: Message, device_id: int = 0) -> can.Message:
    """Encode `message` as a CAN frame. Raises ValueError for a value out of the range of its field."""
    kind, index, payload = _encode_payload(message)
    return can.Message(
        arbitration_id=make_arbitration_id(kind, index, device_id),
        is_extended_id=False,
        is_remote_frame=isinstance(message, Request),
        data=payload,
    )


def decode(frame: can.Message) -> Message | None:
    """Decode a CAN frame; return None for a frame of another protocol.

    Raises AllegroFrameError for a wrong length, a request of a command message, or invalid content.
    """
    if get_device_id(frame) is None:
        return None
    kind, index = _MESSAGE_OF_ID[frame.arbitration_id >> 2]
    if frame.is_remote_frame:
        if kind not in _REQUESTABLE:
            raise AllegroFrameError(frame.arbitration_id, f"{kind.name} as a data frame", "a remote frame")
        return Request(kind, index)
    return _decode_payload(kind, index, frame)


def _encode_payload(message: Message) -> tuple[MessageId, int, bytes]:
    """Encode a message: (message id, finger or sensor index, data bytes). Raises ValueError for values out of range."""
    match message:
        case SetTorque(finger, torque):
            return (
                MessageId.SET_TORQUE,
                finger,
                _FOUR_INT16.pack(*(_to_pwm(fraction) for fraction in _check_four(torque))),
            )
        case FingerPose(finger, angles):
            return (
                MessageId.FINGER_POSE,
                finger,
                _FOUR_INT16.pack(*(_to_counts(angle) for angle in _check_four(angles))),
            )
        case SetPose(finger, angles):
            return MessageId.SET_POSE, finger, _FOUR_INT16.pack(*(_to_counts(angle) for angle in _check_four(angles)))
        case Request(kind, index):
            if kind not in _REQUESTABLE:
                raise ValueError(f"{kind.name} is a command and cannot be requested")
            return kind, index, b""
        case SystemOn():
            return MessageId.SYSTEM_ON, 0, b""
        case SystemOff():
            return MessageId.SYSTEM_OFF, 0, b""
        case _:
            return _encode_rare_payload(message)


def _encode_rare_payload(
    message: SetPeriod | Config | HandInfo | Serial | Imu | Temperature,
) -> tuple[MessageId, int, bytes]:
    """Encode a message that a control loop does not send: (message id, sensor index, data bytes).

    Raises ValueError for values out of range.
    """
    try:
        match message:
            case SetPeriod(position_ms, imu_ms, temperature_ms):
                return MessageId.SET_PERIOD, 0, _PERIOD.pack(position_ms, imu_ms, temperature_ms)
            case Config():
                return MessageId.CONFIG, 0, _encode_config(message)
            case HandInfo():
                return MessageId.HAND_INFO, 0, _encode_info(message)
            case Serial(text):
                return MessageId.SERIAL, 0, _encode_serial(text)
            case Imu(raw):
                return MessageId.IMU, 0, _IMU.pack(*raw)
            case Temperature(sensor, celsius):
                return MessageId.TEMPERATURE, sensor, _TEMPERATURE.pack(celsius)
    except struct.error as error:
        raise ValueError(f"{message}: expected values within the range of their fields, found: {error}") from None


def _decode_payload(kind: MessageId, index: int, frame: can.Message) -> Message:
    """Convert the data bytes of a CAN frame to a message; kind, index: message type, and finger or sensor.

    Raises AllegroFrameError for data of another length or invalid content.
    """
    match kind:
        case MessageId.FINGER_POSE:
            return FingerPose(index, _decode_angles(frame))
        case MessageId.SET_TORQUE:
            a, b, c, d = _unpack(_FOUR_INT16, frame)
            return SetTorque(index, (a / FULL_PWM, b / FULL_PWM, c / FULL_PWM, d / FULL_PWM))
        case MessageId.SET_POSE:
            return SetPose(index, _decode_angles(frame))
        case MessageId.SYSTEM_ON | MessageId.SYSTEM_OFF:
            _check_length(0, frame)
            return SystemOn() if kind is MessageId.SYSTEM_ON else SystemOff()
        case MessageId.SET_PERIOD:
            return SetPeriod(*_unpack(_PERIOD, frame))
        case MessageId.HAND_INFO:
            return _decode_info(frame)
        case MessageId.SERIAL:
            return _decode_serial(frame)
        case MessageId.CONFIG:
            return _decode_config(frame)
        case MessageId.IMU:
            roll, pitch, yaw = _unpack(_IMU, frame)
            return Imu((roll, pitch, yaw))
        case MessageId.TEMPERATURE:
            return Temperature(index, *_unpack(_TEMPERATURE, frame))


def _check_four(values: Sequence[float]) -> Sequence[float]:
    """Return `values` if they are four finite numbers, one for each joint of a finger; else raise ValueError."""
    if len(values) != 4 or not all(math.isfinite(value) for value in values):
        raise ValueError(f"expected four finite values, one per joint, found {values}")
    return values


def _to_pwm(fraction: float) -> int:
    """Convert a torque command, a fraction of full PWM clipped to -1 .. 1, to the integer of the CAN message."""
    return round(min(1.0, max(-1.0, fraction)) * FULL_PWM)


def _to_counts(angle: float) -> int:
    """Convert an angle, radians, to encoder counts of the hand (`RAD_PER_COUNT`). Raises ValueError beyond 16 bits."""
    counts = round(angle / RAD_PER_COUNT)
    if not -0x8000 <= counts <= 0x7FFF:
        raise ValueError(f"angle: expected at most {0x7FFF * RAD_PER_COUNT:.3f} rad from 0, found {angle}")
    return counts


def _decode_angles(frame: can.Message) -> FingerValues:
    """Convert the data bytes of a CAN frame to the four joint angles of a finger, radians."""
    a, b, c, d = _unpack(_FOUR_INT16, frame)
    return a * RAD_PER_COUNT, b * RAD_PER_COUNT, c * RAD_PER_COUNT, d * RAD_PER_COUNT


def _check_length(expected: int, frame: can.Message) -> None:
    """Raise AllegroFrameError unless a frame has `expected` data bytes."""
    if len(frame.data) != expected:
        kind, _ = _MESSAGE_OF_ID[frame.arbitration_id >> 2]
        raise AllegroFrameError(frame.arbitration_id, f"{expected} bytes of {kind.name}", f"{len(frame.data)} bytes")


def _unpack(layout: struct.Struct, frame: can.Message) -> tuple[int, ...]:
    """Unpack the data bytes of a CAN frame. Raises AllegroFrameError for data of another length."""
    _check_length(layout.size, frame)
    return layout.unpack(frame.data)


def _encode_info(info: HandInfo) -> bytes:
    """Return the data bytes of the hand info report, whose last byte is a bit mask of the hand's status flags."""
    flags = ((info.servo_on, _SERVO_ON), (info.high_temperature, _HIGH_TEMPERATURE))
    status = sum(bit for is_set, bit in (*flags, (info.communication_fault, _COMMUNICATION_FAULT)) if is_set)
    return _INFO.pack(info.hardware_version, info.firmware_version, info.hand_type, info.temperature_c, status)


def _decode_info(frame: can.Message) -> HandInfo:
    """Decode a hand info report: versions, hand type, temperature (degrees Celsius) and the status flags."""
    hardware, firmware, hand_type, temperature_c, status = _unpack(_INFO, frame)
    servo_on, is_hot, has_fault = (bool(status & bit) for bit in (_SERVO_ON, _HIGH_TEMPERATURE, _COMMUNICATION_FAULT))
    return HandInfo(hardware, firmware, hand_type, temperature_c, servo_on, is_hot, has_fault)


def _encode_serial(text: str) -> bytes:
    """Return a serial number as ASCII bytes, padded with zeros to `SERIAL_LENGTH`; raise ValueError for other text."""
    if not (1 <= len(text) <= SERIAL_LENGTH and text.isascii() and text.isprintable()):
        raise ValueError(f"serial: expected 1 to {SERIAL_LENGTH} printable ASCII characters, found {text!r}")
    return text.encode("ascii").ljust(SERIAL_LENGTH, b"\0")


def _decode_serial(frame: can.Message) -> Serial:
    """Decode the serial number in a frame. Raises AllegroFrameError for bytes that are not printable ASCII."""
    _check_length(SERIAL_LENGTH, frame)
    content = bytes(frame.data).rstrip(b"\0")
    text = content.decode("ascii", errors="replace")
    if not (content and text.isascii() and text.isprintable()):
        raise AllegroFrameError(frame.arbitration_id, "a serial number in printable ASCII", repr(bytes(frame.data)))
    return Serial(text)


def _encode_config(config: Config) -> bytes:
    """Encode a Config message; the mask in the first byte states which of its values are set."""
    if config.device_id is not None and not 0 <= config.device_id <= MAX_DEVICE_ID:
        raise ValueError(f"device_id: expected 0 to {MAX_DEVICE_ID}, found {config.device_id}")
    mask = _SET_DEVICE_ID * (config.device_id is not None) | _SET_BAUD * (config.rs485_baud is not None)
    return _CONFIG.pack(mask, config.device_id or 0, config.rs485_baud or 0)


def _decode_config(frame: can.Message) -> Config:
    """Decode a Config message. Raises AllegroFrameError for an unknown mask or a device id out of range."""
    mask, device_id, baud = _unpack(_CONFIG, frame)
    if device_id > MAX_DEVICE_ID or mask & ~(_SET_DEVICE_ID | _SET_BAUD):
        raise AllegroFrameError(
            frame.arbitration_id, "a mask of 0 to 3 and a device id of 0 to 3", f"{mask} and {device_id}"
        )
    return Config(device_id if mask & _SET_DEVICE_ID else None, baud if mask & _SET_BAUD else None)
