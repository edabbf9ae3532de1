"""Forces that a program applies to the emulated skin while the skin streams."""

import itertools

import numpy as np

import taxel
from taxel.link import EmulatorLink


def test_forces_applied_during_streaming_activate_and_release_their_taxels() -> None:
    with taxel.open("emulator:?speed=max&live=1&noise_counts=0", "flat8") as skin:
        assert isinstance(skin.link, EmulatorLink)
        activation = taxel.Activation(skin.take_baseline().mean)
        forces = np.zeros(skin.hand.n_taxels)
        forces[[3, 40]] = 5.0
        skin.link.apply(forces)
        # In fast mode, many scans from before the force are still buffered.
        loaded_scan = next(scan for scan in skin.scans() if activation(scan.raw_counts, scan.valid).active.sum() == 2)
        assert np.flatnonzero(activation(loaded_scan.raw_counts).active).tolist() == [3, 40]
        skin.link.apply(np.zeros(skin.hand.n_taxels))
        assert any(not activation(scan.raw_counts).active.any() for scan in itertools.islice(skin.scans(), 100_000))
