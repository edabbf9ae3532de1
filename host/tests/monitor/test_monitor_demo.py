"""`taxel monitor demo:`: contacts that move over an emulated hand."""

import re
from contextlib import closing

import numpy as np
import pytest

from host.tests.command_line import run_taxel
from taxel.hand import load_hand
from taxel.monitor.demo_skin import BOARD_S, FORCE_N, MovingContacts, open_demo


@pytest.mark.parametrize("name", ["original", "allegro", "rig4", "flat8"])
def test_contacts_of_limited_force_move_over_the_boards_of_any_hand(name):
    hand = load_hand(name)
    contacts = MovingContacts(hand)
    assert not contacts.compute_forces(-0.1).any()
    touched = np.zeros(hand.n_taxels, dtype=bool)
    loaded_boards = []
    for elapsed_s in np.arange(0.0, 6 * BOARD_S, 0.1):
        forces = contacts.compute_forces(float(elapsed_s))
        assert forces.min() >= 0.0
        assert forces.sum() <= 4 * FORCE_N  # at most one contact on each of 4 fingers
        touched |= forces > 0.0
        loaded_boards.append(frozenset(b.name for b in hand.boards if forces[hand.get_slice(b.address)].any()))
    assert touched.sum() > 10
    assert len(set(loaded_boards) - {frozenset()}) > 1 or len(hand.boards) == 1


def test_a_contact_begins_on_a_fingertip_and_contacts_reach_the_palm():
    hand = load_hand("original")
    contacts = MovingContacts(hand)

    def find_loaded_boards(elapsed_s):
        forces = contacts.compute_forces(elapsed_s)
        return {board.name for board in hand.boards if forces[hand.get_slice(board.address)].any()}

    assert {"fingertip_pinkie", "fingertip_middle", "fingertip_index"} & find_loaded_boards(0.3 * BOARD_S)
    assert "palm" in set().union(*(find_loaded_boards(step * BOARD_S) for step in np.arange(0.0, 4.0, 0.1)))


def test_the_demo_skin_delivers_complete_scans_and_its_thread_ends_with_the_link():
    skin = open_demo("rig4", baseline_frames=2)
    with closing(skin.link), skin:
        frame = next(iter(skin.scans()))
    assert frame.valid.all()
    assert not skin.link._thread.is_alive()


def test_the_monitor_shows_active_taxels_without_hardware(capsys):
    assert run_taxel("monitor", "demo:", "--hand", "rig4", "--baseline-frames", "5", "--seconds", "4") == 0
    assert re.search(r"\b[1-9]\d* active", capsys.readouterr().out)
