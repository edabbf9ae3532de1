"""Message types of the Allegro hand: angles in radians, torques as fractions of full PWM, -1 to 1."""

from dataclasses import dataclass
from enum import IntEnum

FingerValues = tuple[float, float, float, float]
"""One value per joint of a finger."""


class MessageId(IntEnum):
    """Ids of the CAN messages of the hand.

    A message of a finger or a sensor has four consecutive ids from this value on.
    """

    FINGER_POSE = 0x20
    IMU = 0x30
    TEMPERATURE = 0x38
    SYSTEM_ON = 0x40
    SYSTEM_OFF = 0x41
    SET_TORQUE = 0x60
    CONFIG = 0x68
    HAND_INFO = 0x80
    SET_PERIOD = 0x81
    SERIAL = 0x88
    SET_POSE = 0xE0


@dataclass(frozen=True, slots=True)
class SystemOn:
    """Command that switches the motors of the hand on."""


@dataclass(frozen=True, slots=True)
class SystemOff:
    """Command that switches the motors of the hand off."""


@dataclass(frozen=True, slots=True)
class SetTorque:
    """Torque commands of the four joints of finger `finger`, fractions of full PWM; clipped to -1 .. 1."""

    finger: int
    torque: FingerValues


@dataclass(frozen=True, slots=True)
class SetPose:
    """Command: target angles of the four joints of finger `finger`, radians."""

    finger: int
    angles: FingerValues


@dataclass(frozen=True, slots=True)
class SetPeriod:
    """Command: periods of the reports of the hand, milliseconds, 0 to 65535; 0 disables a report."""

    position_ms: int
    imu_ms: int
    temperature_ms: int


@dataclass(frozen=True, slots=True)
class Config:
    """Command: new device id (0 to 3) and RS-485 baud rate, stored permanently by the hand; None: unchanged."""

    device_id: int | None = None
    rs485_baud: int | None = None


@dataclass(frozen=True, slots=True)
class Request:
    """Remote frame that requests a message; `index`: finger or sensor, 0 if there is only one."""

    message: MessageId
    index: int = 0


@dataclass(frozen=True, slots=True)
class HandInfo:
    """Status of the hand. `hand_type`: 0 is a right hand, any other value a left hand."""

    hardware_version: int
    firmware_version: int
    hand_type: int
    temperature_c: int
    servo_on: bool
    high_temperature: bool
    communication_fault: bool


@dataclass(frozen=True, slots=True)
class Serial:
    """Report of the hand's serial number: 1 to 8 printable ASCII characters, padded with NUL in the frame."""

    text: str


@dataclass(frozen=True, slots=True)
class FingerPose:
    """Measured angles of the four joints of finger `finger`, radians; resolution `RAD_PER_COUNT`."""

    finger: int
    angles: FingerValues


@dataclass(frozen=True, slots=True)
class Imu:
    """Roll, pitch and yaw of the palm, raw int16 values; their unit is not public."""

    raw: tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Temperature:
    """Report of the temperature at sensor number `sensor`, 0 to 3, degrees Celsius."""

    sensor: int
    celsius: int


Message = (
    SystemOn
    | SystemOff
    | SetTorque
    | SetPose
    | SetPeriod
    | Config
    | Request
    | HandInfo
    | Serial
    | FingerPose
    | Imu
    | Temperature
)
