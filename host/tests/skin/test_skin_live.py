"""Forces that a program applies while the emulated skin runs are felt, and let go of."""

import itertools

import numpy as np

import taxel
from taxel.link import EmulatorLink


def test_live_forces_are_felt_and_released() -> None:
    with taxel.open("emulator:?speed=max&live=1&noise_counts=0", "flat8") as skin:
        assert isinstance(skin.link, EmulatorLink)
        activation = taxel.Activation(skin.take_baseline().mean)
        forces = np.zeros(skin.hand.n_taxels)
        forces[[3, 40]] = 5.0
        skin.link.apply(forces)
        # In fast mode many scans from before the press are still on their way.
        pressed = next(s for s in skin.scans() if activation(s.raw_counts, s.valid).active.sum() == 2)
        assert np.flatnonzero(activation(pressed.raw_counts).active).tolist() == [3, 40]
        skin.link.apply(np.zeros(skin.hand.n_taxels))
        assert any(not activation(s.raw_counts).active.any() for s in itertools.islice(skin.scans(), 100_000))
