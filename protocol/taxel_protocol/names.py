"""Named codes: frame types, commands, states and faults. The generator writes them as C enums."""

from enum import IntEnum


class FrameType(IntEnum):
    """First byte of a frame. Below 0x80: hub to host. From 0x80: host to hub."""

    HUB_HANDSHAKE = 0x01
    TAXELS = 0x02
    COMPACT_TAXELS = 0x03  # 0x04..0x07 are reserved for taxel frames
    HUB_STATUS = 0x08
    BOARD_STATUS = 0x09
    BOARD_INFO = 0x0A
    BOARD_FAULT = 0x0B
    TIME_SYNC = 0x0C
    LOG = 0x0D
    REPLY = 0x0E
    HOST_HANDSHAKE = 0x81
    COMMAND = 0x82
    ACKNOWLEDGE = 0x83


class Command(IntEnum):
    """Commands from a host to the hub."""

    START = 1
    STOP = 2
    SET_RATE = 3
    SCAN_BUS = 4
    I2C_TRANSFER = 5
    SET_SCAN_SETTINGS = 6
    REBOOT = 7
    GET_STATUS = 8
    GET_BOARD_INFO = 9
    GET_TIME = 10
    ENTER_BOOTLOADER = 11
    GET_FAULT = 12


class StartFlag(IntEnum):
    """Bits of the argument of the command START."""

    COMPACT = 1


class ReplyStatus(IntEnum):
    """Outcome of a command to the hub, sent in its reply."""

    OK = 0
    UNKNOWN_COMMAND = 1
    BAD_ARGUMENTS = 2
    BUSY = 3
    NO_HANDSHAKE = 4
    UNKNOWN_BOARD = 5
    NACK = 6
    TIMEOUT = 7
    BUS_ERROR = 8
    REJECTED_BY_BOARD = 9


class FrontEnd(IntEnum):
    """Kind of converter of a board, which defines the meaning of the 8 bytes of its scan settings.

    CAPSENSE: mutual capacitance with a CapSense block of a PSoC 4; `registers.ScanSettings`. 0x80 to 0xFF: converters
    of other projects.
    """

    CAPSENSE = 0


class BoardState(IntEnum):
    """State of a board as the hub tracks it."""

    ABSENT = 0
    IDENTIFYING = 1
    STREAMING = 2
    INCOMPATIBLE = 3


class BoardFault(IntEnum):
    """Reason for a missing frame of a board, or an event of the board."""

    NONE = 0
    NACK = 1
    TIMEOUT = 2
    CRC = 3
    SDA_STUCK = 4
    SCL_STUCK = 5
    ARBITRATION = 6
    NOT_A_TAXEL_BOARD = 7
    MAP_VERSION = 8
    RESTARTED = 9
    TOO_LARGE = 10
    SETTINGS_REJECTED = 11
    RECOVERED = 12


class ResetCause(IntEnum):
    """Cause of a processor's last reset."""

    POWER_ON = 0
    BROWN_OUT = 1
    WATCHDOG = 2
    COMMAND = 3


class LogLevel(IntEnum):
    """Severity of a LOG frame of the hub."""

    DEBUG = 0
    INFO = 1
    WARNING = 2
    ERROR = 3


class LogCode(IntEnum):
    """Subject of a LOG frame; the frame's text describes the event."""

    BUS_FREE = 1
    SDA_STUCK = 2
    SCL_STUCK = 3
    RECEIVE_OVERRUN = 4
    FRAME_DROPPED = 5


class BoardCommand(IntEnum):
    """Commands that are written to a board's command register, each followed by its bitwise complement."""

    START_SCAN = 1
    STOP_SCAN = 2
    CLEAR_COUNTERS = 3
    RESTART = 4
    ENTER_BOOTLOADER = 5


class BoardErrorFlag(IntEnum):
    """Bits of a board's error flags, kept until CLEAR_COUNTERS."""

    SETTINGS_REJECTED = 1
    COMMAND_REJECTED = 2
    SATURATED = 8
    READ_ONLY_WRITE = 16
    NOT_SCANNING = 32


class FaultCode(IntEnum):
    """Kind of the fault in a fault record."""

    NONE = 0
    EXCEPTION = 1
    NOT_SCANNING = 2
