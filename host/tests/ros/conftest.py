"""A recording of the emulated hand at rest and then pressed."""

from __future__ import annotations

import numpy as np
import pytest

from host.tests.recordings import Recorded, frames_in
from taxel.hand import load_hand
from taxel.hand.press import Press, press_forces
from taxel.link import write_stimulus
from taxel.recorder import open_recorded

SECONDS = 7.4
"""Virtual: 100 scans for the baseline, and some of a press."""


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """A capture of the Allegro hand, whose palm is pressed once the baseline is complete; its joints are bent."""
    folder = tmp_path_factory.mktemp("recorded")
    hand = load_hand("allegro")
    stimulus = folder / "press.stm"
    write_stimulus(stimulus, *press_forces(hand, (Press("palm", 6.0, 5.0, 20.0, 6.5, hold_s=2.0),)))
    path = folder / "a.bin"
    bent = np.linspace(-0.3, 0.3, 22)
    with open_recorded(f"emulator:?speed=max&stimulus={stimulus}", path, hand, joint_position=bent) as skin:
        for frame in skin:
            if frame.time_s > SECONDS:
                break
    return Recorded(path, *frames_in(path), hand)
