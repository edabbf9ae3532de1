"""The ROS 2 messages hold every golden vector, and keep it when they are serialised (with the library rosbags)."""

import subprocess
import sys

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from host.tests.clients.conftest import captures, programs, reference
from taxel_protocol import FrameType
from taxel_protocol.frames import FRAMES, Acknowledgement
from taxel_protocol.layout import unpack

FOLDER = programs.CLIENTS / "ros2"
PACKAGE = "taxel_hub_msgs"
PARTS = {FrameType.TAXELS, FrameType.COMPACT_TAXELS}


@pytest.fixture(scope="module")
def types():
    """Types of all messages of the package."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    definitions = {}
    for path in (FOLDER / PACKAGE / "msg").glob("*.msg"):
        definitions |= get_types_from_msg(path.read_text(), f"{PACKAGE}/msg/{path.stem}")
    store.register(definitions)
    return store


def make_header(types):
    return types.types["std_msgs/msg/Header"](types.types["builtin_interfaces/msg/Time"](1, 2), "hub")


def make_message(types, name, **fields):
    """Create a ROS message of the package. fields: values by name; bytes become an array."""
    kind = types.types[f"{PACKAGE}/msg/{name}"]
    values = {key: np.frombuffer(v, np.uint8) if isinstance(v, bytes) else v for key, v in fields.items()}
    return kind(**values)


def build(types, frame_type, sequence, payload):
    """Build the ROS message of a frame that is no taxel frame."""
    fields, rest = unpack(FRAMES[frame_type].payload, payload)
    name = "".join(part.capitalize() for part in frame_type.name.lower().split("_"))
    if frame_type == FrameType.ACKNOWLEDGE:
        parts = [unpack(Acknowledgement, rest[i : i + 3])[0] for i in range(0, len(rest), 3)]
        fields["acknowledgements"] = [make_message(types, "Acknowledgement", **part) for part in parts]
    elif frame_type == FrameType.LOG:
        fields["text"] = rest.decode("latin-1")
    elif FRAMES[frame_type].minimum != FRAMES[frame_type].maximum:
        fields[FRAMES[frame_type].payload.subcons[-1].name] = rest
    return make_message(types, name, header=make_header(types), sequence=sequence, lost_before=3, **fields)


def test_every_frame_survives_serialisation(types):
    for vector in reference.load_vectors("frames", "frames"):
        frame_type = FrameType(vector["type"])
        if frame_type in PARTS:  # a taxel frame, which another message of the package describes
            continue
        message = build(types, frame_type, vector["sequence"], bytes.fromhex(vector["payload"]))
        data = types.serialize_cdr(message, message.__msgtype__)
        again = types.deserialize_cdr(data, message.__msgtype__)
        assert types.serialize_cdr(again, message.__msgtype__) == data, vector["name"]
        assert again.sequence == vector["sequence"]
        for name, value in vector["fields"].items():
            found = getattr(again, name)
            assert (found.tobytes().hex() if isinstance(found, np.ndarray) else found) == value, vector["name"]


def test_a_named_code_is_a_constant_of_its_message(types):
    text = (FOLDER / PACKAGE / "msg" / "BoardFault.msg").read_text()
    assert "uint8 FAULT_SDA_STUCK=4\n" in text
    kind = types.types[f"{PACKAGE}/msg/BoardFault"]
    assert kind.FAULT_RECOVERED == 12


def test_every_message_is_listed_in_the_build_file():
    listed = (FOLDER / PACKAGE / "CMakeLists.txt").read_text()
    names = sorted(path.stem for path in (FOLDER / PACKAGE / "msg").glob("*.msg"))
    assert [line.strip() for line in listed.splitlines() if ".msg" in line] == [f'"msg/{name}.msg"' for name in names]


def test_the_example_writes_every_taxel_frame_of_a_capture(tmp_path, types):
    captures.record_capture(tmp_path / "skin.bin", 0.5, "compact")
    example = FOLDER / "examples" / "frames_to_bag.py"
    subprocess.run([sys.executable, example, tmp_path / "skin.bin", tmp_path / "bag"], check=True, timeout=120)
    stream = reference.Stream("bag", reference.TO_HOST, reference.read_stream(tmp_path / "skin.bin"))
    lines = [line for line in reference.format_stream(stream, has_wire=False) if "TAXELS" in line]
    with Reader(tmp_path / "bag") as bag:
        messages = [types.deserialize_cdr(data, f"{PACKAGE}/msg/TaxelFrame") for _, _, data in bag.messages()]
    assert len(messages) == len(lines)
    for message, line in zip(messages, lines, strict=True):
        assert f" counts={','.join(map(str, message.raw_counts))}" in line
        assert f" sequence={message.sequence} " in line
