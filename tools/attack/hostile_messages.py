"""Hostile messages on an admitted connection: uploads, unknown controls and values, other properties, garbage."""

import random
from typing import Any

import msgspec


def make_message(rng: random.Random, uuids: list[str]) -> bytes | str:
    """Make a message that a page never sends. uuids: identifiers of the controls of the page."""
    kind = rng.choice((_make_update, _make_upload, _make_other, _make_camera, _make_garbage))
    return kind(rng, uuids)


def _pack(**fields: Any) -> bytes:
    """Encode a message with these fields as the page encodes its messages."""
    return msgspec.msgpack.encode(fields)


def _make_update(rng: random.Random, uuids: list[str]) -> bytes:
    """Create an update of a control that the monitor must ignore.

    Its value is unknown or of another type, it changes another property, or its control is unknown.
    """
    uuid = rng.choice([*uuids, *uuids, *uuids, "unknown"])
    values: tuple[Any, ...] = (
        "unknown board",
        "<script>",
        "\x1b[2J",
        7,
        -1,
        None,
        [],
        {},
        1e308,
        "x" * 9000,
        ["palm"] * 99,
    )
    updates: tuple[Any, ...] = (
        {"value": rng.choice(values)}, {"visible": False}, {"is_button": True}, {"update_cb": []}, {"removed": True},
        {}, {"value": "unknown", "visible": False}, {"__class__": "x"}, {"sync_cb": None}, "value", None,
    )  # fmt: skip
    return _pack(type="GuiUpdateMessage", uuid=uuid, updates=rng.choice(updates))


def _make_upload(rng: random.Random, uuids: list[str]) -> bytes:
    """Create the start or a part of a file upload, which a page of the monitor never sends."""
    uuid = rng.choice([*uuids, "unknown"])
    if rng.random() < 0.5:
        return _pack(
            type="FileTransferStartUpload", source_component_uuid=uuid, transfer_uuid="t", filename="../../x",
            mime_type="text/plain", part_count=rng.choice((0, 1, 1 << 40)), size_bytes=rng.choice((0, 1 << 40)),
        )  # fmt: skip
    return _pack(
        type="FileTransferPart", source_component_uuid=uuid, transfer_uuid="t", part_index=rng.randrange(9),
        content=b"\0" * rng.choice((10, 10_000)),
    )  # fmt: skip


def _make_other(rng: random.Random, uuids: list[str]) -> bytes:
    """Create a message of another type of the library viser, or of a type that does not exist."""
    names = (
        "ShareUrlRequest", "ShareUrlDisconnect", "GuiFormSubmitMessage", "GuiButtonHoldMessage", "SceneNodeClick",
        "CommandTriggerMessage", "GetRenderResponseMessage", "RunJavascriptMessage", "GuiRemoveMessage", "Message", "x",
    )  # fmt: skip
    return _pack(
        type=rng.choice(names), uuid=rng.choice([*uuids, "unknown"]), name="/taxels", frequency=10.0, payload=b""
    )


def _make_camera(rng: random.Random, uuids: list[str]) -> bytes:
    """Create a camera pose with a number that is not finite, too large, missing, or of another type."""
    fields: dict[str, Any] = {
        "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, 1.0], "fov": 1.0, "near": 0.01, "far": 100.0,
        "image_height": 600, "image_width": 900, "look_at": [0.0, 0.0, 0.0], "up_direction": [0.0, 0.0, 1.0],
    }  # fmt: skip
    name = rng.choice(list(fields))
    invalid: list[Any] = [float("nan"), float("inf"), 1e300, "x", None, [1.0], [float("nan")] * 4, [0.0] * 1000, {}]
    fields[name] = rng.choice(invalid)
    if rng.random() < 0.2:
        fields["extra"] = 1
    return _pack(type="ViewerCameraMessage", **fields)


def _make_garbage(rng: random.Random, uuids: list[str]) -> bytes | str:
    """Create random bytes, deep nesting, text, or a valid message with changed bytes."""
    kind = rng.randrange(5)
    if kind == 0:
        return rng.randbytes(rng.randrange(0, 3000))
    if kind == 1:
        return b"\x91" * rng.choice((100, 10_000, 16_000))  # MessagePack: nested arrays of one element
    if kind == 2:
        return "text of a page"
    if kind == 3:
        return b"\xdd\xff\xff\xff\xff" + rng.randbytes(20)  # MessagePack: an array that claims 2^32 - 1 elements
    data = bytearray(_make_update(rng, uuids))
    for _ in range(rng.randrange(1, 6)):
        data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data)


def make_oversized_message(rng: random.Random) -> bytes:
    """Create a message above the largest size."""
    return _pack(type="FileTransferPart", content=b"\0" * rng.choice((1 << 15, 1 << 20, 1 << 23)))
