"""From a dataset to a cloud: the right taxels, at the right places, of the right grasps."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.campaign.point_counts import count_contact_points
from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.errors import CloudError
from taxel.cloud.propagation import Propagation
from taxel.recording import GraspDataset

BOARD, COLUMNS = 30, 5


def of(path, name="cylinder", *arguments, **options):
    with GraspDataset(path) as data:
        return accumulate(data, name, *arguments, **options)


def test_active_taxels_of_all_grasps_in_the_frame_of_the_object(dataset):
    path = dataset(
        {"signals": ((7, 400), (8, 151))},
        {"item": "rectangular_prism", "signals": ((1, 400),)},
        {"approach": "top", "signals": ((7, 200), (BOARD + 12, 300))},
    )
    cloud = of(path)
    assert cloud.taxel.tolist() == [7, 8, 7, BOARD + 12]
    assert cloud.grasp.tolist() == [0, 0, 1, 1]
    assert cloud.grasps == ("0000", "0002")
    assert [cloud.approaches[row] for row in cloud.approach] == ["side_1", "side_1", "top", "top"]
    assert cloud.counts.tolist() == [400.0, 151.0, 200.0, 300.0]
    expected = [[0.005, 0.010, 0.0], [0.005, 0.015, 0.0], [0.005, 0.010, 0.0], [0.110, 0.010, 0.0]]
    assert cloud.points == pytest.approx(np.array(expected), abs=1e-12)


def test_a_taxel_at_the_threshold_is_not_active(dataset):
    path = dataset({"signals": ((0, 150), (1, 151), (2, 190), (3, 191))})
    assert of(path).taxel.tolist() == [1, 2, 3]
    assert of(path, "cylinder", 190.0).taxel.tolist() == [3]


def test_boards_that_the_thesis_left_out_do_not_count(dataset):
    path = dataset({"signals": ((0, 400), (2 * BOARD, 400), (3 * BOARD, 400))})
    cloud = of(path)
    assert cloud.taxel.tolist() == [0]
    assert len(cloud.quiet) == 2 * BOARD - 1
    everything = of(path, taxels=np.ones(4 * BOARD, bool))
    assert everything.taxel.tolist() == [0, 2 * BOARD, 3 * BOARD]


def test_a_board_that_was_not_heard_is_neither_active_nor_quiet(dataset):
    cloud = of(dataset({"signals": ((0, 400), (BOARD, 400)), "silent": (1,)}))
    assert cloud.taxel.tolist() == [0]
    assert len(cloud.quiet) == BOARD - 1


def test_a_grasp_without_a_baseline_is_left_out(dataset):
    cloud = of(dataset({"signals": ((0, 400),), "baseline": False}, {"signals": ((1, 400),)}))
    assert cloud.grasps == ("0001",)
    assert cloud.taxel.tolist() == [1]


def test_as_many_points_as_table_5_2_counts(dataset):
    path = dataset({"signals": ((0, 400), (1, 100))}, {"signals": ((2 * BOARD, 400), (4, 300))})
    assert count_contact_points(path)["cylinder"].points == len(of(path)) == 2


def test_an_object_without_a_grasp_is_an_empty_cloud(dataset):
    cloud = of(dataset({"signals": ((0, 400),)}), "rectangular_prism")
    assert len(cloud) == 0
    assert cloud.points.shape == (0, 3)


def test_an_unknown_object_is_one_line(dataset):
    path = dataset({})
    with pytest.raises(CloudError, match="object: expected one of cylinder, rectangular_prism, found mug; correct"):
        of(path, "mug")


def test_progress_ends_with_all_grasps(dataset):
    told = []
    of(dataset({}, {}, {"item": "rectangular_prism"}), show=lambda *what: told.append(what))
    assert told == [(1, 2), (2, 2)]


def test_propagation_activates_the_four_beside_with_the_strongest_ones_counts(dataset):
    middle = 2 * COLUMNS + 2
    cloud = of(dataset({"signals": ((middle, 400), (middle + 2, 300))}, source="sim"), propagation=Propagation())
    told = dict(zip(cloud.taxel.tolist(), cloud.counts.tolist(), strict=True))
    beside = {middle - 1, middle + 1, middle - COLUMNS, middle + COLUMNS}
    assert set(told) == beside | {middle, middle + 2, middle + 2 - COLUMNS, middle + 2 + COLUMNS}
    assert told[middle - 1] == told[middle + 1] == 400.0
    assert told[middle + 2 + COLUMNS] == 300.0
    assert not set(cloud.taxel) & set(np.flatnonzero(np.isin(np.arange(4 * BOARD), [4 * BOARD - 1])))


def test_propagation_stays_on_its_board_and_reaches_farther_when_asked(dataset):
    path = dataset({"signals": ((BOARD - 1, 400),)}, source="sim")
    near = of(path, propagation=Propagation())
    assert set(near.taxel) == {BOARD - 1, BOARD - 2, BOARD - 1 - COLUMNS}
    wide = of(path, propagation=Propagation(reach_m=0.0075))
    assert set(wide.taxel) == {BOARD - 1, BOARD - 2, BOARD - 1 - COLUMNS, BOARD - 2 - COLUMNS}


def test_only_strong_taxels_propagate_when_asked(dataset):
    path = dataset({"signals": ((7, 200), (22, 400))}, source="sim")
    cloud = of(path, propagation=Propagation(from_counts=300.0))
    assert set(cloud.taxel) == {7, 22, 21, 23, 17, 27}


def test_one_approach_of_a_cloud_keeps_its_silent_taxels(dataset):
    path = dataset({"signals": ((0, 400),)}, {"approach": "top", "signals": ((1, 400), (2, 400))})
    part = of(path).of_approach("top")
    assert part.taxel.tolist() == [1, 2]
    assert len(part.quiet) == 2 * BOARD - 2
    with pytest.raises(CloudError, match="approach: expected one of side_1, top, found under"):
        of(path).of_approach("under")


@pytest.mark.parametrize(
    ("points", "line"),
    [
        (np.array([[0.0, np.nan, 1.0], [0.0, 0.0, 0.0]]), "points: expected finite coordinates, found 1 with NaN"),
        (np.zeros((3, 2)), r"points: expected shape \[N, 3\], found \[3, 2\]"),
    ],
)
def test_a_cloud_refuses_points_that_are_none(points, line):
    with pytest.raises(CloudError, match=line):
        ContactCloud.of_points(points, name="mine")
