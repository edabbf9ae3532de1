"""MCAP files: compatibility with the reference readers, and recovery of killed, truncated and damaged files."""

import signal
import struct
import subprocess
import sys
import tracemalloc

import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

import taxel
from host.tests.recordings import ALL_FIELDS, find_differing_fields, read_frames
from taxel.hand.kinematics import build_kinematics
from taxel.hand.transforms import make_pose
from taxel.link import CaptureError
from taxel.recording.formats import convert
from taxel.ros.contacts import POINT
from taxel.ros.diagnostics import OK
from taxel.ros.mcap_file import McapFile
from taxel.ros.topics import SkinTopics
from taxel.signal import Activation
from taxel.skin import Skin, open_source
from taxel.skin.recorder import open_recorded

OFFSET_S = 1_800_000_000
"""Unix time minus stream time of a bag, seconds: a time in the year 2027."""


@pytest.fixture(scope="module")
def mcap(recorded, tmp_path_factory):
    """Path of the recording, converted to MCAP."""
    path = tmp_path_factory.mktemp("mcap") / "a.mcap"
    convert(recorded.path, path)
    return path


@pytest.fixture(scope="module")
def bag(mcap):
    """All messages of the MCAP file by topic, read by rosbags: lists of (time in nanoseconds, message)."""
    messages = {}
    with AnyReader([mcap]) as reader:
        for connection, time_ns, data in reader.messages():
            messages.setdefault(connection.topic, []).append((time_ns, reader.deserialize(data, connection.msgtype)))
    return messages


def to_seconds(stamp):
    """Convert a ROS time stamp to seconds."""
    return stamp.sec + stamp.nanosec * 1e-9


def test_reference_reader_decodes_every_topic_and_the_header(mcap, recorded):
    with mcap.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        names = {channel.topic for channel in summary.channels.values()}
        decoded = sum(1 for _ in reader.iter_decoded_messages())
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    scan_topics = {f"/taxel/{board.name}/scan" for board in recorded.hand.boards}
    skin_topics = {f"/taxel/{name}" for name in ("activations", "contact_cloud", "baseline", "hub_bytes")}
    standard_topics = {"/joint_states", "/tf", "/tf_static", "/diagnostics", "/robot_description"}
    assert names == scan_topics | skin_topics | standard_topics
    assert decoded == summary.statistics.message_count > len(recorded.frames)
    assert set(metadata) == {"taxel", "taxel_baseline", "taxel_boards"}
    assert set(metadata["taxel"]) >= {"hand_description", "taxel_version", "url", "clock", "joint_position"}
    assert set(metadata["taxel_boards"]) == {f"0x{board.address:02X}" for board in recorded.hand.boards}


def test_rosbags_reads_every_scan_with_its_counts(bag, recorded):
    for board in recorded.hand.boards:
        frames = [frame for frame in recorded.frames if frame.address == board.address]
        scans = [scan for _, scan in bag[f"/taxel/{board.name}/scan"] if scan.valid]
        assert [scan.sequence for scan in scans] == [frame.sequence for frame in frames]
        assert all(np.array_equal(a.raw_counts, b.raw_counts) for a, b in zip(scans, frames, strict=True))


def test_transforms_read_by_rosbags_give_the_bracket_poses_of_the_kinematics(bag, recorded):
    kinematics = build_kinematics(recorded.hand)
    joints = bag["/joint_states"][-1][1]
    assert joints.name == list(kinematics.robot.joint_names)
    parents = {}
    for topic in ("/tf_static", "/tf"):
        for transform in bag[topic][-1][1].transforms:
            t, q = transform.transform.translation, transform.transform.rotation
            parents[transform.child_frame_id] = (
                transform.header.frame_id,
                make_pose([t.x, t.y, t.z], [q.w, q.x, q.y, q.z]),
            )
    for board, expected in zip(recorded.hand.boards, kinematics.compute_sensor_poses(joints.position), strict=True):
        frame = bag[f"/taxel/{board.name}/scan"][0][1].header.frame_id
        world_pose = np.eye(4)
        while frame in parents:
            frame, step = parents[frame]
            world_pose = step @ world_pose
        assert frame == "world"
        assert np.allclose(world_pose, expected, atol=1e-9)


def test_contact_cloud_read_by_rosbags_lies_at_the_indented_taxels(bag, recorded):
    _, cloud = bag["/taxel/contact_cloud"][-2]  # the recording ends within the last poll cycle
    points = cloud.data.view(POINT)
    assert (cloud.width, cloud.header.frame_id) == (len(points), "world")
    activations = bag["/taxel/activations"][-2][1]
    assert points["taxel"].tolist() == activations.taxel.tolist()
    assert len(points) == activations.active_count > 3
    assert set(points["address"].tolist()) == {recorded.hand.find_board("palm").address}
    angles = bag["/joint_states"][-1][1].position
    kinematics = build_kinematics(recorded.hand)
    centres = kinematics.compute_taxel_positions(angles)[points["taxel"]]
    normals = kinematics.compute_taxel_normals(angles)[points["taxel"]]
    assert np.allclose(np.stack([points[name] for name in "xyz"], axis=1), centres, atol=1e-6)
    assert np.allclose(np.stack([points[f"normal_{name}"] for name in "xyz"], axis=1), normals, atol=1e-6)
    offsets = {field.name: field.offset for field in cloud.fields}
    assert offsets["drop"] == POINT.fields["drop"][1]


def test_activations_and_baseline_in_the_file_equal_those_of_the_library(bag, recorded):
    with taxel.open(f"file:{recorded.path}") as skin:
        baseline = skin.take_baseline()
        activation = Activation(baseline.mean)
        expected = [np.flatnonzero(activation(scan.raw_counts, scan.valid).active).tolist() for scan in skin.scans()]
    recorded_taxels = [message.taxel.tolist() for _, message in bag["/taxel/activations"]]
    assert recorded_taxels == expected[: len(recorded_taxels)]
    assert len(expected) - len(recorded_taxels) <= 1  # the recording ends within the last poll cycle
    ((_, message),) = bag["/taxel/baseline"]
    assert np.array_equal(message.mean, baseline.mean)


def test_diagnostics_have_a_status_without_error_for_the_hub_every_board_and_every_branch(bag, recorded):
    statuses = bag["/diagnostics"][-1][1].status
    boards = [board.name for board in recorded.hand.boards]
    branches = [f"branch {name}" for name in recorded.hand.branches]
    assert [status.name for status in statuses] == [f"taxel: {name}" for name in ("hub", *boards, *branches)]
    assert {status.level for status in statuses} == {OK}
    values_of_first_board = {pair.key: pair.value for pair in statuses[1].values}
    assert int(values_of_first_board["received"]) > 100


def test_log_times_equal_the_stamps_of_the_messages(bag):
    for topic in ("/taxel/palm/scan", "/tf", "/taxel/contact_cloud"):
        for time_ns, message in bag[topic]:
            header = message.transforms[0].header if topic == "/tf" else message.header
            assert abs(to_seconds(header.stamp) - time_ns * 1e-9) < 1e-6


def test_mcap_file_has_the_frames_losses_and_hand_of_the_capture(mcap, recorded):
    with taxel.open(f"file:{mcap}") as skin:
        assert find_differing_fields(list(skin), recorded.frames, *ALL_FIELDS) == []
        assert repr(skin.losses) == repr(recorded.losses)
        assert skin.hand == recorded.hand


def test_bag_with_topics_only_is_read_as_the_frames_of_the_recording(tmp_path, recorded):
    """`ros2 bag record` writes such a bag: without the hub's bytes and without a header, with stamps in Unix time."""
    path = tmp_path / "bag.mcap"
    link, hand = open_source(f"file:{recorded.path}")
    with Skin(link, hand) as skin, McapFile(path, {}) as file:
        topics = SkinTopics(hand, skin.hub, epoch_offset_ns=OFFSET_S * 10**9)
        for frame in list(skin)[:600]:
            for message in topics.take(frame):
                file.publish(message)
    frames, losses = read_frames(path)
    field_names = ("address", "cycle", "sequence", "board_time_us", "raw_counts")
    assert find_differing_fields(frames, recorded.frames[:600], *field_names) == []
    time_errors_s = [a.time_s - OFFSET_S - b.time_s for a, b in zip(frames, recorded.frames, strict=False)]
    assert max(map(abs, time_errors_s)) < 2e-6
    assert sum(board.missing for board in losses.boards.values()) == 0


PROGRAM_TO_KILL = """
import sys, time
from taxel.skin.recorder import open_recorded
with open_recorded("emulator:?speed=max&duration_s=4", sys.argv[1], "flat8") as skin:
    for count, frame in enumerate(skin):
        if count == 300:
            time.sleep(0.6)  # a chunk is due
        if count == 310:
            print("written", flush=True)
            time.sleep(60.0)
"""


def test_frames_written_before_a_kill_are_readable_and_convertible(tmp_path):
    path = tmp_path / "killed.mcap"
    with subprocess.Popen([sys.executable, "-c", PROGRAM_TO_KILL, path], stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout.readline() == b"written\n"
        finally:
            process.send_signal(signal.SIGKILL)
    frames = []
    with taxel.open(f"file:{path}") as skin:
        assert skin.hand.name == "flat8"
        with pytest.raises(CaptureError, match="everything before it was read"):
            append_frames(skin, frames)
    assert len(frames) >= 300
    with pytest.raises(CaptureError, match="truncated"):
        convert(path, tmp_path / "recovered.mcap")
    assert find_differing_fields(read_frames(tmp_path / "recovered.mcap")[0], frames, *ALL_FIELDS) == []


def append_frames(skin, frames):
    """Append every frame of a skin to `frames`. After an exception `frames` contains the frames before it."""
    for frame in skin:
        frames.append(frame)


def test_truncated_file_gives_the_frames_before_the_truncation_and_then_an_error(tmp_path, mcap, recorded):
    data = mcap.read_bytes()
    path = tmp_path / "truncated.mcap"
    counts = []
    for size in (len(data) - 60, len(data) // 2, len(data) // 3, 250_000):  # the last 60 bytes contain no frame
        path.write_bytes(data[:size])
        frames = []
        with taxel.open(f"file:{path}") as skin, pytest.raises(CaptureError) as caught:
            append_frames(skin, frames)
        assert "\n" not in str(caught.value)
        assert find_differing_fields(frames, recorded.frames[: len(frames)], *ALL_FIELDS) == []
        counts.append(len(frames))
    assert counts[0] == len(recorded.frames)
    assert counts == sorted(counts, reverse=True)


@pytest.mark.parametrize("seed", range(8))
def test_flipped_bytes_raise_an_error_of_one_line(tmp_path, mcap, seed):
    generator = np.random.default_rng(seed)
    data = bytearray(mcap.read_bytes()[:150_000])
    for at in generator.integers(8, len(data), 20):
        data[at] ^= int(generator.integers(1, 256))
    path = tmp_path / "flipped.mcap"
    path.write_bytes(data)
    with pytest.raises(taxel.TaxelError) as caught, taxel.open(f"file:{path}") as skin:
        append_frames(skin, [])
    assert "\n" not in str(caught.value), f"seed {seed}"


def test_mcap_file_that_is_truncated_before_its_header_is_refused(tmp_path):
    path = tmp_path / "short.mcap"
    # signature of MCAP, then a record "data end" (0x0F) of 4 bytes
    path.write_bytes(b"\x89MCAP0\r\n" + b"\x0f" + (4).to_bytes(8, "little") + bytes(4))
    with pytest.raises(CaptureError, match="truncated"):
        taxel.open(f"file:{path}")


def test_recording_does_not_replace_an_existing_file(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(b"existing")
    with pytest.raises(CaptureError, match="exists already"):
        open_recorded("emulator:?speed=max", path)
    assert path.read_bytes() == b"existing"


def test_recording_of_an_unreachable_hub_leaves_no_file(tmp_path):
    with pytest.raises(taxel.TaxelError):
        open_recorded("serial:///dev/ttyNONE", tmp_path / "a.mcap")
    assert list(tmp_path.iterdir()) == []


def test_chunk_that_unpacks_to_more_than_its_stated_size_is_refused_without_unpacking_it(tmp_path):
    """The chunk states 1000 bytes; its compressed frame contains a gigabyte of zeros."""
    body = b"".join([struct.pack("<QQQI", 0, 0, 1000, 0), struct.pack("<I", 4), b"zstd"])
    packed = zstandard.ZstdCompressor().compressobj(size=1 << 30)
    data = b"".join([*(packed.compress(bytes(1 << 24)) for _ in range(64)), packed.flush()])
    body += struct.pack("<Q", len(data)) + data
    path = tmp_path / "bomb.mcap"
    header = b"\x01" + struct.pack("<Q", 8) + bytes(8)
    path.write_bytes(b"\x89MCAP0\r\n" + header + b"\x06" + struct.pack("<Q", len(body)) + body)
    tracemalloc.start()
    try:
        with pytest.raises(CaptureError, match="damaged"):
            taxel.open(f"file:{path}")
        _, peak_bytes = tracemalloc.get_traced_memory()
        assert peak_bytes < 1 << 24
    finally:
        tracemalloc.stop()
