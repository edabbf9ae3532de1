"""Definitions and CDR: other people's libraries read what is written here."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from importlib import resources

import numpy as np
import pytest
from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore

from taxel.ros.cdr import CdrError, decode, encode
from taxel.ros.contacts import POINT, point_fields
from taxel.ros.definitions import definition, fields, parse_fields, ros1_schema, ros2_schema
from taxel.ros.find import RosError, import_ros1

STANDARD = (
    "std_msgs/Header", "std_msgs/String", "geometry_msgs/TransformStamped", "tf2_msgs/TFMessage",
    "sensor_msgs/JointState", "sensor_msgs/PointField", "sensor_msgs/PointCloud2", "diagnostic_msgs/DiagnosticArray",
)  # fmt: skip
CHECKSUMS = {"diagnostic_msgs/DiagnosticArray": "60810da900de1dd6ddd437c3503511da"}  # Debian's ros-core has it not
OWN = ("TaxelScan", "Activations", "Baseline", "HubBytes")
HEADER = {"stamp": {"sec": 12, "nanosec": 345_678_901}, "frame_id": "palm"}
MESSAGES = {
    "taxel_msgs/TaxelScan": {
        "header": HEADER, "address": 0x21, "name": "palm", "sequence": 65_535, "cycle": 3, "board_time_us": 2**32 - 1,
        "hub_time_us": 7, "valid": True, "raw_counts": np.array([0, 1, 65_535], np.uint16),
    },
    "taxel_msgs/Baseline": {
        "header": HEADER, "samples": 100, "mean": [1.5, float("nan")], "noise": [], "disturbed": [True, False, True],
    },
    "sensor_msgs/JointState": {
        "header": HEADER, "name": ["a", "", "joint"], "position": [0.25], "velocity": [], "effort": np.zeros(2),
    },
    "sensor_msgs/PointCloud2": {
        "header": HEADER, "height": 1, "width": 2, "fields": point_fields(), "is_bigendian": False,
        "point_step": 36, "row_step": 72, "data": bytes(range(72)), "is_dense": True,
    },
}  # fmt: skip


def plain(value):
    """A decoded message, of whichever library, as dicts, lists and numbers."""
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [plain(each) for each in value]
    if isinstance(value, bytes | np.ndarray):
        return np.frombuffer(value, np.uint8).tolist() if isinstance(value, bytes) else value.tolist()
    names = getattr(value, "__slots__", None) or getattr(value, "__dataclass_fields__", None)
    if names:
        return {name: plain(getattr(value, name)) for name in names if not name.startswith("__")}
    return value


@pytest.mark.parametrize("name", MESSAGES)
def test_a_message_comes_back_from_our_own_and_the_reference_decoder(name):
    data = encode(name, MESSAGES[name])
    wanted = repr(plain(MESSAGES[name]))
    assert repr(plain(decode(name, data))) == wanted
    schema = Schema(1, ros2_schema(name).encode(), "ros2msg", name.replace("/", "/msg/"))
    reference = DecoderFactory().decoder_for("cdr", schema)
    assert reference is not None
    assert repr(plain(reference(data))) == wanted


@pytest.mark.parametrize("name", STANDARD)
def test_a_standard_message_has_the_fields_of_ros_2(name):
    store = get_typestore(Stores.ROS2_HUMBLE)
    theirs = store.fielddefs[name.replace("/", "/msg/")][1]
    assert [field.name for field in fields(name)] == [each[0] for each in theirs]


@pytest.mark.parametrize("name", STANDARD)
def test_a_standard_message_has_the_checksum_of_ros_1(name):
    """Else a subscriber with the standard class would refuse the topic."""
    try:
        import_ros1()
    except RosError as error:
        pytest.skip(str(error))
    from genpy.dynamic import generate_dynamic
    from roslib.message import get_message_class

    made = generate_dynamic(name, ros1_schema(name))[name]
    theirs = get_message_class(name)
    assert made._md5sum == (theirs._md5sum if theirs is not None else CHECKSUMS[name])


def test_the_ros_package_builds_every_message_that_is_in_it():
    package = resources.files("taxel.ros") / "taxel_msgs"
    names = sorted(file.name.removesuffix(".msg") for file in (package / "msg").iterdir())
    listed = re.search(r"set\(messages ([\w ]+)\)", (package / "CMakeLists.txt").read_text())
    assert listed is not None
    assert names == sorted(OWN) == sorted(listed[1].split())
    assert ET.fromstring((package / "package.xml").read_text()).findtext("name") == "taxel_msgs"


@pytest.mark.parametrize("name", OWN)
def test_every_field_of_our_own_messages_says_what_it_is(name):
    text = definition(f"taxel_msgs/{name}")
    assert text.startswith("# ")
    plain_names = {"data", "threshold_counts", "active_count"}
    for line in filter(parse_fields, text.splitlines()):
        assert "#" in line or parse_fields(line)[0].name in plain_names, line


def test_the_contact_clouds_fields_lie_where_the_points_have_them():
    places = {field["name"]: field["offset"] for field in point_fields()}
    assert places == {name: POINT.fields[name][1] for name in POINT.names}


@pytest.mark.parametrize("cut", [0, 3, 20, -1])
def test_a_message_that_is_cut_short_is_refused(cut):
    data = encode("taxel_msgs/TaxelScan", MESSAGES["taxel_msgs/TaxelScan"])
    with pytest.raises(CdrError):
        decode("taxel_msgs/TaxelScan", data[:cut])


def test_a_length_that_no_file_can_hold_is_refused():
    data = encode("std_msgs/String", {"data": "x"})
    with pytest.raises(CdrError):
        decode("std_msgs/String", data[:4] + b"\xff\xff\xff\xff" + data[8:])
    with pytest.raises(CdrError):
        decode("taxel_msgs/HubBytes", encode("taxel_msgs/HubBytes", {"header": HEADER, "arrival_ns": 0, "data": b""})
               [:-4] + b"\xff\xff\xff\x7f")  # fmt: skip
