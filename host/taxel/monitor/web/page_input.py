"""Validation of the messages of a page: camera poses, and values of the controls that the page has."""

import math
from collections.abc import Collection
from typing import Final

import msgspec

from taxel.monitor.web.gate import Refusal

MESSAGE_BYTES_MAX: Final = 1 << 14
"""Largest size of a message of a page, bytes. The largest valid message, a camera pose, has less than 400 bytes."""

LENGTH_MAX: Final = 1e6
"""Largest coordinate of a camera pose, metres, and largest size of a window, pixels: larger values overflow sums."""


class ViewerCameraMessage(msgspec.Struct, tag=True, tag_field="type", forbid_unknown_fields=True):
    """Pose of the camera of a page."""

    wxyz: tuple[float, float, float, float]
    position: tuple[float, float, float]
    fov: float
    near: float
    far: float
    image_height: int
    image_width: int
    look_at: tuple[float, float, float]
    up_direction: tuple[float, float, float]

    def is_valid(self) -> bool:
        """Return whether all numbers are finite and at most `LENGTH_MAX`."""
        vectors = (*self.wxyz, *self.position, *self.look_at, *self.up_direction)
        scalars = (self.fov, self.near, self.far, float(self.image_height), float(self.image_width))
        return all(math.isfinite(value) and abs(value) <= LENGTH_MAX for value in (*vectors, *scalars))


class GuiUpdateMessage(msgspec.Struct, tag=True, tag_field="type", forbid_unknown_fields=True):
    """New value of a control of the page."""

    uuid: str
    updates: dict[str, bool | str]


class PageInput:
    """The messages that a page may send. All other messages are refused, among them uploads."""

    def __init__(self) -> None:
        """Create a validation that accepts only camera poses; `allow` adds controls."""
        self._decoder = msgspec.msgpack.Decoder(ViewerCameraMessage | GuiUpdateMessage)
        self._values: dict[str, Collection[bool | str]] = {}

    def allow(self, uuid: str, values: Collection[bool | str]) -> None:
        """Accept messages that set the control with the identifier `uuid` to one of `values`."""
        self._values[uuid] = values

    def check(self, data: bytes | str) -> Refusal | None:
        """Return why a message of a page is refused; None for a valid message. data: encoded as MessagePack."""
        if isinstance(data, str) or len(data) > MESSAGE_BYTES_MAX:
            return Refusal.MALFORMED
        try:
            message = self._decoder.decode(data)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, OverflowError):
            return Refusal.MALFORMED
        if isinstance(message, ViewerCameraMessage):
            return None if message.is_valid() else Refusal.UNKNOWN_VALUE
        if message.uuid not in self._values:
            return Refusal.UNKNOWN_CONTROL
        if list(message.updates) != ["value"]:
            return Refusal.MALFORMED
        value = message.updates["value"]
        known = any(value == one and type(value) is type(one) for one in self._values[message.uuid])
        return None if known else Refusal.UNKNOWN_VALUE
