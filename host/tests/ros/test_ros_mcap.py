"""MCAP files: read by the reference readers, and whole up to a kill or a cut."""

from __future__ import annotations

import signal
import struct
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import zstandard
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

import taxel
from host.tests.recordings import ALL, differences, frames_in
from taxel.hand.kinematics import kinematics_of
from taxel.hand.transforms import pose
from taxel.link import CaptureError
from taxel.recorder import open_recorded
from taxel.recording.forms import convert
from taxel.ros.contacts import POINT
from taxel.ros.mcap_file import McapFile
from taxel.ros.topics import SkinTopics
from taxel.signal import Activation
from taxel.skin import Skin, open_source


@pytest.fixture(scope="module")
def mcap(recorded, tmp_path_factory):
    """The recording as MCAP."""
    path = tmp_path_factory.mktemp("mcap") / "a.mcap"
    convert(recorded.path, path)
    return path


@pytest.fixture(scope="module")
def bag(mcap):
    """Every message by topic, as rosbags reads it: (time, message)."""
    found = {}
    with AnyReader([mcap]) as reader:
        for connection, time_ns, data in reader.messages():
            found.setdefault(connection.topic, []).append((time_ns, reader.deserialize(data, connection.msgtype)))
    return found


def seconds(stamp):
    return stamp.sec + stamp.nanosec * 1e-9


def test_the_reference_reader_finds_every_topic_and_the_header(mcap, recorded):
    with mcap.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        names = {channel.topic for channel in summary.channels.values()}
        decoded = sum(1 for _ in reader.iter_decoded_messages())
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    boards = {f"/taxel/{board.name}/scan" for board in recorded.hand.boards}
    others = {"activations", "contact_cloud", "baseline", "hub_bytes"}
    common = {"/joint_states", "/tf", "/tf_static", "/diagnostics", "/robot_description"}
    assert names == boards | {f"/taxel/{name}" for name in others} | common
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


def test_rosbags_reads_transforms_that_lead_to_where_the_taxels_are(bag, recorded):
    """Every bracket's pose in the world is what the kinematics say, along the chain of parents."""
    kinematics = kinematics_of(recorded.hand)
    joints = bag["/joint_states"][-1][1]
    assert joints.name == list(kinematics.robot.joint_names)
    parents = {}
    for topic in ("/tf_static", "/tf"):
        for each in bag[topic][-1][1].transforms:
            t, q = each.transform.translation, each.transform.rotation
            parents[each.child_frame_id] = each.header.frame_id, pose([t.x, t.y, t.z], [q.w, q.x, q.y, q.z])
    for board, wanted in zip(recorded.hand.boards, kinematics.sensor_poses(joints.position), strict=True):
        frame = bag[f"/taxel/{board.name}/scan"][0][1].header.frame_id
        found = np.eye(4)
        while frame in parents:
            frame, step = parents[frame]
            found = step @ found
        assert frame == "world"
        assert np.allclose(found, wanted, atol=1e-9)


def test_rosbags_reads_a_contact_cloud_at_the_pressed_taxels(bag, recorded):
    _, cloud = bag["/taxel/contact_cloud"][-1]
    points = cloud.data.view(POINT)
    assert (cloud.width, cloud.header.frame_id) == (len(points), "world")
    felt = bag["/taxel/activations"][-1][1]
    assert points["taxel"].tolist() == felt.taxel.tolist()
    assert len(points) == felt.active_count > 3
    assert set(points["address"].tolist()) == {recorded.hand.board_named("palm").address}
    angles = bag["/joint_states"][-1][1].position
    kinematics = kinematics_of(recorded.hand)
    places = kinematics.taxel_positions(angles)[points["taxel"]]
    normals = kinematics.taxel_normals(angles)[points["taxel"]]
    assert np.allclose(np.stack([points[name] for name in "xyz"], axis=1), places, atol=1e-6)
    assert np.allclose(np.stack([points[f"normal_{name}"] for name in "xyz"], axis=1), normals, atol=1e-6)
    offsets = {field.name: field.offset for field in cloud.fields}
    assert offsets["drop"] == POINT.fields["drop"][1]


def test_activations_are_those_of_the_library(bag, recorded):
    with taxel.open(f"file:{recorded.path}") as skin:
        baseline = skin.take_baseline()
        activation = Activation(baseline.mean)
        wanted = [np.flatnonzero(activation(scan.raw_counts, scan.valid).active).tolist() for scan in skin.scans()]
    felt = [message.taxel.tolist() for _, message in bag["/taxel/activations"]]
    assert felt == wanted[: len(felt)]
    assert len(wanted) - len(felt) <= 1
    (_, told), *more = bag["/taxel/baseline"]
    assert not more
    assert np.array_equal(told.mean, baseline.mean)


def test_diagnostics_name_the_hub_and_every_board(bag, recorded):
    statuses = bag["/diagnostics"][-1][1].status
    assert [status.name for status in statuses] == [
        f"taxel: {n}" for n in ("hub", *(b.name for b in recorded.hand.boards))
    ]
    assert {status.level for status in statuses} == {0}
    values = {pair.key: pair.value for pair in statuses[1].values}
    assert int(values["received"]) > 100


def test_log_times_go_on_with_the_stamps(bag):
    for topic in ("/taxel/palm/scan", "/tf", "/taxel/contact_cloud"):
        for time_ns, message in bag[topic]:
            header = message.transforms[0].header if topic == "/tf" else message.header
            assert abs(seconds(header.stamp) - time_ns * 1e-9) < 1e-6


def test_opening_an_mcap_file_gives_the_frames_losses_and_hand_of_the_capture(mcap, recorded):
    with taxel.open(f"file:{mcap}") as skin:
        assert differences(list(skin), recorded.frames, *ALL) == []
        assert repr(skin.losses) == repr(recorded.losses)
        assert skin.hand == recorded.hand


def test_a_bag_of_the_topics_alone_is_opened_too(tmp_path, recorded):
    """As `ros2 bag record` makes it: no bytes, no header, stamps instead of the stream's clock."""
    path = tmp_path / "bag.mcap"
    link, hand = open_source(f"file:{recorded.path}")
    with Skin(link, hand) as skin, McapFile(path, {}) as file:
        topics = SkinTopics(hand, skin.hub, epoch_offset_ns=1_800_000_000 * 10**9)
        for frame in list(skin)[:600]:
            for message in topics.take(frame):
                file.publish(message)
    frames, losses = frames_in(path)
    assert (
        differences(frames, recorded.frames[:600], "address", "cycle", "sequence", "board_time_us", "raw_counts") == []
    )
    late = [a.time_s - 1.8e9 - b.time_s for a, b in zip(frames, recorded.frames, strict=False)]
    assert max(map(abs, late)) < 2e-6
    assert sum(board.missing for board in losses.boards.values()) == 0


KILLED = """
import sys, time
from taxel.recorder import open_recorded
with open_recorded("emulator:?speed=max&duration_s=4", sys.argv[1], "flat8") as skin:
    for count, frame in enumerate(skin):
        if count == 300:
            time.sleep(0.6)  # a chunk is due
        if count == 310:
            print("written", flush=True)
            time.sleep(60.0)
"""


def test_what_was_written_before_a_kill_is_readable(tmp_path):
    path = tmp_path / "killed.mcap"
    with subprocess.Popen([sys.executable, "-c", KILLED, path], stdout=subprocess.PIPE) as process:
        try:
            assert process.stdout.readline() == b"written\n"
        finally:
            process.send_signal(signal.SIGKILL)
    frames = []
    with taxel.open(f"file:{path}") as skin:
        assert skin.hand.name == "flat8"
        with pytest.raises(CaptureError, match="everything before it was read"):
            keep(skin, frames)
    assert len(frames) >= 300
    with pytest.raises(CaptureError, match="cut short"):
        convert(path, tmp_path / "mended.mcap")
    assert differences(frames_in(tmp_path / "mended.mcap")[0], frames, *ALL) == []


def keep(skin, frames):
    """Append every frame; what ends the skin's frames leaves those before it kept."""
    for frame in skin:
        frames.append(frame)


def test_a_file_cut_anywhere_gives_what_stands_before(tmp_path, mcap, recorded):
    data = mcap.read_bytes()
    cut = tmp_path / "cut.mcap"
    counts = []
    for size in (len(data) - 60, len(data) // 2, len(data) // 3, 60_000):
        cut.write_bytes(data[:size])
        got = []
        with taxel.open(f"file:{cut}") as skin, pytest.raises(CaptureError) as caught:
            keep(skin, got)
        assert "\n" not in str(caught.value)
        assert differences(got, recorded.frames[: len(got)], *ALL) == []
        counts.append(len(got))
    assert counts[0] == len(recorded.frames)
    assert counts == sorted(counts, reverse=True)


@pytest.mark.parametrize("seed", range(8))
def test_flipped_bytes_end_in_one_line_or_in_frames(tmp_path, mcap, seed):
    generator = np.random.default_rng(seed)
    data = bytearray(mcap.read_bytes()[:150_000])
    for at in generator.integers(8, len(data), 20):
        data[at] ^= int(generator.integers(1, 256))
    path = tmp_path / "flipped.mcap"
    path.write_bytes(data)
    with pytest.raises(taxel.TaxelError) as caught, taxel.open(f"file:{path}") as skin:
        keep(skin, [])
    assert "\n" not in str(caught.value), f"seed {seed}"


def test_an_mcap_file_of_others_is_refused_with_one_line(tmp_path):
    path = tmp_path / "other.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + b"\x0f" + (4).to_bytes(8, "little") + bytes(4))
    with pytest.raises(CaptureError, match="cut short"):
        taxel.open(f"file:{path}")


def test_a_file_that_exists_is_kept_and_an_unreachable_hub_leaves_none(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(b"mine")
    with pytest.raises(CaptureError, match="exists already"):
        open_recorded("emulator:?speed=max", path)
    assert path.read_bytes() == b"mine"
    with pytest.raises(taxel.TaxelError):
        open_recorded("serial:///dev/ttyNONE", tmp_path / "b.mcap")
    assert not Path(tmp_path / "b.mcap").exists()


def test_a_chunk_that_claims_less_than_it_unpacks_to_takes_no_memory(tmp_path):
    """A compressed frame of a gigabyte of zeros, in a chunk that says it has a thousand bytes."""
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
        assert tracemalloc.get_traced_memory()[1] < 1 << 24
    finally:
        tracemalloc.stop()
