"""The simulator mode of the twin: a reference whose contacts the simulator predicts, for the poses of a stream."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike

import numpy as np

from taxel.grasp.objects import make_thesis_objects, select_object_sizes
from taxel.grasp.polytope import make_convex_polytope
from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_tables import ObjectMesh
from taxel.twin.errors import TwinInputError
from taxel.twin.reference import Reference
from taxel.twin.simulated.contact_fit import ContactPoses, ContactSimulator
from taxel.twin.simulated.predicted_contacts import SimulatedContacts
from taxel.twin.simulated.reference import SimulatedReference, learn_simulated_reference

SAME_SIZE_M = 1e-4
"""Largest difference between the extents of a mesh and of a packaged object whose exact shape replaces the mesh, m."""


def simulate_reference(path: str | PathLike[str], reference: Reference, hand: Hand) -> SimulatedReference:
    """Predict the contacts of a reference dataset with the simulator, and learn the deviations from these predictions.

    path: the dataset from which `reference` was learnt. hand: its hand. The poses of the stream have to be set
    afterwards (`SimulatedReference.predictions.poses`). Raises DatasetError, and TwinInputError for another hand, a
    mesh that is not convex, and contacts that the simulator does not explain.
    """
    with GraspDataset(path) as data:
        _check_hand(hand, reference, str(path))
        simulators = {
            name: ContactSimulator(hand, make_shape(name, mesh, hand.robot, str(path)))
            for name, mesh in data.objects.items()
        }
        poses = [ContactPoses(grasp.sensor_pose, grasp.object_pose) for grasp in data]
    return learn_simulated_reference(reference, SimulatedContacts(simulators), poses)


def _check_hand(hand: Hand, reference: Reference, path: str) -> None:
    """Raise TwinInputError unless the taxels of the hand have the positions of the reference."""
    known = reference.taxels
    if hand.n_taxels != known.n or not np.allclose(hand.position, known.position, atol=SAME_SIZE_M):
        raise TwinInputError(
            f"{path}: /taxels",
            f"the positions of the {hand.n_taxels} taxels of hand '{hand.name}'",
            f"{known.n} taxels at other positions",
            "select the hand of the reference with --hand",
        )


def make_shape(name: str, mesh: ObjectMesh, robot: str | None, path: str) -> Shape:
    """Return the shape of an object of a dataset: a packaged object of this name and size, or its convex mesh.

    robot: name of the hand's robot, which selects the sizes of the packaged objects. Raises TwinInputError for a mesh
    that is not convex.
    """
    packaged: Mapping[str, Shape] = {
        each.name: each.shape for each in make_thesis_objects(select_object_sizes(robot)).values()
    }
    bounds = np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
    if name in packaged and np.allclose(packaged[name].bounds, bounds, atol=SAME_SIZE_M):
        return packaged[name]
    shape = make_convex_polytope(mesh.vertices, mesh.faces)
    if shape is None:
        raise TwinInputError(
            f"{path}: /objects/{name}",
            "a convex mesh, which the simulator of the twin requires",
            "a mesh that is not convex",
            "leave out --simulate",
        )
    return shape
