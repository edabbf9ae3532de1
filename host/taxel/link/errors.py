"""Errors of links and capture files."""

from taxel.errors import TaxelError


class LinkError(TaxelError):
    """Error: a link cannot be opened, read or written.

    name: the port, URL or file. problem: remainder of the message.
    """

    def __init__(self, name: str, problem: str) -> None:
        """Create the error for a link; name: the port, URL or file; problem: remainder of the message."""
        super().__init__(f"{name}: {problem}")
        self.name = name
        self.problem = problem

    def __reduce__(self) -> tuple[type["LinkError"], tuple[str, str]]:
        """Return class and arguments for pickle; the message alone does not contain name and problem separately."""
        return type(self), (self.name, self.problem)


class PortMissingError(LinkError):
    """Error: the port does not exist, or cannot be opened."""


class PortBusyError(PortMissingError):
    """Error: another program uses the port; the message names its process where it can be found."""


class PortVanishedError(LinkError):
    """Error: an open port has disappeared: it was unplugged, or its process has ended.

    All bytes received before are delivered.
    """


class CaptureError(LinkError):
    """Error: a file is not a capture, or ends within a record. All records before the damage are delivered."""
