"""Grasps and lines on which the steps of the treatment act, and bounds on far points from printed statistics."""

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
    """Cloud of two grasps with the given (grasp, taxel) pairs."""
    grasp, taxel = np.array(points, np.int64).T
    cloud = ContactCloud.from_points(build_board().position[taxel], np.full(len(taxel), 200.0))
    return replace(cloud, grasp=grasp, taxel=taxel, grasps=("a", "b"), grasp_approach=np.zeros(2, np.int64))


def number(tx, rx):
    return tx * SIDE + rx


def test_prevalence_is_the_share_of_changed_grasps():
    raw = make_cloud([(0, 1), (0, 2), (1, 3)])
    filtered = make_cloud([(0, 1), (1, 3)])
    spread = make_cloud([(0, 1), (0, 2), (0, 9), (1, 3), (1, 4)])
    clouds = {REAL: raw, FILTERED: filtered, CLEANED: filtered, SIM: raw, SPREAD: spread}
    assert compute_prevalence(clouds) == {FILTERED: 0.5, CLEANED: 0.0, SPREAD: 1.0}


@pytest.mark.parametrize(("isolated", "removed"), [(number(1, 7), 1.0), (number(6, 7), 0.0)])
def test_removed_point_on_a_line_of_a_contact(isolated, removed):
    """The contact is at TX 1 and RX 1: 14 of the 62 inactive taxels, or 13 of them, share one of its lines."""
    contact = number(1, 1)
    filtered, cleaned = make_cloud([(0, contact), (0, isolated)]), make_cloud([(0, contact)])
    shares = compute_line_shares(filtered, cleaned, build_board(), np.ones(TAXELS, bool))
    assert shares.removed == removed
    assert shares.inactive == pytest.approx((14 - removed) / 62)


def test_removed_point_without_a_contact_on_its_board_has_no_share():
    filtered, cleaned = make_cloud([(0, 5), (1, 9)]), make_cloud([(0, 5)])
    shares = compute_line_shares(filtered, cleaned, build_board(), np.ones(TAXELS, bool))
    assert shares.ratio is None


def test_number_of_far_points_is_bounded_by_mean_and_standard_deviation():
    path = Path(__file__).parents[3] / "tools/thesis/distance_tails.py"
    spec = importlib.util.spec_from_file_location("distance_tails", path)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    distances = np.concatenate([np.full(990, 0.003), np.full(10, 0.02)])
    stats = DistanceStats.from_distances(distances)
    assert 10.0 <= tool.bound_points_beyond(stats, 0.0199) < 10.2
    assert tool.bound_points_beyond(stats, 0.02) == 0.0
    kept = DistanceStats.from_distances(distances[:990])
    assert tool.describe_removed(stats, kept) == "10 points (1.0 %), mean 20.0 mm"
