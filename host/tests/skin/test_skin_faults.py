"""Faults of boards, bus and host: no frame contains a wrong count, and every lost frame is counted.

The boards measure known counts, which increase by STEP_COUNTS every STEP_S of emulated time.
"""

import math

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link import EmulatorLink, write_stimulus
from taxel.skin import Skin
from taxel_protocol import BoardFault

STEP_S = 0.25
STEP_COUNTS = 100
DURATION_S = 9.0
MAX_TRUNCATED_FRAMES = 3
"""Frames that the hub has counted but that the end of the emulation truncates or leaves in the transmit buffer."""
LARGEST_FRAME_BYTES = 600
POLL_OUTCOMES = ("forwarded", "repeated", "nacks", "timeouts", "crc_errors", "bus_errors", "dropped")

SCENES = {  # name: faults of the emulated world (time in s, kind, address of the board, arguments)
    "undisturbed": (),
    "unplugged": ("3.0 unplug 0x22",),
    "unplugged and plugged": ("3.0 unplug 0x22", "4.0 plug 0x22"),
    "loose contact": tuple(f"{3 + 0.05 * i:.2f} {'plug' if i % 2 else 'unplug'} 0x22" for i in range(20)),
    "one bit wrong": ("2 corrupt 0x23 1",),
    "many bits wrong": ("2 corrupt 0x23 3000",),
    "address not acknowledged once": ("2 nack 0x24 1",),
    "address not acknowledged often": ("2 nack 0x24 60",),
    "data line held briefly": ("2 hold_sda 0x25 5",),
    "data line held long": ("2 hold_sda 0x25 2000",),
    "clock stretched": ("2 stretch 0x26 9000",),
    "clock stretched briefly": ("2 stretch 0x26 900",),
    "board restarted": ("2 restart 0x27",),
    "host does not read": ("5 mute_host 0 1", "6 mute_host 0 0"),
    "everything": (
        "2 corrupt 0x23 1", "2 nack 0x24 1", "2 hold_sda 0x25 5", "2 stretch 0x26 9000", "2 restart 0x27",
        "3.0 unplug 0x22", "3.5 corrupt 0x2A 400", "4.0 plug 0x22", "4.5 unplug 0x20", "4.6 restart 0x21",
        "5 mute_host 0 1", "5.5 plug 0x20", "6 mute_host 0 0",
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def stimulus(tmp_path_factory, allegro, known_counts):
    """Path of a stimulus: in its step k, every taxel has its known count plus k x STEP_COUNTS."""
    steps = np.arange(round(DURATION_S / STEP_S) + 1)
    path = tmp_path_factory.mktemp("stimulus") / "steps.stm"
    write_stimulus(path, steps * STEP_S, known_counts(allegro) + STEP_COUNTS * steps[:, None], "counts")
    return path


def read_steps(frame, first_counts):
    """Return the step of the stimulus at which each taxel of a frame was measured.

    first_counts: counts of the board's taxels in step 0. Fails for a count that the stimulus never had.
    """
    counts = frame.raw_counts.astype(int) - first_counts
    assert not (counts % STEP_COUNTS).any(), f"a count of board 0x{frame.address:02X} was never measured"
    return counts // STEP_COUNTS


def check_statuses(hub):
    """Check that every poll of every board has exactly one outcome; one poll may be unfinished."""
    for address, status in hub.board_status.items():
        outcomes = sum(status[name] for name in POLL_OUTCOMES)
        assert 0 <= status["polls"] - outcomes <= 1, f"board 0x{address:02X}: {status}"


def run_scene(hand, faults, stimulus, first_counts, duration_s=DURATION_S):
    """Run a world with faults; check the counts and the time stamp of each frame on arrival.

    first_counts: counts of all taxels in step 0. Return (skin, frames, statistics of the emulator).
    """
    link = EmulatorLink(format_world(hand, WorldSettings(faults=faults)), stimulus, fast=True, duration_s=duration_s)
    skin = Skin(link, hand)
    frames = []
    for frame in skin:
        steps = read_steps(frame, first_counts[hand.get_slice(frame.address)].astype(int))
        assert not (np.diff(steps) < 0).any()  # taxels are measured in order, so that a step can begin within a frame
        assert steps[-1] - steps[0] <= 1
        age_s = frame.hub_time_us * 1e-6 - steps[0] * STEP_S
        assert -1e-3 < age_s < STEP_S + 0.2, (
            "the counts of a board were measured at another time than the time stamp of the frame"
        )
        frames.append(frame)
        if len(frames) % 400 == 0:
            check_statuses(skin.hub)
    statistics = link.statistics()
    check_statuses(skin.hub)
    skin.close()
    return skin, frames, statistics


@pytest.mark.parametrize("scene", SCENES)
def test_every_scene_delivers_correct_counts_and_loses_no_frame_on_the_uart(allegro, known_counts, stimulus, scene):
    """`run_scene` compares the counts of every frame with the known counts."""
    skin, frames, statistics = run_scene(allegro, SCENES[scene], stimulus, known_counts(allegro))
    losses = skin.losses
    assert losses.lost_on_wire == 0
    assert losses.restarts == 0
    assert 0 <= statistics["frames_sent"] - losses.frames_received <= MAX_TRUNCATED_FRAMES
    assert statistics["uart_bytes_sent"] == statistics["bytes_delivered"] == skin.bytes_received
    assert skin.bytes_discarded < LARGEST_FRAME_BYTES  # the frame that the end of the emulation truncated
    assert sum(count.received for count in losses.boards.values()) == len(frames)
    assert all(count.damaged == 0 for count in losses.boards.values())
    assert skin.hub.status is not None
    assert skin.hub.status["frames_dropped"] <= statistics["frames_dropped"]
    # All scenes act on boards with addresses from 0x20 to 0x2A only.
    undisturbed_boards = {board.address for board in allegro.boards} - set(range(0x20, 0x2B))
    assert {frame.address for frame in frames if frame.hub_time_us > (DURATION_S - 1) * 1e6} >= undisturbed_boards
    if scene != "unplugged":  # in all other scenes, every board streams again at the end
        assert {frame.address for frame in frames[-100:]} == {board.address for board in allegro.boards}


@pytest.mark.parametrize(
    ("scene", "address", "fault"),
    [
        ("unplugged and plugged", 0x22, BoardFault.NACK),
        ("address not acknowledged often", 0x24, BoardFault.NACK),
        ("many bits wrong", 0x23, BoardFault.CRC),
        ("clock stretched", 0x26, BoardFault.TIMEOUT),
    ],
)
def test_a_fault_is_reported_with_its_board_and_followed_by_its_recovery(
    allegro, known_counts, stimulus, scene, address, fault
):
    skin, _, _ = run_scene(allegro, SCENES[scene], stimulus, known_counts(allegro), 6.0)
    reports = [report["fault"] for report in skin.hub.faults if report["address"] == address]
    assert fault in reports
    assert BoardFault.RECOVERED in reports[reports.index(fault) :]
    assert {report["address"] for report in skin.hub.faults} == {address}
    missing_of_other_boards = {a: count.missing for a, count in skin.losses.boards.items() if a != address}
    assert set(missing_of_other_boards.values()) <= {0, 1}


def test_a_board_that_restarts_between_two_polls_is_reported(allegro, known_counts, stimulus):
    skin, _, _ = run_scene(allegro, SCENES["board restarted"], stimulus, known_counts(allegro), 6.0)
    assert BoardFault.RESTARTED in [report["fault"] for report in skin.hub.faults if report["address"] == 0x27]


def test_a_single_bit_error_is_corrected_by_one_repeated_read(allegro, known_counts, stimulus):
    skin, _, _ = run_scene(allegro, SCENES["one bit wrong"], stimulus, known_counts(allegro), 4.5)
    assert skin.hub.board_status[0x23]["retries"] == 1
    assert skin.losses.boards[0x23].missing == 0


def test_an_unplugged_board_loses_only_its_own_frames(allegro, known_counts, stimulus):
    skin, frames, _ = run_scene(allegro, SCENES["unplugged and plugged"], stimulus, known_counts(allegro))
    missing = {address: count.missing for address, count in skin.losses.boards.items()}
    assert missing.pop(0x22) > 5
    assert set(missing.values()) == {0}
    # The board is unplugged at 3 s and plugged in again at 4 s.
    times_of_board_s = [frame.hub_time_us * 1e-6 for frame in frames if frame.address == 0x22]
    assert [time_s for time_s in times_of_board_s if 3.05 < time_s < 4.0] == []
    assert min(time_s for time_s in times_of_board_s if time_s > 4.0) < 4.5


def test_a_host_that_does_not_read_for_a_second_has_a_gap_in_its_frames(allegro, known_counts, stimulus):
    _, frames, statistics = run_scene(allegro, SCENES["host does not read"], stimulus, known_counts(allegro))
    undisturbed = run_scene(allegro, (), stimulus, known_counts(allegro))[2]
    assert statistics["frames_sent"] < undisturbed["frames_sent"]
    times_s = np.array([frame.hub_time_us * 1e-6 for frame in frames])
    longest_gap_s = np.diff(times_s).max()
    assert 0.5 < longest_gap_s < 1.2
    assert times_s.max() > DURATION_S - 0.2


@pytest.mark.parametrize("name", ["allegro", "flat8"])
def test_a_force_lowers_the_counts_of_the_loaded_taxels_only(tmp_path, name):
    hand = load_hand(name)
    is_loaded = np.zeros(hand.n_taxels, dtype=bool)
    is_loaded[[0, 5, hand.n_taxels // 2, hand.n_taxels - 1]] = True
    force = np.where(is_loaded, 5.0, 0.0)
    write_stimulus(tmp_path / "a.stm", [0.0, 2.0, 2.2, 6.0], [force * 0, force * 0, force, force])
    link = EmulatorLink(format_world(hand, WorldSettings()), tmp_path / "a.stm", fast=True, duration_s=4.0)
    with Skin(link, hand) as skin:
        scans = [scan for scan in skin.scans() if scan.valid.all()]
    unloaded_counts = np.array([scan.raw_counts for scan in scans if scan.time_s < 1.9], dtype=float)
    loaded_counts = np.array([scan.raw_counts for scan in scans if scan.time_s > 2.4], dtype=float)
    assert min(len(unloaded_counts), len(loaded_counts)) >= 20
    change = loaded_counts.mean(0) - unloaded_counts.mean(0)
    standard_error = WorldSettings().noise_counts * math.sqrt(1 / len(unloaded_counts) + 1 / len(loaded_counts))
    assert (change[is_loaded] < -50.0).all()
    assert (np.abs(change[~is_loaded]) < 6.0 * standard_error).all()
