"""What can go wrong between this program and a wire or a file."""

from taxel.errors import TaxelError


class LinkError(TaxelError):
    """A link could not be opened, read or written. `name` is the port, URL or file."""

    def __init__(self, name: str, problem: str) -> None:
        super().__init__(f"{name}: {problem}")
        self.name = name
        self.problem = problem

    def __reduce__(self) -> tuple[type["LinkError"], tuple[str, str]]:
        return type(self), (self.name, self.problem)


class PortMissingError(LinkError):
    """The port is not there, or may not be opened."""


class PortVanishedError(LinkError):
    """The port was there and is gone: unplugged, or its process has ended. What had arrived before was delivered."""


class CaptureError(LinkError):
    """A file is no capture, or is cut short. What stands before the damage was delivered."""
