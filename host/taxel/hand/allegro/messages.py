"""The messages of the Allegro hand as values: angles in radians, torque demands as shares of full PWM, -1 to 1."""

from dataclasses import dataclass
from enum import IntEnum

Four = tuple[float, float, float, float]


class MessageId(IntEnum):
    """Message ids; those of a finger or a sensor are the first of four."""

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
    """Switch the motors on."""


@dataclass(frozen=True, slots=True)
class SystemOff:
    """Switch the motors off."""


@dataclass(frozen=True, slots=True)
class SetTorque:
    """Torque demands of the four joints of finger `finger`, shares of full PWM; clipped to -1 .. 1."""

    finger: int
    demand: Four


@dataclass(frozen=True, slots=True)
class SetPose:
    """Wanted angles of the four joints of finger `finger`, radians."""

    finger: int
    angles: Four


@dataclass(frozen=True, slots=True)
class SetPeriod:
    """How often the hand reports, milliseconds, 0 to 65535; 0 is never."""

    position_ms: int
    imu_ms: int
    temperature_ms: int


@dataclass(frozen=True, slots=True)
class Config:
    """New device id (0 to 3) and RS-485 baud rate; None leaves one as it is. The hand keeps them over power cycles."""

    device_id: int | None = None
    rs485_baud: int | None = None


@dataclass(frozen=True, slots=True)
class Request:
    """A remote frame: asks for a message; `index` is the finger or the sensor, 0 where there is one only."""

    message: MessageId
    index: int = 0


@dataclass(frozen=True, slots=True)
class HandInfo:
    """What the hand says of itself. `hand_type`: 0 is a right hand, any other a left one."""

    hardware_version: int
    firmware_version: int
    hand_type: int
    temperature_c: int
    servo_on: bool
    high_temperature: bool
    communication_fault: bool


@dataclass(frozen=True, slots=True)
class Serial:
    """The serial number: 1 to 8 printable ASCII characters, filled up with NUL on the wire."""

    text: str


@dataclass(frozen=True, slots=True)
class FingerPose:
    """Measured angles of the four joints of finger `finger`, radians; steps of `RAD_PER_COUNT`."""

    finger: int
    angles: Four


@dataclass(frozen=True, slots=True)
class Imu:
    """Roll, pitch and yaw of the palm, int16 as they come; their unit is not public."""

    raw: tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class Temperature:
    """Temperature at sensor `sensor`, 0 to 3, degrees Celsius."""

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
