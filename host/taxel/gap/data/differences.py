"""Contradictions between the two files on meshes, object poses, taxel normals and taxel sizes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from taxel.recording.grasp_tables import ObjectMesh, TaxelTable
from taxel.types import FloatArray

Poses = tuple[FloatArray, FloatArray]
"""Poses of brackets f64[C, s, 4, 4] and of objects f64[C, 4, 4]."""

SIZE_TOLERANCE_M: Final = 1e-4
"""Difference in metres between the bounds of two meshes, or between two taxel sizes, above which a difference is
reported."""

POSITION_TOLERANCE_M: Final = 1e-3
ROTATION_TOLERANCE_DEG: Final = 2.0
"""Distance in metres and angle in degrees between two object poses above which a difference is reported. Poses that
are measured by hand are not more accurate."""

NORMAL_TOLERANCE_DEG: Final = 1.0
"""Angle in degrees between two normals of a taxel above which a difference is reported."""


def describe_differences(
    taxels: tuple[TaxelTable, TaxelTable],
    objects: tuple[Mapping[str, ObjectMesh], Mapping[str, ObjectMesh]],
    poses: tuple[Poses, Poses],
    conditions: Sequence[tuple[str, str]],
) -> list[str]:
    """Return sentences for the report on the differences between the two files.

    Each of the first three arguments contains the data of the hand, then the data of the simulator. objects: meshes by
    name. poses: poses of the C conditions. conditions: object and approach of each condition.
    """
    names = sorted({item for item, _ in conditions})
    sentences = [*_describe_meshes(*objects, names), *_describe_poses(*poses, conditions)]
    angle_deg = _convert_to_degrees(np.einsum("ni,ni->n", taxels[0].normal, taxels[1].normal))
    if angle_deg.max(initial=0.0) > NORMAL_TOLERANCE_DEG:
        sentences.append(f"the taxel normals differ by up to {angle_deg.max():.0f} degrees: those of the hand are used")
    size_mm = 1e3 * np.abs(taxels[0].size - taxels[1].size).max(initial=0.0)
    if size_mm > 1e3 * SIZE_TOLERANCE_M:
        sentences.append(f"the taxel sizes differ by up to {size_mm:.2g} mm: those of the hand are used")
    return sentences


def _describe_meshes(real: Mapping[str, ObjectMesh], sim: Mapping[str, ObjectMesh], names: Sequence[str]) -> list[str]:
    """Return a sentence for each object whose two meshes have different bounds."""
    sentences = []
    for name in names:
        bounds = [np.array([one.vertices.min(axis=0), one.vertices.max(axis=0)]) for one in (real[name], sim[name])]
        difference_m = float(np.abs(bounds[0] - bounds[1]).max())
        if difference_m > SIZE_TOLERANCE_M:
            difference = f"the bounds of the two meshes differ by {1e3 * difference_m:.3g} mm"
            sentences.append(f"object {name}: {difference}: the simulator's is used")
    return sentences


def _describe_poses(real: Poses, sim: Poses, conditions: Sequence[tuple[str, str]]) -> list[str]:
    """Return one sentence on the conditions in which the object poses differ; an empty list if the poses agree.

    Poses are compared in the frames of the brackets, because the two files may have different world frames. Of all
    brackets the one with the smallest difference is used, because joint angles may differ.
    """
    real_position, real_rotation = _transform_to_brackets(*real)
    sim_position, sim_rotation = _transform_to_brackets(*sim)
    distance_m = np.linalg.norm(real_position - sim_position, axis=-1).min(axis=1)
    # The trace of the relative rotation R1^T R2 is 1 + 2 cos(angle).
    trace = np.einsum("csij,csij->cs", real_rotation, sim_rotation)
    angle_deg = _convert_to_degrees(0.5 * (trace - 1.0)).min(axis=1)
    different = np.flatnonzero((distance_m > POSITION_TOLERANCE_M) | (angle_deg > ROTATION_TOLERANCE_DEG))
    if not len(different):
        return []
    ratio = distance_m[different] / POSITION_TOLERANCE_M + angle_deg[different] / ROTATION_TOLERANCE_DEG
    worst = different[np.argmax(ratio)]
    size = f"{1e3 * distance_m[worst]:.1f} mm and {angle_deg[worst]:.1f} degrees in {' '.join(conditions[worst])}"
    affected = f"in {len(different)} of {len(conditions)} conditions"
    return [f"{affected} the simulator has another object pose than the hand: {size}"]


def _transform_to_brackets(brackets: FloatArray, objects: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return positions f64[C, s, 3] (C conditions, s boards), metres, and rotations f64[C, s, 3, 3] of objects in
    bracket frames.
    """
    rotation = brackets[..., :3, :3].swapaxes(-1, -2)
    offset = objects[:, None, :3, 3] - brackets[..., :3, 3]
    return np.einsum("csij,csj->csi", rotation, offset), rotation @ objects[:, None, :3, :3]


def _convert_to_degrees(cosine: FloatArray) -> FloatArray:
    """Return the angles in degrees that have the given cosines."""
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
