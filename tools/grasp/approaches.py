"""Draw the fifteen approaches as the simulated hand holds them: one picture of fifteen panels.

    python tools/grasp/approaches.py PICTURE.png [--size PIXELS] [--only NAME ...]

Boards are coloured by the force on them, from grey (none) to red (5 N). Needs a way to draw without a screen:
MUJOCO_GL=egl or MUJOCO_GL=osmesa.
"""

from __future__ import annotations

import argparse
import copy
from pathlib import Path

import matplotlib as mpl
import mujoco
import numpy as np
from numpy.typing import NDArray

from taxel.grasp.objects import standing_pose, thesis_objects
from taxel.grasp.plan import Approach, thesis_approaches
from taxel.grasp.timeline import Timeline
from taxel.hand import load_hand
from taxel.hand.transforms import to_quaternion
from taxel.sim.closing import GraspMotion, simulate_grasp
from taxel.sim.scene import Scene, build_scene

mpl.use("Agg")
from matplotlib import pyplot as plt

COLUMNS = 5
FULL_RED_N = 5.0
TOUCHING_N = 0.2
DISTANCE_M = 0.42  # of the camera


def main() -> None:
    """Draw and save."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("picture", type=Path)
    parser.add_argument("--size", type=int, default=480, help="pixels of a panel")
    parser.add_argument("--only", nargs="*", default=[], help="parts of names, such as cylinder_top")
    given = parser.parse_args()
    hand = load_hand("allegro")
    scenes = {name: build_scene(hand, item, "palm") for name, item in thesis_objects().items()}
    wanted = [
        approach
        for approach in thesis_approaches()
        if not given.only or any(part in f"{approach.object}_{approach.name}" for part in given.only)
    ]
    panels = [(approach, *_panel(scenes[approach.object], approach, given.size)) for approach in wanted]
    _save(panels, given.picture)


def _panel(scene: Scene, approach: Approach, size: int) -> tuple[NDArray[np.uint8], str]:
    motion = simulate_grasp(scene, approach, Timeline(baseline_s=0.0, release_s=0.0, recovery_s=0.0))
    force = np.linalg.norm(motion.wrench[-1, :, :3], axis=1)
    text = f"{int((force > TOUCHING_N).sum())} boards, {force.sum():.0f} N in all, most {force.max():.1f} N"
    return _picture(scene, approach, motion, size), text


def _picture(scene: Scene, approach: Approach, motion: GraspMotion, size: int) -> NDArray[np.uint8]:
    """The last sample, seen from the thumb's side."""
    model = copy.copy(scene.model)  # the scene's own keeps its colours
    data = mujoco.MjData(model)
    data.qpos[scene.joint_addresses] = motion.joint_angles[-1]
    _put(model, data, "mount", motion.object_pose[-1])
    _put(model, data, f"link:{scene.wrist}", motion.link_poses[-1, 0])
    force = np.linalg.norm(motion.wrench[-1, :, :3], axis=1)
    for geom in np.flatnonzero(scene.board_of_geom >= 0):
        share = min(force[scene.board_of_geom[geom]] / FULL_RED_N, 1.0)
        model.geom_rgba[geom] = [0.5 + 0.5 * share, 0.55 * (1 - share), 0.5 * (1 - share), 1.0]
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, size, size) as renderer:
        renderer.update_scene(data, _camera(scene, approach, motion.link_poses[-1, 0]))
        return np.asarray(renderer.render().copy())


def _camera(scene: Scene, approach: Approach, palm: NDArray[np.float64]) -> mujoco.MjvCamera:
    """On a side it looks down past the thumb; on top it looks from the thumb's side, level with the palm."""
    top = approach.name == "top"
    towards = 0.5 * palm[:3, 0] + 0.5 * palm[:3, 2] - (2.0 if top else 1.2) * palm[:3, 1]
    camera = mujoco.MjvCamera()
    camera.lookat[:] = standing_pose()[:3, 3] + [0.0, 0.0, scene.item.shape.height * (0.9 if top else 0.5)]
    camera.distance = DISTANCE_M
    camera.azimuth = np.rad2deg(np.arctan2(towards[1], towards[0]))
    camera.elevation = np.rad2deg(np.arcsin(towards[2] / np.linalg.norm(towards)))
    return camera


def _put(model: mujoco.MjModel, data: mujoco.MjData, body: str, pose: NDArray[np.float64]) -> None:
    index = model.body_mocapid[model.body(body).id]
    data.mocap_pos[index] = pose[:3, 3]
    data.mocap_quat[index] = to_quaternion(pose)


def _save(panels: list[tuple[Approach, NDArray[np.uint8], str]], path: Path) -> None:
    rows = -(-len(panels) // COLUMNS)
    figure, axes = plt.subplots(rows, COLUMNS, figsize=(3.2 * COLUMNS, 3.5 * rows), squeeze=False)
    for axis in axes.flat:
        axis.axis("off")
    for axis, (approach, picture, text) in zip(axes.flat, panels, strict=False):
        axis.imshow(picture)
        axis.set_title(f"{approach.object} {approach.name}\n{text}", fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()
