"""Differences between the metadata of two datasets are reported in the losses."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from taxel.gap.data.pair import read_pair


@pytest.fixture
def files(write_world, tmp_path):
    return write_world(tmp_path, sessions=3, conditions=4)


def change_file(path, change):
    with h5py.File(path, "r+") as file:
        change(file)


def list_differences(files):
    return [loss for loss in read_pair(*files).losses if "differ" in loss or "mesh" in loss or "object pose" in loss]


def test_equal_files_have_no_differences(files):
    assert list_differences(files) == []


def test_a_mesh_in_millimetres_is_reported_and_the_simulated_mesh_is_used(files):
    """The real dataset's mesh is 1000 times larger than the simulator's mesh, as a mesh in millimetres would be."""

    def shrink_mesh(file):
        file["objects/cube/vertices"][...] *= 0.001

    change_file(files[1], shrink_mesh)
    (line,) = list_differences(files)
    assert line.startswith("object cube: the bounds of the two meshes differ by ")
    assert line.endswith("mm: the simulator's is used")
    objects = read_pair(*files).objects
    assert np.ptp(objects["cube"].vertices) < 0.01 * np.ptp(objects["block"].vertices)


def move(file, shift, turn=0.0, is_world=False):
    """Move the objects of one approach, or all objects and boards (is_world), by shift in m and turn in degrees."""
    cosine, sine = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    motion = np.array([[cosine, -sine, 0, shift], [sine, cosine, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    for grasp in file["grasps"].values():
        if is_world:
            grasp["sensor_pose"][...] = motion @ grasp["sensor_pose"][...]
        if is_world or grasp.attrs["approach"] == "press_1":
            grasp["object_pose"][...] = motion @ grasp["object_pose"][...]


def test_a_displaced_object_is_reported_with_its_approach(files):
    change_file(files[1], lambda file: move(file, 0.0042, 3.0))
    (line,) = list_differences(files)
    assert line.startswith(
        "in 1 of 4 conditions the simulator has another object pose than the hand: 4.2 mm and 3.0 deg"
    )
    assert line.endswith("block press_1")


def test_another_world_frame_is_no_difference(files):
    change_file(files[1], lambda file: move(file, 0.5, 90.0, is_world=True))
    assert list_differences(files) == []


def test_another_joint_angle_is_no_difference(files):
    """Another joint angle moves one board, but the object has the same pose relative to the other board."""

    def move_second_board(file):
        for grasp in file["grasps"].values():
            pose = grasp["sensor_pose"][...]
            pose[1, 0, 3] += 0.01
            grasp["sensor_pose"][...] = pose

    change_file(files[1], move_second_board)
    assert list_differences(files) == []


def test_different_normals_and_taxel_sizes_are_reported(files):
    def change_taxels(file):
        file["taxels/normal"][0] = [0.0, 1.0, 0.0]
        file["taxels/size"][...] = 0.004

    change_file(files[1], change_taxels)
    assert list_differences(files) == [
        "the taxel normals differ by up to 90 degrees: those of the hand are used",
        "the taxel sizes differ by up to 1 mm: those of the hand are used",
    ]
