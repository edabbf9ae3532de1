"""Errors of the Allegro hand; each message is one line."""

from taxel.errors import TaxelError


class AllegroError(TaxelError):
    """Base class of the errors of an Allegro hand, which cannot be used in its current state.

    Attributes:
        channel: name of the CAN channel in python-can.
        device: device id of the hand on that channel.
        problem: expected value, found value and remedy.
    """

    def __init__(self, channel: str, device: int, problem: str) -> None:
        """Create the error for an Allegro hand.

        channel: name of the CAN channel. device: device id of the hand. problem: expected value, found value
        and remedy.
        """
        # All three are args, so that the error can be pickled.
        super().__init__(channel, device, problem)
        self.channel = channel
        self.device = device
        self.problem = problem

    def _format_message(self) -> str:
        return f"{self.channel}: Allegro hand {self.device}: {self.problem}"


class AllegroSilentError(AllegroError):
    """Error: the Allegro hand does not reply, or has sent no finger pose for too long."""


class AllegroTemperatureError(AllegroError):
    """Error: the Allegro hand reports its high temperature fault."""


class AllegroServoOffError(AllegroError):
    """Error: the motors of the Allegro hand are off after they were switched on."""


class AllegroCommunicationError(AllegroError):
    """Error: the Allegro hand reports a fault of its internal communication."""


class AllegroLeftHandError(AllegroError):
    """Error: a left hand is connected, but joint ranges and skin are those of a right hand."""


class AllegroPoseError(AllegroError, ValueError):
    """Error: target angles are outside the joint ranges; nothing was sent to the hand."""


class AllegroBusError(AllegroError):
    """Error: the CAN channel of the Allegro hand failed: unplugged, bus off, or buffer full."""


class CanUrlError(TaxelError):
    """Error: the CAN channel cannot be opened. Attributes: url, problem (cause and remedy)."""

    def __init__(self, url: str, problem: str) -> None:
        """Create the error for a CAN channel that cannot be opened; url: the channel; problem: cause and remedy."""
        super().__init__(url, problem)
        self.url = url
        self.problem = problem

    def _format_message(self) -> str:
        return f"{self.url}: {self.problem}"


class AllegroFrameError(TaxelError, ValueError):
    """CAN frame with a valid identifier but invalid content.

    Attributes:
        arbitration_id: identifier of the frame, 11 bits.
        expected: content required by the protocol.
        found: content of the frame.
    """

    def __init__(self, arbitration_id: int, expected: str, found: str) -> None:
        """Create the error for a CAN frame with invalid content; arbitration_id: the frame's identifier, 11 bits."""
        super().__init__(arbitration_id, expected, found)
        self.arbitration_id = arbitration_id
        self.expected = expected
        self.found = found

    def _format_message(self) -> str:
        """Return the message for the user: identifier of the CAN frame, expected and found content, and remedy."""
        return (
            f"CAN frame 0x{self.arbitration_id:03X}: expected {self.expected}, found {self.found}; "
            "check the device id, the firmware version and the bus"
        )
