"""Fusion of repeats: the same taxel of the same approach becomes one point."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.fusion import fused

POINTS = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.002], [0.1, 0.0, 0.0], [0.0, 0.0, 0.004], [0.2, 0.0, 0.0]])


def cloud() -> ContactCloud:
    """Taxel 7 in both repeats of "side" and in "top", taxel 8 in one repeat of "side"; a third repeat felt nothing."""
    return ContactCloud(
        "mine",
        POINTS,
        np.array([200.0, 300.0, 160.0, 400.0, 500.0]),
        np.array([0, 1, 0, 2, 2]),
        np.array([7, 7, 8, 7, 9]),
        ("a", "b", "c", "d"),
        np.array([0, 0, 1, 0]),
        ("side", "top"),
        POINTS[:2],
        np.array([0, 3]),
    )


def test_places_and_counts_are_means_over_the_repeats():
    told = fused(cloud())
    assert list(zip(told.approach.tolist(), told.taxel.tolist(), strict=True)) == [(0, 7), (0, 8), (1, 7), (1, 9)]
    assert told.points.tolist() == [[0.0, 0.0, 0.001], [0.1, 0.0, 0.0], [0.0, 0.0, 0.004], [0.2, 0.0, 0.0]]
    assert told.counts.tolist() == [250.0, 160.0, 400.0, 500.0]


def test_a_contact_that_too_few_repeats_have_goes():
    assert fused(cloud(), 0.5).taxel.tolist() == [7, 7, 9]  # two of three repeats of "side"
    assert fused(cloud(), 0.7).taxel.tolist() == [7, 9]
    assert fused(cloud(), 1.0).taxel.tolist() == [7, 9]


def test_silent_taxels_and_grasps_stay():
    told = fused(cloud())
    assert told.grasps == ("a", "b", "c", "d")
    assert (told.quiet == POINTS[:2]).all()
    assert told.of_approach("top").taxel.tolist() == [7, 9]


def test_fusing_twice_is_fusing_once(surface_cloud):
    once = fused(surface_cloud("cone"))
    twice = fused(once)
    assert len(once) < 400
    assert twice.points == pytest.approx(once.points)


def test_an_empty_cloud_stays_empty():
    assert len(fused(cloud().take(np.zeros(5, bool)))) == 0
