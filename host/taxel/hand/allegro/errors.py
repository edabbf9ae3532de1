"""The errors of the Allegro hand: each prints as one line and carries its data."""

from taxel.errors import TaxelError


class AllegroError(TaxelError):
    """The hand cannot be used as it is.

    Attributes:
        channel: the CAN channel, as python-can names it.
        device: device id of the hand on that channel.
        problem: what was expected, what was found, what to do.
    """

    def __init__(self, channel: str, device: int, problem: str) -> None:
        # All three are args, so that the error survives pickling between processes.
        super().__init__(channel, device, problem)
        self.channel = channel
        self.device = device
        self.problem = problem

    def __str__(self) -> str:
        return f"{self.channel}: Allegro hand {self.device}: {self.problem}"


class AllegroSilentError(AllegroError):
    """The hand does not answer, or sends no finger pose for too long."""


class AllegroTemperatureError(AllegroError):
    """The hand reports its high temperature fault."""


class AllegroServoOffError(AllegroError):
    """The motors are off although they were switched on."""


class AllegroCommunicationError(AllegroError):
    """The hand reports a fault of its internal communication."""


class AllegroLeftHandError(AllegroError):
    """A left hand, where the joint ranges and the skin are those of a right one."""


class AllegroPoseError(AllegroError, ValueError):
    """A pose that lies outside the joint ranges. Nothing was sent."""


class AllegroBusError(AllegroError):
    """The CAN channel fails: unplugged, bus off, or its buffer is full."""


class CanUrlError(TaxelError):
    """A CAN channel that cannot be opened. `url` names it, `problem` says why and what to do."""

    def __init__(self, url: str, problem: str) -> None:
        super().__init__(url, problem)
        self.url = url
        self.problem = problem

    def __str__(self) -> str:
        return f"{self.url}: {self.problem}"


class AllegroFrameError(TaxelError, ValueError):
    """A CAN frame with an identifier of the protocol and content that it does not allow.

    Attributes:
        arbitration_id: identifier of the frame, 11 bits.
        expected: what the protocol asks for.
        found: what the frame holds.
    """

    def __init__(self, arbitration_id: int, expected: str, found: str) -> None:
        super().__init__(arbitration_id, expected, found)
        self.arbitration_id = arbitration_id
        self.expected = expected
        self.found = found

    def __str__(self) -> str:
        return (
            f"CAN frame 0x{self.arbitration_id:03X}: expected {self.expected}, found {self.found}; "
            "check the device id, the firmware version and the bus"
        )
