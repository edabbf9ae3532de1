"""Compact frames from the hub to the host: the same counts as uncompressed frames at a higher rate."""

import itertools

import numpy as np
import pytest

import taxel
from taxel.errors import TaxelError

SCAN_COUNT = 40


def record_scans(url, hand):
    """Read a skin; return `SCAN_COUNT` scans after the first 10, and the losses."""
    with taxel.open(url, hand) as skin:
        scans = list(itertools.islice(skin.scans(), 10, 10 + SCAN_COUNT))
        return scans, skin.losses


def compute_rate_hz(scans):
    """Return the mean number of scans per second."""
    return (len(scans) - 1) / (scans[-1].time_s - scans[0].time_s)


def test_compact_frames_triple_the_scan_rate_and_keep_the_mean_counts(allegro):
    url = "emulator:?speed=max&seed=4&noise_counts=1.5"
    uncompressed, _ = record_scans(url, allegro)
    compact, losses = record_scans(url + "&frames=compact", allegro)
    assert compute_rate_hz(uncompressed) < 20.0
    assert compute_rate_hz(compact[20:]) > 55.0
    valid = np.array([scan.valid for scan in compact])
    # The largest boards scan slowest. A poll before the end of their next scan gives no frame, so they are invalid.
    assert valid.mean(axis=0).min() > 0.7
    assert all(count.missing == 0 for count in losses.boards.values())
    means = []
    for scans in (uncompressed, compact):
        counts = np.array([scan.raw_counts for scan in scans])
        valid = np.array([scan.valid for scan in scans])
        means.append((counts * valid).sum(axis=0) / valid.sum(axis=0))
    assert np.abs(means[0] - means[1]).max() < 3.0
    assert losses.undecoded_frames == {}
    assert losses.lost_on_wire == 0


def test_an_unknown_frame_format_gives_one_error_line():
    with pytest.raises(TaxelError, match="option 'frames' must be plain or compact, found 'small'"):
        taxel.open("emulator:?frames=small&speed=max")


def test_a_hub_of_protocol_version_1_is_refused_for_compact_frames(fake_hub):
    hub = fake_hub()
    with pytest.raises(TaxelError, match="compact frames need protocol version 2, the agreed version is 1"):
        taxel.open(hub.url, "flat8", frames="compact")
