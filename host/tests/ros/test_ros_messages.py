"""Message definitions and CDR encoding, checked against independent libraries."""

import re
import xml.etree.ElementTree as ET
from importlib import resources

import numpy as np
import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore

from taxel.ros.cdr import CdrError, decode, encode
from taxel.ros.contacts import POINT, make_point_fields
from taxel.ros.definitions import fields, get_definition, make_ros1_schema, make_ros2_schema, parse_fields
from taxel.ros.ros_import import RosError, import_ros1

STANDARD = (
    "std_msgs/Header", "std_msgs/String", "geometry_msgs/TransformStamped", "tf2_msgs/TFMessage",
    "sensor_msgs/JointState", "sensor_msgs/PointField", "sensor_msgs/PointCloud2", "diagnostic_msgs/DiagnosticArray",
)  # fmt: skip
CHECKSUMS = {"diagnostic_msgs/DiagnosticArray": "60810da900de1dd6ddd437c3503511da"}  # not part of Debian's ros-core
OWN = ("TaxelScan", "Activations", "Baseline", "HubBytes", "Proximity", "TwinFrame", "TwinRepair")
HEADER = {"stamp": {"sec": 12, "nanosec": 345_678_901}, "frame_id": "palm"}
MESSAGES = {
    "taxel_msgs/TaxelScan": {
        "header": HEADER, "address": 0x21, "name": "palm", "sequence": 65_535, "cycle": 3, "board_time_us": 2**32 - 1,
        "hub_time_us": 7, "valid": True, "raw_counts": np.array([0, 1, 65_535], np.uint16),
    },
    "taxel_msgs/Baseline": {
        "header": HEADER, "samples": 100, "mean": [1.5, float("nan")], "noise": [], "disturbed": [True, False, True],
    },
    "taxel_msgs/Proximity": {
        "header": HEADER, "address": 0x21, "name": "palm", "ready": True, "present": 0.5, "contact": 0.25,
        "distance_m": [0.5, 0.25, 1.0], "speed_m_s": [0.0, -0.5, 0.5], "contact_soon": 0.75, "horizon_s": 0.125,
        "time_to_contact_s": [1.0, 0.5, float("inf")], "taxel": -1, "target": "grounded", "targets": ["grounded", ""],
        "probabilities": [1.0, 0.0],
    },
    "taxel_msgs/TwinFrame": {
        "header": HEADER, "condition": "box top_1", "measured": [1.5, float("nan")], "predicted": [1.0, 2.0],
        "residual": [], "rms": 0.5,
    },
    "taxel_msgs/TwinRepair": {
        "header": HEADER, "raw_counts": np.array([0, 65_535], np.uint16), "signal": [1.5, float("nan")],
        "flags": [1, 6], "delay_s": [0.0, -0.125], "corrections": ["alarm 1: taxel 3 is interpolated", ""],
    },
    "sensor_msgs/JointState": {
        "header": HEADER, "name": ["a", "", "joint"], "position": [0.25], "velocity": [], "effort": np.zeros(2),
    },
    "sensor_msgs/PointCloud2": {
        "header": HEADER, "height": 1, "width": 2, "fields": make_point_fields(), "is_bigendian": False,
        "point_step": 36, "row_step": 72, "data": bytes(range(72)), "is_dense": True,
    },
}  # fmt: skip


def to_builtin(value):
    """Convert a message of any library to dicts, lists, strings and numbers."""
    if isinstance(value, dict):
        return {key: to_builtin(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [to_builtin(each) for each in value]
    if isinstance(value, bytes | np.ndarray):
        return np.frombuffer(value, np.uint8).tolist() if isinstance(value, bytes) else value.tolist()
    names = getattr(value, "__slots__", None) or getattr(value, "__dataclass_fields__", None)
    if names:  # rosbags lists the constants of a message, which have upper-case names, among the fields
        names = [name for name in names if name.islower() and not name.startswith("__")]
        return {name: to_builtin(getattr(value, name)) for name in names}
    return value


@pytest.mark.parametrize("name", MESSAGES)
def test_encoded_message_is_decoded_equally_by_the_library_and_by_the_reference_decoder(name):
    data = encode(name, MESSAGES[name])
    expected = repr(to_builtin(MESSAGES[name]))
    assert repr(to_builtin(decode(name, data))) == expected
    schema = Schema(1, make_ros2_schema(name).encode(), "ros2msg", name.replace("/", "/msg/"))
    reference = DecoderFactory().decoder_for("cdr", schema)
    assert repr(to_builtin(reference(data))) == expected


@pytest.mark.parametrize("name", STANDARD)
def test_standard_message_has_the_fields_of_ros_2(name):
    store = get_typestore(Stores.ROS2_HUMBLE)
    reference = store.fielddefs[name.replace("/", "/msg/")][1]
    assert [field.name for field in fields(name)] == [each[0] for each in reference]


@pytest.mark.parametrize("name", STANDARD)
def test_standard_message_has_the_checksum_of_ros_1(name):
    """A subscriber with the standard class refuses a topic with another checksum."""
    try:
        import_ros1()
    except RosError as error:
        pytest.skip(str(error))
    from genpy.dynamic import generate_dynamic
    from roslib.message import get_message_class

    generated = generate_dynamic(name, make_ros1_schema(name))[name]
    reference = get_message_class(name)
    assert generated._md5sum == (reference._md5sum if reference is not None else CHECKSUMS[name])


def test_ros_package_of_the_original_message_builds_exactly_this_message():
    package = resources.files("taxel.ros") / "bici_ros_sensor_reader"
    assert [file.name for file in (package / "msg").iterdir()] == ["TactileData.msg"]
    assert "TactileData.msg" in (package / "CMakeLists.txt").read_text()
    assert ET.fromstring((package / "package.xml").read_text()).findtext("name") == "bici_ros_sensor_reader"


def test_cmake_list_of_the_ros_package_has_every_message_file():
    package = resources.files("taxel.ros") / "taxel_msgs"
    names = sorted(file.name.removesuffix(".msg") for file in (package / "msg").iterdir())
    listed = re.search(r"set\(messages ([\w ]+)\)", (package / "CMakeLists.txt").read_text())
    assert listed is not None
    assert names == sorted(OWN) == sorted(listed[1].split())
    assert ET.fromstring((package / "package.xml").read_text()).findtext("name") == "taxel_msgs"


@pytest.mark.parametrize("name", OWN)
def test_every_message_of_the_project_and_each_field_that_needs_one_has_a_comment(name):
    text = get_definition(f"taxel_msgs/{name}")
    assert text.startswith("# ")
    self_explanatory = {"data", "threshold_counts", "active_count"}
    for line in filter(parse_fields, text.splitlines()):
        assert "#" in line or parse_fields(line)[0].name in self_explanatory, line


def test_point_fields_have_the_offsets_of_the_point_type():
    offsets = {field["name"]: field["offset"] for field in make_point_fields()}
    assert offsets == {name: POINT.fields[name][1] for name in POINT.names}


@pytest.mark.parametrize("size", [0, 3, 20, -1])  # -1: the last byte is missing
def test_truncated_message_is_refused(size):
    data = encode("taxel_msgs/TaxelScan", MESSAGES["taxel_msgs/TaxelScan"])
    with pytest.raises(CdrError):
        decode("taxel_msgs/TaxelScan", data[:size])


def test_string_whose_length_is_beyond_the_end_of_the_message_is_refused():
    data = encode("std_msgs/String", {"data": "x"})  # encapsulation (4 bytes), length (4 bytes), text
    with pytest.raises(CdrError):
        decode("std_msgs/String", data[:4] + b"\xff\xff\xff\xff" + data[8:])


def test_array_whose_length_is_beyond_the_end_of_the_message_is_refused():
    data = encode("taxel_msgs/HubBytes", {"header": HEADER, "arrival_ns": 0, "data": b""})  # ends with the length 0
    with pytest.raises(CdrError):
        decode("taxel_msgs/HubBytes", data[:-4] + b"\xff\xff\xff\x7f")
