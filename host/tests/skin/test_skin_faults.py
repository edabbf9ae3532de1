"""Whatever happens to boards, bus and host: no count is ever wrong, and every frame is delivered or accounted for.

In these worlds the boards measure known counts, which change every quarter of a second of the world's time.
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
CUT_AT_THE_END = 3  # frames that the hub has counted, and the end of the emulation cut or left in its buffer
POLL_OUTCOMES = ("forwarded", "repeated", "nacks", "timeouts", "crc_errors", "bus_errors", "dropped")

SCENES = {
    "calm": (),
    "unplugged": ("3.0 unplug 0x22",),
    "unplugged and plugged": ("3.0 unplug 0x22", "4.0 plug 0x22"),
    "loose contact": tuple(f"{3 + 0.05 * i:.2f} {'plug' if i % 2 else 'unplug'} 0x22" for i in range(20)),
    "one bit wrong": ("2 corrupt 0x23 1",),
    "many bits wrong": ("2 corrupt 0x23 3000",),
    "address not acknowledged once": ("2 nack 0x24 1",),
    "address not acknowledged often": ("2 nack 0x24 60",),
    "data line held a little": ("2 hold_sda 0x25 5",),
    "data line held long": ("2 hold_sda 0x25 2000",),
    "clock stretched": ("2 stretch 0x26 9000",),
    "clock stretched a little": ("2 stretch 0x26 900",),
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
    steps = np.arange(round(DURATION_S / STEP_S) + 1)
    path = tmp_path_factory.mktemp("stimulus") / "steps.stm"
    write_stimulus(path, steps * STEP_S, known_counts(allegro) + STEP_COUNTS * steps[:, None], "counts")
    return path


def steps_in(frame, base):
    """Which step of the stimulus each taxel of a frame shows; fails if a count belongs to none."""
    counts = frame.raw_counts.astype(int) - base
    assert not (counts % STEP_COUNTS).any(), f"a count of board 0x{frame.address:02X} was never measured"
    return counts // STEP_COUNTS


def check_statuses(hub):
    """Every poll of every board has had exactly one outcome, except one that may be under way."""
    for address, status in hub.board_status.items():
        outcomes = sum(status[name] for name in POLL_OUTCOMES)
        assert 0 <= status["polls"] - outcomes <= 1, f"board 0x{address:02X}: {status}"


def run(hand, faults, stimulus, known, duration_s=DURATION_S):
    """Check each frame as it comes; (skin, frames, statistics) at the end."""
    link = EmulatorLink(format_world(hand, WorldSettings(faults=faults)), stimulus, fast=True, duration_s=duration_s)
    skin = Skin(link, hand)
    frames = []
    for frame in skin:
        steps = steps_in(frame, known[hand.get_slice(frame.address)].astype(int))
        assert not (np.diff(steps) < 0).any()  # taxels are measured one after another
        assert steps[-1] - steps[0] <= 1
        age_s = frame.hub_time_us * 1e-6 - steps[0] * STEP_S
        assert -1e-3 < age_s < STEP_S + 0.2, "the counts of a board are of another time than the frame says"
        frames.append(frame)
        if len(frames) % 400 == 0:
            check_statuses(skin.hub)
    statistics = link.statistics()
    check_statuses(skin.hub)
    skin.close()
    return skin, frames, statistics


@pytest.mark.parametrize("scene", SCENES)
def test_every_frame_is_right_and_every_frame_is_accounted_for(allegro, known_counts, stimulus, scene):
    skin, frames, statistics = run(allegro, SCENES[scene], stimulus, known_counts(allegro))
    losses = skin.losses
    assert losses.lost_on_wire == 0
    assert losses.restarts == 0
    assert 0 <= statistics["frames_sent"] - losses.frames_received <= CUT_AT_THE_END
    assert statistics["uart_bytes_sent"] == statistics["bytes_delivered"] == skin.bytes_received
    assert skin.bytes_discarded < 600  # the frame that was cut at the end
    assert sum(count.received for count in losses.boards.values()) == len(frames)
    assert all(count.damaged == 0 for count in losses.boards.values())
    assert skin.hub.status is not None
    assert skin.hub.status["frames_dropped"] <= statistics["frames_dropped"]
    untouched = {board.address for board in allegro.boards} - set(range(0x20, 0x2B))
    assert {frame.address for frame in frames if frame.hub_time_us > (DURATION_S - 1) * 1e6} >= untouched
    if scene != "unplugged":  # everybody is back at the end
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
def test_a_fault_is_reported_with_its_board_and_then_its_end(allegro, known_counts, stimulus, scene, address, fault):
    skin, _, _ = run(allegro, SCENES[scene], stimulus, known_counts(allegro), 6.0)
    reports = [report["fault"] for report in skin.hub.faults if report["address"] == address]
    assert fault in reports
    assert BoardFault.RECOVERED in reports[reports.index(fault) :]
    assert {report["address"] for report in skin.hub.faults} == {address}
    others = {a: count.missing for a, count in skin.losses.boards.items() if a != address}
    assert set(others.values()) <= {0, 1}


def test_a_restarted_board_is_reported_even_if_it_is_back_before_its_next_poll(allegro, known_counts, stimulus):
    skin, _, _ = run(allegro, SCENES["board restarted"], stimulus, known_counts(allegro), 6.0)
    assert BoardFault.RESTARTED in [report["fault"] for report in skin.hub.faults if report["address"] == 0x27]


def test_one_wrong_bit_costs_a_repeated_read_and_no_frame(allegro, known_counts, stimulus):
    skin, _, _ = run(allegro, SCENES["one bit wrong"], stimulus, known_counts(allegro), 4.5)
    assert skin.hub.board_status[0x23]["retries"] == 1
    assert skin.losses.boards[0x23].missing == 0


def test_an_unplugged_board_costs_its_own_frames_only(allegro, known_counts, stimulus):
    skin, frames, _ = run(allegro, SCENES["unplugged and plugged"], stimulus, known_counts(allegro))
    missing = {address: count.missing for address, count in skin.losses.boards.items()}
    assert missing.pop(0x22) > 5
    assert set(missing.values()) == {0}
    own = [frame.hub_time_us * 1e-6 for frame in frames if frame.address == 0x22]
    assert [time for time in own if 3.05 < time < 4.0] == []
    assert min(time for time in own if time > 4.0) < 4.5


def test_a_host_that_does_not_read_is_told_by_the_gap(allegro, known_counts, stimulus):
    _, frames, statistics = run(allegro, SCENES["host does not read"], stimulus, known_counts(allegro))
    calm = run(allegro, (), stimulus, known_counts(allegro))[2]
    assert statistics["frames_sent"] < calm["frames_sent"]
    times = np.array([frame.hub_time_us * 1e-6 for frame in frames])
    gap = np.diff(times).max()
    assert 0.5 < gap < 1.2
    assert times.max() > DURATION_S - 0.2


@pytest.mark.parametrize("name", ["allegro", "flat8"])
def test_a_press_lowers_the_counts_of_the_pressed_taxels_only(tmp_path, name):
    hand = load_hand(name)
    pressed = np.zeros(hand.n_taxels, dtype=bool)
    pressed[[0, 5, hand.n_taxels // 2, hand.n_taxels - 1]] = True
    force = np.where(pressed, 5.0, 0.0)
    write_stimulus(tmp_path / "a.stm", [0.0, 2.0, 2.2, 6.0], [force * 0, force * 0, force, force])
    link = EmulatorLink(format_world(hand, WorldSettings()), tmp_path / "a.stm", fast=True, duration_s=4.0)
    with Skin(link, hand) as skin:
        scans = [scan for scan in skin.scans() if scan.valid.all()]
    before = np.array([scan.raw_counts for scan in scans if scan.time_s < 1.9], dtype=float)
    after = np.array([scan.raw_counts for scan in scans if scan.time_s > 2.4], dtype=float)
    assert min(len(before), len(after)) >= 20
    change = after.mean(0) - before.mean(0)
    noise = WorldSettings().noise_counts * math.sqrt(1 / len(before) + 1 / len(after))
    assert (change[pressed] < -50.0).all()
    assert (np.abs(change[~pressed]) < 6.0 * noise).all()
