"""Recordings of two emulated hands, first without contact and then with one indentation."""

from pathlib import Path

import numpy as np
import pytest

from host.tests.recordings import RecordedSkin, read_frames
from taxel.hand import load_hand
from taxel.hand.indentation import Indentation, compute_indentation_forces
from taxel.link import write_stimulus
from taxel.skin.recorder import open_recorded


def record_indented_hand(folder: Path, name: str, indentation: Indentation, joints: np.ndarray) -> RecordedSkin:
    """Record a capture of an emulated hand that is indented after its baseline is complete.

    joints: joint angles in the header of the capture, radians.
    """
    hand = load_hand(name)
    stimulus = folder / "indentation.stm"
    write_stimulus(stimulus, *compute_indentation_forces(hand, (indentation,)))
    path = folder / "a.bin"
    url = f"emulator:?speed=max&duration_s={indentation.start_s + indentation.hold_s}&stimulus={stimulus}"
    with open_recorded(url, path, hand, joint_position=joints) as skin:
        for _ in skin:
            pass
    return RecordedSkin(path, *read_frames(path), hand)


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> RecordedSkin:
    """The Allegro hand with bent joints; the palm is indented."""
    indentation = Indentation("palm", 3.0, 5.0, 20.0, start_s=6.5, hold_s=1.0)
    return record_indented_hand(
        tmp_path_factory.mktemp("recorded"), "original", indentation, np.linspace(-0.3, 0.3, 22)
    )


@pytest.fixture(scope="session")
def recorded_rig(tmp_path_factory: pytest.TempPathFactory) -> RecordedSkin:
    """The test rig with four boards on a tilted plate; one board is indented."""
    indentation = Indentation("slab", 4.0, 3.0, 20.0, start_s=2.4, hold_s=0.5)
    return record_indented_hand(tmp_path_factory.mktemp("recorded_rig"), "rig4", indentation, np.array([0.3]))
