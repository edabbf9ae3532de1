"""What two files say otherwise of one thing that both must know: meshes, poses, how taxels face."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from taxel.recording.grasp_tables import ObjectMesh, TaxelTable
from taxel.types import FloatArray

Poses = tuple[FloatArray, FloatArray]

SIZE_M: Final = 1e-4
"""By so much a mesh or an electrode may be larger in one of the files."""

PLACE_M: Final = 1e-3
TURN_DEG: Final = 2.0
"""Distance and angle by which an object may stand elsewhere: what is measured by hand is no nearer."""

FACE_DEG: Final = 1.0
"""Angle between normals."""


def differences(
    taxels: tuple[TaxelTable, TaxelTable],
    objects: tuple[Mapping[str, ObjectMesh], Mapping[str, ObjectMesh]],
    poses: tuple[Poses, Poses],
    conditions: Sequence[tuple[str, str]],
) -> list[str]:
    """Sentences for the report. Everything of the hand first, then of the simulator; poses: of brackets f64[C, s, 4, 4]
    and objects f64[C, 4, 4].
    """
    found = [*_meshes(*objects, sorted({item for item, _ in conditions})), *_poses(*poses, conditions)]
    turned = _degrees(np.einsum("ni,ni->n", taxels[0].normal, taxels[1].normal))
    if turned.max(initial=0.0) > FACE_DEG:
        found.append(f"the taxel normals differ by up to {turned.max():.0f} degrees: those of the hand are used")
    wider = 1e3 * np.abs(taxels[0].size - taxels[1].size).max(initial=0.0)
    if wider > 1e3 * SIZE_M:
        found.append(f"the taxel sizes differ by up to {wider:.2g} mm: those of the hand are used")
    return found


def _meshes(real: Mapping[str, ObjectMesh], sim: Mapping[str, ObjectMesh], names: Sequence[str]) -> list[str]:
    found = []
    for name in names:
        boxes = [np.array([one.vertices.min(axis=0), one.vertices.max(axis=0)]) for one in (real[name], sim[name])]
        apart = float(np.abs(boxes[0] - boxes[1]).max())
        if apart > SIZE_M:
            found.append(
                f"object {name}: the bounds of the two meshes differ by {1e3 * apart:.3g} mm: the simulator's is used"
            )
    return found


def _poses(real: Poses, sim: Poses, conditions: Sequence[tuple[str, str]]) -> list[str]:
    """Objects as the brackets see them, since worlds may differ; the bracket that sees the least, since joints do."""
    (place, turn), (other, otherwise) = (_seen(*one) for one in (real, sim))
    apart = np.linalg.norm(place - other, axis=-1).min(axis=1)
    turned = _degrees(0.5 * (np.einsum("csij,csij->cs", turn, otherwise) - 1.0)).min(axis=1)
    wrong = np.flatnonzero((apart > PLACE_M) | (turned > TURN_DEG))
    if not len(wrong):
        return []
    most = wrong[np.argmax(apart[wrong] / PLACE_M + turned[wrong] / TURN_DEG)]
    size = f"{1e3 * apart[most]:.1f} mm and {turned[most]:.1f} degrees in {' '.join(conditions[most])}"
    return [
        f"in {len(wrong)} of {len(conditions)} conditions the simulator has another object pose than the hand: {size}"
    ]


def _seen(brackets: FloatArray, objects: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Places f64[C, s, 3] and rotations f64[C, s, 3, 3] of objects in the frames of brackets."""
    turn = brackets[..., :3, :3].swapaxes(-1, -2)
    way = objects[:, None, :3, 3] - brackets[..., :3, 3]
    return np.einsum("csij,csj->csi", turn, way), turn @ objects[:, None, :3, :3]


def _degrees(cosine: FloatArray) -> FloatArray:
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
