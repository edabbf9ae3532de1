"""Faults of an emulated original hub and its boards, as the loss counters and the states of the boards show them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import taxel
from taxel.hand import load_hand
from taxel.hand.indentation import Indentation, compute_indentation_forces
from taxel.hand.original_firmware import THESIS, OriginalFirmware
from taxel.hand.world import format_world, make_original_settings
from taxel.link import EmulatorLink, write_stimulus
from taxel.original_hub import OriginalLink
from taxel.signal import Activation
from taxel.skin import Skin
from taxel_protocol.names import BoardState
from taxel_protocol.original import FORMATS

HAND = load_hand("original")


def open_faulty(faults: list[str], firmware: OriginalFirmware = THESIS, duration_s: float = 12.0) -> Skin:
    """Open an emulated original hand in virtual time. faults: lines "SECONDS FAULT ARGUMENT" of the world file."""
    world = format_world(HAND, make_original_settings(firmware, faults=faults))
    source = EmulatorLink(world, fast=True, duration_s=duration_s, baud=115200.0)
    return Skin(OriginalLink(source, HAND, FORMATS["original"]), HAND)


def test_unplugged_board_is_missing_until_it_returns_and_nothing_else_is_lost() -> None:
    with open_faulty(["3 unplug 0x09", "6 plug 0x09"]) as skin:
        frames = list(skin)
        cycles = [frame.cycle for frame in frames if frame.address == 0x09]
        missing = {address: count.missing for address, count in skin.losses.boards.items() if count.missing}
        assert missing == {0x09: cycles[-1] - cycles[0] + 1 - len(cycles)}
        assert missing[0x09] == pytest.approx(3.0 * 5.2, abs=3)  # 3 s at 5.2 poll cycles per second
        assert skin.losses.lost_on_wire == 0


def test_board_that_the_hub_gives_up_is_reported_as_absent_and_not_as_missing() -> None:
    """The branches of the original hub give up a board after 10 failed tries, until the hub is reset."""
    with open_faulty(["3 unplug 0x09", "4 plug 0x09"], replace(THESIS, variant="branch")) as skin:
        frames = list(skin)
        assert max(frame.time_s for frame in frames if frame.address == 0x09) < 3.2
        assert skin.hub.board_status[0x09]["state"] == BoardState.ABSENT
        assert sum(count.missing for count in skin.losses.boards.values()) == 0
        assert len({frame.cycle for frame in frames if frame.address == 0x08}) == frames[-1].cycle + 1


def test_restart_of_the_hub_is_counted_and_the_stream_continues() -> None:
    with open_faulty(["5 hub_restart 0"]) as skin:
        frames = list(skin)
        assert skin.losses.restarts == 1
        assert frames[-1].hub_time_us < 8_000_000  # the hub's clock began again at 5 s of the 12 s
        assert skin.hub.has_handshake
        assert len(frames) == skin.link.decoder.messages  # type: ignore[attr-defined]


def test_contact_activates_loaded_taxels_only(tmp_path: Path) -> None:
    contact = Indentation("palm", tx=6.0, rx=5.0, force_n=8.0, start_s=8.0)
    times, forces = compute_indentation_forces(HAND, (contact,))
    path = tmp_path / "contact.stm"
    write_stimulus(path, times, forces)
    with taxel.open(f"emulator:?protocol=original&speed=max&duration_s=11&stimulus={path}", hand="original") as skin:
        activation = Activation(skin.take_baseline(20).mean)
        active = np.zeros(HAND.n_taxels, dtype=bool)
        for scan in skin.scans():
            active |= activation(scan.raw_counts, scan.valid).active
    loaded = forces.max(axis=0) > 0.0
    assert active.any()
    assert not (active & ~loaded).any()
