"""Recordings of emulated hands at rest and then pressed: the Allegro hand, and a small one with four boards."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from host.tests.recordings import Recorded, frames_in
from taxel.hand import load_hand
from taxel.hand.press import Press, press_forces
from taxel.link import write_stimulus
from taxel.recorder import open_recorded


def record_pressed(folder: Path, name: str, press: Press, joints: np.ndarray) -> Recorded:
    """A capture of a hand that is pressed once its baseline is complete."""
    hand = load_hand(name)
    stimulus = folder / "press.stm"
    write_stimulus(stimulus, *press_forces(hand, (press,)))
    path = folder / "a.bin"
    url = f"emulator:?speed=max&duration_s={press.start_s + press.hold_s}&stimulus={stimulus}"
    with open_recorded(url, path, hand, joint_position=joints) as skin:
        for _ in skin:
            pass
    return Recorded(path, *frames_in(path), hand)


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """The Allegro hand, its joints bent, its palm pressed."""
    press = Press("palm", 6.0, 5.0, 20.0, start_s=6.5, hold_s=1.0)
    return record_pressed(tmp_path_factory.mktemp("recorded"), "allegro", press, np.linspace(-0.3, 0.3, 22))


@pytest.fixture(scope="session")
def small(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """The rig's four boards, the plate that carries them tilted."""
    press = Press("slab", 4.0, 3.0, 20.0, start_s=2.4, hold_s=0.5)
    return record_pressed(tmp_path_factory.mktemp("small"), "rig4", press, np.array([0.3]))
