"""Argument that the constructor of every driver receives besides the options of the rig file."""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

from hil_tests.harness.errors import RigError
from hil_tests.harness.rig_file import RigDescription
from taxel.hand import Hand
from taxel.link.virtual import VirtualWorld


@dataclass
class DriverContext:
    """Content of the rig file, emulated world, and the drivers opened so far, by device name.

    `virtual_world` is None on a physical rig. Functions given to `close_at_end` run in reverse order when the rig is
    closed.
    """

    description: RigDescription
    exit_stack: ExitStack
    virtual_world: VirtualWorld | None = None
    drivers: dict[str, Any] = field(default_factory=dict)

    @property
    def hand(self) -> Hand:
        """Description of the skin on the rig."""
        return self.description.hand

    @property
    def world(self) -> VirtualWorld:
        """The emulated world. Raises `RigError` on a physical rig."""
        if self.virtual_world is None:
            raise RigError(f"rig {self.description.path}: a virtual driver needs a virtual rig")
        return self.virtual_world

    def close_at_end(self, close: Callable[[], object]) -> None:
        """Call `close` when the rig is closed."""
        self.exit_stack.callback(close)
