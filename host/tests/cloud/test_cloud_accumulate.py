"""Accumulation of a dataset into a cloud: taxels, positions, grasps."""

import numpy as np
import pytest

from taxel.campaign.point_counts import count_contact_points
from taxel.cloud.accumulate import accumulate
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.errors import CloudError
from taxel.cloud.propagation import Propagation
from taxel.recording import GraspDataset

BOARD, COLUMNS = 30, 5
"""Numbers of taxels and of columns of a board in the dataset."""


def accumulate_file(path, name="cylinder", *arguments, **options):
    """Accumulate the cloud of an object from a dataset file."""
    with GraspDataset(path) as data:
        return accumulate(data, name, *arguments, **options)


def test_cloud_has_the_active_taxels_of_all_grasps_in_the_object_frame(dataset):
    """Taxel k of a board lies in row k // 5 and column k % 5 of a 5 mm grid; board 1 begins at x = 0.1 m.

    The second grasp belongs to another object.
    """
    path = dataset(
        {"signals": ((7, 400), (8, 151))},
        {"object_name": "rectangular_prism", "signals": ((1, 400),)},
        {"approach": "top", "signals": ((7, 200), (BOARD + 12, 300))},
    )
    cloud = accumulate_file(path)
    assert cloud.taxel.tolist() == [7, 8, 7, BOARD + 12]
    assert cloud.grasp.tolist() == [0, 0, 1, 1]
    assert cloud.grasps == ("0000", "0002")
    assert [cloud.approaches[row] for row in cloud.approach] == ["side_1", "side_1", "top", "top"]
    assert cloud.counts.tolist() == [400.0, 151.0, 200.0, 300.0]
    expected = [[0.005, 0.010, 0.0], [0.005, 0.015, 0.0], [0.005, 0.010, 0.0], [0.110, 0.010, 0.0]]
    assert cloud.points == pytest.approx(np.array(expected), abs=1e-12)


def test_only_taxels_above_the_threshold_are_active(dataset):
    path = dataset({"signals": ((0, 150), (1, 151), (2, 190), (3, 191))})
    assert accumulate_file(path).taxel.tolist() == [1, 2, 3]
    assert accumulate_file(path, "cylinder", 190.0).taxel.tolist() == [3]


def test_boards_that_the_thesis_does_not_use_are_left_out_by_default(dataset):
    """Of the four boards of the dataset, the thesis does not use the boards 2 and 3."""
    path = dataset({"signals": ((0, 400), (2 * BOARD, 400), (3 * BOARD, 400))})
    cloud = accumulate_file(path)
    assert cloud.taxel.tolist() == [0]
    assert len(cloud.inactive_points) == 2 * BOARD - 1  # one taxel of the boards 0 and 1 is active
    with_all_boards = accumulate_file(path, taxels=np.ones(4 * BOARD, bool))
    assert with_all_boards.taxel.tolist() == [0, 2 * BOARD, 3 * BOARD]


def test_taxels_of_a_board_without_valid_frames_are_neither_active_nor_inactive(dataset):
    cloud = accumulate_file(dataset({"signals": ((0, 400), (BOARD, 400)), "missing_boards": (1,)}))
    assert cloud.taxel.tolist() == [0]
    assert len(cloud.inactive_points) == BOARD - 1


def test_a_grasp_without_a_baseline_is_left_out(dataset):
    cloud = accumulate_file(dataset({"signals": ((0, 400),), "has_baseline": False}, {"signals": ((1, 400),)}))
    assert cloud.grasps == ("0001",)
    assert cloud.taxel.tolist() == [1]


def test_cloud_has_as_many_points_as_the_campaign_counts_contact_points(dataset):
    path = dataset({"signals": ((0, 400), (1, 100))}, {"signals": ((2 * BOARD, 400), (4, 300))})
    assert count_contact_points(path)["cylinder"].points == len(accumulate_file(path)) == 2


def test_object_without_a_grasp_gives_an_empty_cloud(dataset):
    cloud = accumulate_file(dataset({"signals": ((0, 400),)}), "rectangular_prism")
    assert len(cloud) == 0
    assert cloud.points.shape == (0, 3)


def test_unknown_object_is_refused_in_one_line(dataset):
    path = dataset({})
    with pytest.raises(CloudError, match="object: expected one of cylinder, rectangular_prism, found mug; correct"):
        accumulate_file(path, "mug")


def test_progress_counts_the_grasps_of_the_object(dataset):
    calls = []
    accumulate_file(
        dataset({}, {}, {"object_name": "rectangular_prism"}), progress=lambda *counts: calls.append(counts)
    )
    assert calls == [(1, 2), (2, 2)]


def test_propagation_activates_four_neighbours_with_the_signal_of_the_strongest_active_one(dataset):
    """Two taxels of row 2 are active, in the columns 2 and 4; column 4 is the edge of the board."""
    strongest = 2 * COLUMNS + 2
    cloud = accumulate_file(
        dataset({"signals": ((strongest, 400), (strongest + 2, 300))}, source="sim"), propagation=Propagation()
    )
    counts = dict(zip(cloud.taxel.tolist(), cloud.counts.tolist(), strict=True))
    neighbours = {strongest - 1, strongest + 1, strongest - COLUMNS, strongest + COLUMNS}
    assert set(counts) == neighbours | {strongest, strongest + 2, strongest + 2 - COLUMNS, strongest + 2 + COLUMNS}
    assert counts[strongest - 1] == counts[strongest + 1] == 400.0  # taxel strongest + 1 is between both
    assert counts[strongest + 2 + COLUMNS] == 300.0


def test_propagation_from_the_corner_of_a_board_stays_on_this_board(dataset):
    corner = BOARD - 1  # last row and last column of the first board
    path = dataset({"signals": ((corner, 400),)}, source="sim")
    adjacent_only = accumulate_file(path, propagation=Propagation())
    assert set(adjacent_only.taxel) == {corner, corner - 1, corner - COLUMNS}


def test_propagation_with_a_reach_of_one_and_a_half_pitches_activates_diagonal_neighbours(dataset):
    corner = BOARD - 1  # last row and last column of the first board
    path = dataset({"signals": ((corner, 400),)}, source="sim")
    with_diagonals = accumulate_file(path, propagation=Propagation(reach_m=0.0075))
    assert set(with_diagonals.taxel) == {corner, corner - 1, corner - COLUMNS, corner - 1 - COLUMNS}


def test_only_taxels_above_the_minimum_signal_propagate(dataset):
    path = dataset({"signals": ((7, 200), (22, 400))}, source="sim")
    cloud = accumulate_file(path, propagation=Propagation(min_signal_counts=300.0))
    assert set(cloud.taxel) == {7, 22, 21, 23, 17, 27}


def test_selected_approach_has_the_active_and_inactive_taxels_of_its_grasps_only(dataset):
    path = dataset({"signals": ((0, 400),)}, {"approach": "top", "signals": ((1, 400), (2, 400))})
    top_cloud = accumulate_file(path).select_approach("top")
    assert top_cloud.taxel.tolist() == [1, 2]
    assert len(top_cloud.inactive_points) == 2 * BOARD - 2  # of the two used boards, two taxels are active


def test_selection_of_an_unknown_approach_is_refused_in_one_line(dataset):
    path = dataset({"signals": ((0, 400),)}, {"approach": "top", "signals": ((1, 400),)})
    with pytest.raises(CloudError, match="approach: expected one of side_1, top, found under"):
        accumulate_file(path).select_approach("under")


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.array([[0.0, np.nan, 1.0], [0.0, 0.0, 0.0]]), "points: expected finite coordinates, found 1 with NaN"),
        (np.zeros((3, 2)), r"points: expected shape \[N, 3\], found \[3, 2\]"),
    ],
)
def test_invalid_points_are_refused_in_one_line(points, message):
    with pytest.raises(CloudError, match=message):
        ContactCloud.from_points(points, name="cloud")
