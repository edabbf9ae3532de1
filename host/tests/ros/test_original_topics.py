"""Topics of the original ROS stack: definition, publishing, bags of ROS 1 and MCAP, and damaged files."""

import random
import re
import struct
import types
from unittest import mock

import numpy as np
import pytest
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from host.tests.command_line import run_refused_command, run_taxel
from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.link import CaptureError
from taxel.ros import original_link
from taxel.ros.cdr import encode
from taxel.ros.definitions import get_definition, make_ros1_schema, make_ros2_schema
from taxel.ros.mcap_file import McapFile
from taxel.ros.mcap_joints import JOINT_TOPIC, JOINT_TYPE, read_mcap_joints
from taxel.ros.original_topics import ORIGINAL_TYPE, OriginalFrames, OriginalMessageError, OriginalTopics
from taxel.ros.ros_import import RosError, import_ros1
from taxel.skin import open_skin
from taxel.stream import TaxelFrame

MD5 = "5a8a55c50645786d3fc308931a9fcd07"
"""MD5 of "float32[] data", "uint32 timestamp", "uint8 sensor_num", one a line: the checksum of ROS 1."""
TYPE_HASH = "RIHS01_3a1663ac137ca7dc324db598984a0a7f671a574c9a6d71cf2b15a0ccaa6a23d3"
"""Type hash of ROS 2 (REP 2011) of bici_ros_sensor_reader/msg/TactileData."""
CYCLES = 4
ZSTD_MAGIC = bytes.fromhex("28b52ffd")
"""First bytes of a frame of Zstandard (RFC 8878, section 3.1.1)."""
START_NS = 1_670_000_000_000_000_000
SIGNATURE_BYTES = 13
"""Number of bytes of the first line of a ROS 1 bag, "#ROSBAG V2.0"."""


def make_store(type_name=ORIGINAL_TYPE):
    """Make a rosbags type store that contains the original message under a type name."""
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(get_definition(ORIGINAL_TYPE), type_name.replace("/", "/msg/")))
    return store


def make_messages(hand, seed=1, cycles=CYCLES):
    """Make random messages of all boards of a hand for some poll cycles, in the order of the boards.

    A message is (time of recording in ns, address, clock of the hub in ms, raw counts).
    """
    rng = np.random.default_rng(seed)
    messages = []
    for cycle in range(cycles):
        for index, board in enumerate(hand.boards):
            counts = rng.integers(0, 65_536, board.kind.taxel_count)
            time_ms = 167 * cycle + 7 * index
            messages.append((START_NS + time_ms * 1_000_000, board.address, 5000 + time_ms, counts))
    return messages


def write_bag(path, messages, type_name=ORIGINAL_TYPE, compression=None):
    """Write TactileData messages to a ROS 1 bag with the library rosbags."""
    store, connections = make_store(type_name), {}
    ros_type = type_name.replace("/", "/msg/")
    bag = Writer(path)
    if compression is not None:
        bag.set_compression(compression)
    with bag:
        for time_ns, address, time_ms, counts in messages:
            if address not in connections:
                connections[address] = bag.add_connection(f"/sensor_{address}_readings", ros_type, typestore=store)
            message = store.types[ros_type](np.asarray(counts, np.float32), time_ms, address)
            bag.write(connections[address], time_ns, store.serialize_ros1(message, ros_type))
    return path


def write_ros1_mcap(path, messages):
    """Write TactileData messages to an MCAP file in the encoding of ROS 1, as a converted bag has them."""
    store, channels = make_store(), {}
    ros_type = ORIGINAL_TYPE.replace("/", "/msg/")
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start("ros1", "test")
        schema = writer.register_schema(ORIGINAL_TYPE, "ros1msg", make_ros1_schema(ORIGINAL_TYPE).encode())
        for time_ns, address, time_ms, counts in messages:
            if address not in channels:
                channels[address] = writer.register_channel(f"/sensor_{address}_readings", "ros1", schema)
            message = store.types[ros_type](np.asarray(counts, np.float32), time_ms, address)
            writer.add_message(channels[address], time_ns, bytes(store.serialize_ros1(message, ros_type)), time_ns)
        writer.finish()
    return path


def assert_frames_equal_messages(frames, messages):
    """Assert that frames have the address, counts, hub time and arrival time of the messages, in the same order."""
    assert len(frames) == len(messages)
    for frame, (time_ns, address, time_ms, counts) in zip(frames, messages, strict=True):
        assert frame.address == address
        assert np.array_equal(frame.raw_counts, counts)
        assert frame.board_time_us == time_ms * 1000
        assert frame.time_s == pytest.approx(time_ns * 1e-9, abs=0.05)


def test_definition_has_the_checksum_of_ros_1_and_the_type_hash_of_ros_2():
    store, name = make_store(), ORIGINAL_TYPE.replace("/", "/msg/")
    assert store.generate_msgdef(name, ros_version=1)[1] == MD5
    assert store.hash_rihs01(name) == TYPE_HASH
    assert make_ros2_schema(ORIGINAL_TYPE) == get_definition(ORIGINAL_TYPE)


def test_message_class_generated_for_rospy_has_the_checksum_of_the_original_message():
    try:
        import_ros1()
    except RosError as error:
        pytest.skip(str(error))
    from genpy.dynamic import generate_dynamic

    assert generate_dynamic(ORIGINAL_TYPE, make_ros1_schema(ORIGINAL_TYPE))[ORIGINAL_TYPE]._md5sum == MD5


@pytest.mark.parametrize("type_name", [ORIGINAL_TYPE, "serial_comm/TactileData"])
def test_bag_of_ros_1_is_read_as_a_skin_of_the_original_hand(tmp_path, type_name):
    messages = make_messages(load_hand("original"))
    path = write_bag(tmp_path / "skin.bag", messages, type_name)
    with open_skin(f"file:{path}") as skin:
        assert skin.hand.name == "original"
        assert_frames_equal_messages(list(skin), messages)


def test_bag_with_boards_of_the_thumb_is_read_with_the_complete_hand(tmp_path):
    messages = make_messages(load_hand("original_complete"), cycles=2)
    with open_skin(f"file:{write_bag(tmp_path / 'skin.bag', messages)}") as skin:
        assert skin.hand.name == "original_complete"
        assert_frames_equal_messages(list(skin), messages)


def test_mcap_with_messages_in_the_encoding_of_ros_1_is_read(tmp_path):
    messages = make_messages(load_hand("original"))
    with open_skin(f"file:{write_ros1_mcap(tmp_path / 'skin.mcap', messages)}") as skin:
        assert skin.hand.name == "original"
        assert_frames_equal_messages(list(skin), messages)


def test_published_topics_are_read_back_from_mcap_for_random_frames(tmp_path):
    seed = random.randrange(1 << 32)
    print("seed", seed)
    hand, messages = load_hand("original"), make_messages(load_hand("original"), seed)
    topics = OriginalTopics(hand)
    path = tmp_path / "skin.mcap"
    with McapFile(path, {}) as file:
        for time_ns, address, time_ms, counts in messages:
            frame = TaxelFrame(address, 0, 0, time_ns * 1e-9, 0, time_ms * 1000, counts.astype(np.uint16))
            for message in topics.take(frame):
                assert message.topic == f"/sensor_{address}_readings"
                file.publish(message)
        assert list(topics.finish()) == []
    with open_skin(f"file:{path}") as skin:
        assert_frames_equal_messages(list(skin), messages)


def test_time_stamps_in_milliseconds_continue_after_the_wrap_of_the_hub_microseconds():
    """The clock wraps after 2^32 us = 4294967.296 ms.

    5000 us after the wrap is 4294972 ms. The second and the last time lie after the wrap, the others before it (late
    frames).
    """
    topics = OriginalTopics(load_hand("original"))
    times_us = [2**32 - 1000, 5000, 2**32 - 2000, 2**31, 2**32 - 1, 0]
    frames = [TaxelFrame(8, 0, 0, 0.0, 0, time_us, np.zeros(65, np.uint16)) for time_us in times_us]
    stamps = [message.message["timestamp"] for frame in frames for message in topics.take(frame)]
    assert stamps == [4294966, 4294972, 4294965, 2147483, 4294967, 4294967]


def test_cycle_with_a_lost_message_has_one_frame_less_because_a_repeated_board_begins_a_new_cycle(tmp_path):
    messages = make_messages(load_hand("original"), cycles=4)
    boards = 17
    lost = 2 * boards + 5  # the sixth board of the third cycle
    path = write_bag(tmp_path / "skin.bag", messages[:lost] + messages[lost + 1 :])
    with open_skin(f"file:{path}") as skin:
        cycles = [frame.cycle for frame in skin]
    assert np.bincount(cycles).tolist() == [boards, boards, boards - 1, boards]


@pytest.mark.parametrize("value", [-1.0, 0.5, 70_000.0, float("nan"), float("inf")])
def test_value_that_is_no_raw_count_is_refused(value):
    message = types.SimpleNamespace(data=np.array([1.0, value], np.float32), timestamp=0, sensor_num=8)
    with pytest.raises(OriginalMessageError, match="board 8, value 1: expected raw counts, integers from 0 to 65535"):
        OriginalFrames().convert(message, 0)


def test_damaged_bags_raise_only_errors_of_one_line(tmp_path):
    seed = random.randrange(1 << 32)
    print("seed", seed)
    rng = random.Random(seed)
    messages = make_messages(load_hand("original"))
    data = write_bag(tmp_path / "skin.bag", messages).read_bytes()
    path = tmp_path / "damaged.bag"
    for case in range(60):
        damaged = bytearray(data)
        if case % 2:  # bytes after the signature are changed
            for _ in range(rng.choice((1, 10, 1000))):
                damaged[rng.randrange(SIGNATURE_BYTES, len(data))] = rng.randrange(256)
        else:  # the file is truncated
            del damaged[rng.randrange(SIGNATURE_BYTES, len(data)) :]
        path.write_bytes(damaged)
        message = ""
        try:
            with open_skin(f"file:{path}") as skin:
                list(skin)
        except TaxelError as error:
            message = str(error)
        assert "\n" not in message


def test_bag_whose_chunk_ends_behind_the_file_is_refused_in_one_line(tmp_path, capsys):
    """The size of the chunk is changed to 1 GiB, so that no byte is left for the index, which follows the chunk.

    The library rosbags raises struct.error when it reads this index.
    """
    path = write_bag(tmp_path / "skin.bag", make_messages(load_hand("original")))
    data = bytearray(path.read_bytes())
    size_at = data.index(b"size=", data.index(b"compression=none")) + 9  # behind the size of the unpacked chunk
    data[size_at : size_at + 4] = (1 << 30).to_bytes(4, "little")
    path.write_bytes(data)
    assert "is no complete ROS 1 bag" in run_refused_command(capsys, "convert", path, tmp_path / "x.bin")


@pytest.mark.parametrize("compression", list(Writer.CompressionFormat))
def test_damaged_compressed_chunk_of_a_bag_is_refused_in_one_line(compression, tmp_path, capsys):
    path = write_bag(tmp_path / "skin.bag", make_messages(load_hand("original")), compression=compression)
    data = bytearray(path.read_bytes())
    # Behind "size=" (5 bytes), the size of the unpacked chunk, and the length of the data (4 bytes each).
    chunk_at = data.index(b"size=", data.index(b"compression=")) + 13
    data[chunk_at : chunk_at + 1000] = bytes(1000)
    path.write_bytes(data)
    assert "is damaged after 0 messages" in run_refused_command(capsys, "convert", path, tmp_path / "x.bin")


@pytest.mark.parametrize("error", [AttributeError, EOFError, LookupError, MemoryError, struct.error])
def test_any_error_of_the_bag_library_is_reported_as_a_damaged_bag(error, tmp_path, monkeypatch):
    path = write_bag(tmp_path / "skin.bag", make_messages(load_hand("original")))
    for method, message in (("messages", "is damaged after 0 messages"), ("open", "is no complete ROS 1 bag")):
        monkeypatch.setattr(Reader, method, mock.Mock(side_effect=error))
        with pytest.raises(CaptureError, match=message), open_skin(f"file:{path}") as skin:
            list(skin)


def test_joint_angles_before_a_damaged_chunk_are_read(tmp_path):
    path = tmp_path / "joints.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file, compression=CompressionType.ZSTD, chunk_size=1)
        writer.start("", "test")
        schema = writer.register_schema(JOINT_TYPE, "ros2msg", make_ros2_schema(JOINT_TYPE).encode())
        channel = writer.register_channel(JOINT_TOPIC, "cdr", schema)
        for seconds in range(2):
            stamp = {"sec": seconds, "nanosec": 0}
            message = {"header": {"stamp": stamp, "frame_id": ""}, "name": ["j0"], "position": [0.1]}
            data = encode(JOINT_TYPE, message | {"velocity": [], "effort": []})
            writer.add_message(channel, seconds, data, seconds)
        writer.finish()
    content = path.read_bytes()
    # Each message is in a chunk of its own; the magic number of the second chunk is overwritten by zeros.
    last_frame_at = [match.start() for match in re.finditer(re.escape(ZSTD_MAGIC), content)][1]
    path.write_bytes(content[:last_frame_at] + bytes(4) + content[last_frame_at + 4 :])
    history = read_mcap_joints(path, ["j0"])
    assert history is not None
    assert len(history) == 1


def test_bag_without_original_topics_is_refused_in_one_line(tmp_path, capsys):
    store = get_typestore(Stores.ROS1_NOETIC)
    path = tmp_path / "other.bag"
    with Writer(path) as bag:
        connection = bag.add_connection("/chatter", "std_msgs/msg/String", typestore=store)
        message = store.types["std_msgs/msg/String"]("hello")
        bag.write(connection, 0, store.serialize_ros1(message, "std_msgs/msg/String"))
    assert "has no topic of the original ROS stack" in run_refused_command(capsys, "convert", path, tmp_path / "x.bin")


def test_bag_whose_tactile_data_have_other_fields_is_refused_in_one_line(tmp_path, capsys):
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("uint16[] data\nuint8 sensor_num", "serial_comm/msg/TactileData"))
    path = tmp_path / "other.bag"
    with Writer(path) as bag:
        connection = bag.add_connection("/sensor_8_readings", "serial_comm/msg/TactileData", typestore=store)
        message = store.types["serial_comm/msg/TactileData"](np.zeros(2, np.uint16), 8)
        bag.write(connection, 0, store.serialize_ros1(message, "serial_comm/msg/TactileData"))
    expected = "expected the fields float32[] data, uint32 timestamp, uint8 sensor_num"
    assert expected in run_refused_command(capsys, "convert", path, tmp_path / "x.bin")


class FakeNode:
    """A node that delivers given messages to its subscribers and is then shut down."""

    def __init__(self, messages):
        self.messages, self.callbacks, self.is_closed = list(messages), {}, False

    @property
    def is_alive(self):
        return bool(self.messages)

    def listen(self, topic, type_name, callback):
        assert type_name == ORIGINAL_TYPE
        self.callbacks[topic] = callback

    def wait(self, timeout_s):
        """Deliver the next message."""
        _, address, time_ms, counts = self.messages.pop(0)
        message = types.SimpleNamespace(data=counts, timestamp=time_ms, sensor_num=address)
        self.callbacks[f"/sensor_{address}_readings"](message)

    def close(self):
        self.is_closed = True


def test_messages_of_the_live_topics_are_frames_of_a_skin_and_the_node_is_closed(monkeypatch):
    messages = make_messages(load_hand("original"))
    node = FakeNode(messages)
    monkeypatch.setattr(original_link, "open_node", lambda version, name: node)
    with open_skin("ros:original?version=1") as skin:
        assert skin.hand.name == "original"
        frames = list(skin)
    assert node.is_closed
    # The node subscribes to the topics of all 22 addresses, also of boards that the hand does not have.
    assert sorted(node.callbacks) == sorted(f"/sensor_{address}_readings" for address in range(8, 30))
    for frame, (_, address, _, counts) in zip(frames, messages, strict=True):
        assert frame.address == address
        assert np.array_equal(frame.raw_counts, counts)


@pytest.mark.parametrize("url", ["ros:", "ros:other", "ros:original?version=3", "ros:original?x=1"])
def test_unknown_ros_source_is_refused_in_one_line(url, capsys):
    assert "expected ros:original" in run_refused_command(capsys, "monitor", url)


def test_capture_converted_from_a_bag_contains_its_counts_and_hand(tmp_path, capsys):
    pytest.importorskip("h5py")
    messages = make_messages(load_hand("original"))
    path = write_bag(tmp_path / "skin.bag", messages)
    assert run_taxel("convert", path, tmp_path / "skin.bin") == 0, capsys.readouterr().err
    with open_skin(f"file:{tmp_path / 'skin.bin'}") as skin:
        assert skin.hand.name == "original"
        assert [frame.raw_counts.tolist() for frame in skin] == [counts.tolist() for *_, counts in messages]
