"""Fusion of repeats: a taxel gives one point for each approach."""

import numpy as np
import pytest

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.fusion import fuse_repeats

POINTS = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.002], [0.1, 0.0, 0.0], [0.0, 0.0, 0.004], [0.2, 0.0, 0.0]])


def build_cloud() -> ContactCloud:
    """Build a cloud of three repeats of "side" (grasps a, b, d) and one grasp of "top" (grasp c).

    Taxel 7 is active in two repeats of "side" and in "top", taxel 8 in one repeat of "side", taxel 9 in "top".
    """
    return ContactCloud(
        "cloud",
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


def test_fused_positions_and_counts_are_means_over_the_repeats_with_an_active_taxel():
    fused = fuse_repeats(build_cloud())
    # Only taxel 7 of approach 0 is active in two repeats, with signals of 200 and 300 counts and z = 0 and 2 mm.
    assert list(zip(fused.approach.tolist(), fused.taxel.tolist(), strict=True)) == [(0, 7), (0, 8), (1, 7), (1, 9)]
    assert fused.points.tolist() == [[0.0, 0.0, 0.001], [0.1, 0.0, 0.0], [0.0, 0.0, 0.004], [0.2, 0.0, 0.0]]
    assert fused.counts.tolist() == [250.0, 160.0, 400.0, 500.0]


def test_contact_in_less_than_the_minimum_share_of_repeats_is_left_out():
    assert fuse_repeats(build_cloud(), min_share=0.5).taxel.tolist() == [7, 7, 9]  # taxel 7: two of three repeats
    assert fuse_repeats(build_cloud(), min_share=0.7).taxel.tolist() == [7, 9]  # of "top", which has one repeat
    assert fuse_repeats(build_cloud(), min_share=1.0).taxel.tolist() == [7, 9]


def test_fusion_changes_neither_inactive_taxels_nor_grasps():
    fused = fuse_repeats(build_cloud())
    assert fused.grasps == ("a", "b", "c", "d")
    assert (fused.inactive_points == POINTS[:2]).all()


def test_fusing_a_fused_cloud_does_not_change_it(surface_cloud):
    once = fuse_repeats(surface_cloud("cone"))
    twice = fuse_repeats(once)
    assert len(once) < 400  # the cloud has 400 points, some of the same taxel and approach
    assert twice.points == pytest.approx(once.points)


def test_fused_empty_cloud_is_empty():
    assert len(fuse_repeats(build_cloud().select(np.zeros(5, bool)))) == 0
