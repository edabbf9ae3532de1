"""Grasps that a treatment step changes, lines of removed points, and bounds on far points from printed statistics."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from host.tests.thesis.conftest import SIDE, TAXELS, build_board
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance import DistanceStats
from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM, SPREAD
from taxel.thesis.prevalence import compute_line_shares, compute_prevalence


def make_cloud(points):
    """Make a cloud of two grasps from pairs of grasp (0 or 1) and active taxel."""
    grasp, taxel = np.array(points, np.int64).T
    cloud = ContactCloud.from_points(build_board().position[taxel], np.full(len(taxel), 200.0))
    return replace(cloud, grasp=grasp, taxel=taxel, grasps=("a", "b"), grasp_approach=np.zeros(2, np.int64))


def get_taxel(tx, rx):
    return tx * SIDE + rx


def test_prevalence_of_a_step_is_the_share_of_grasps_whose_number_of_points_it_changes():
    """Pairs are (grasp, taxel). The filter removes a point of one of two grasps; propagation adds points to both."""
    raw = make_cloud([(0, 1), (0, 2), (1, 3)])
    filtered = make_cloud([(0, 1), (1, 3)])
    spread = make_cloud([(0, 1), (0, 2), (0, 9), (1, 3), (1, 4)])
    clouds = {REAL: raw, FILTERED: filtered, CLEANED: filtered, SIM: raw, SPREAD: spread}
    assert compute_prevalence(clouds) == {FILTERED: 0.5, CLEANED: 0.0, SPREAD: 1.0}


@pytest.mark.parametrize(("isolated", "removed"), [(get_taxel(1, 7), 1.0), (get_taxel(6, 7), 0.0)])
def test_line_shares_state_whether_removed_point_and_inactive_taxels_are_on_a_line_of_the_contact(isolated, removed):
    """The contact is at TX 1 and RX 1, whose lines have 14 other taxels; the removed point may be one of them.

    The other 62 of the 64 taxels are inactive.
    """
    contact = get_taxel(1, 1)
    filtered, cleaned = make_cloud([(0, contact), (0, isolated)]), make_cloud([(0, contact)])
    shares = compute_line_shares(filtered, cleaned, build_board(), np.ones(TAXELS, bool))
    assert shares.removed == removed
    assert shares.inactive == pytest.approx((14 - removed) / 62)


def test_ratio_of_line_shares_is_none_if_the_removed_point_s_grasp_has_no_kept_point():
    filtered, cleaned = make_cloud([(0, 5), (1, 9)]), make_cloud([(0, 5)])
    shares = compute_line_shares(filtered, cleaned, build_board(), np.ones(TAXELS, bool))
    assert shares.ratio is None


@pytest.fixture
def tails_tool():
    """The module `tools/thesis/distance_tails.py`."""
    path = Path(__file__).parents[3] / "tools/thesis/distance_tails.py"
    spec = importlib.util.spec_from_file_location("distance_tails", path)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    return tool


DISTANCES_M = np.concatenate([np.full(990, 0.003), np.full(10, 0.02)])
"""990 points at 3 mm and 10 points at 20 mm."""


def test_number_of_far_points_is_bounded_by_the_statistics_of_the_distances(tails_tool):
    stats = DistanceStats.from_distances(DISTANCES_M)
    assert 10.0 <= tails_tool.bound_points_beyond(stats, 0.0199) < 10.2
    assert tails_tool.bound_points_beyond(stats, 0.02) == 0.0  # the largest distance


def test_number_and_mean_distance_of_removed_points_follow_from_the_statistics_before_and_after(tails_tool):
    before, after = (DistanceStats.from_distances(distances) for distances in (DISTANCES_M, DISTANCES_M[:990]))
    assert tails_tool.describe_removed(before, after) == "10 points (1.0 %), mean 20.0 mm"
