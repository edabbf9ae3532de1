"""Compact frames through hub, UART and host: the same counts, more often."""

import itertools

import numpy as np
import pytest

import taxel
from taxel.errors import TaxelError

CYCLES = 40


def scans_of(url, hand):
    with taxel.open(url, hand) as skin:
        scans = list(itertools.islice(skin.scans(), 10, 10 + CYCLES))
        return scans, skin.losses


def rate_hz(scans):
    return (len(scans) - 1) / (scans[-1].time_s - scans[0].time_s)


def test_the_hand_comes_three_times_as_often(allegro):
    url = "emulator:?speed=max&seed=4&noise_counts=1.5"
    plain, _ = scans_of(url, allegro)
    compact, losses = scans_of(url + "&frames=compact", allegro)
    assert rate_hz(plain) < 20.0
    assert rate_hz(compact[20:]) > 55.0
    valid = np.array([scan.valid for scan in compact])
    assert valid.mean(axis=0).min() > 0.7  # the largest boards scan more slowly than they are polled
    assert all(count.missing == 0 for count in losses.boards.values())
    mean = []
    for scans in (plain, compact):
        counts, valid = (np.array([scan[i] for scan in scans]) for i in (2, 3))
        mean.append((counts * valid).sum(axis=0) / valid.sum(axis=0))
    assert np.abs(mean[0] - mean[1]).max() < 3.0
    assert losses.undecoded_frames == {}
    assert losses.lost_on_wire == 0


def test_an_unknown_form_is_one_line():
    with pytest.raises(TaxelError, match="option 'frames' must be plain or compact, found 'small'"):
        taxel.open("emulator:?frames=small&speed=max")


def test_a_hub_of_version_1_is_told_apart(fake_hub):
    hub = fake_hub()
    with pytest.raises(TaxelError, match="compact frames need protocol version 2, the agreed version is 1"):
        taxel.open(hub.url, "flat8", frames="compact")
