"""Draw the fifteen approaches in the hold phase of the simulation, one panel per approach.

    python tools/grasp/approaches.py PICTURE.png [--size PIXELS] [--only NAME ...]

The colour of a board is the force on it, from grey (0 N) to red (5 N). Without a display set MUJOCO_GL=egl or
MUJOCO_GL=osmesa.
"""

import argparse
import copy
from pathlib import Path

import matplotlib as mpl
import mujoco
import numpy as np
from numpy.typing import NDArray

from taxel.grasp.objects import ASSUMED_SIZES, make_standing_pose, make_thesis_objects
from taxel.grasp.plan import Approach, make_thesis_approaches
from taxel.grasp.timeline import Timeline
from taxel.hand import load_hand
from taxel.hand.transforms import to_quaternion
from taxel.output.figure import save_figure
from taxel.sim.closing import GraspMotion, simulate_grasp
from taxel.sim.scene import Scene, build_scene

mpl.use("Agg")
from matplotlib import pyplot as plt

COLUMNS = 5
FULL_SCALE_N = 5.0
"""Force of the colour red."""
CONTACT_N = 0.2
"""Smallest force on a board that counts as contact."""
CAMERA_DISTANCE_M = 0.42


def main() -> None:
    """Simulate the selected grasp approaches, draw the final pose of each, and save the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("picture", type=Path)
    parser.add_argument("--size", type=int, default=480, help="size of a panel, pixels")
    parser.add_argument("--only", nargs="*", default=[], help="parts of names, such as cylinder_top")
    options = parser.parse_args()
    hand = load_hand("allegro")
    scenes = {name: build_scene(hand, item, "palm") for name, item in make_thesis_objects(ASSUMED_SIZES).items()}
    selected = [
        approach
        for approach in make_thesis_approaches()
        if not options.only or any(part in f"{approach.object}_{approach.name}" for part in options.only)
    ]
    panels = [(approach, *_make_panel(scenes[approach.object], approach, options.size)) for approach in selected]
    _save_picture(panels, options.picture)


def _make_panel(scene: Scene, approach: Approach, size: int) -> tuple[NDArray[np.uint8], str]:
    """Simulate the grasp of one approach. Returns a picture of the final pose, and a text with the contact forces.

    size: width and height of the picture in pixels.
    """
    motion = simulate_grasp(scene, approach, Timeline(baseline_s=0.0, release_s=0.0, recovery_s=0.0))
    force = np.linalg.norm(motion.wrench[-1, :, :3], axis=1)
    text = f"{int((force > CONTACT_N).sum())} boards, {force.sum():.0f} N total, largest {force.max():.1f} N"
    return _render(scene, approach, motion, size), text


def _render(scene: Scene, approach: Approach, motion: GraspMotion, size: int) -> NDArray[np.uint8]:
    """Render the last sample of a simulated grasp, seen from the thumb side. size: pixels."""
    model = copy.copy(scene.model)  # the colours of the scene's model stay unchanged
    data = mujoco.MjData(model)
    data.qpos[scene.joint_addresses] = motion.joint_angles[-1]
    scene.place_object(data, motion.object_pose[-1])
    _set_pose(model, data, f"link:{scene.wrist}", motion.link_poses[-1, 0])
    force = np.linalg.norm(motion.wrench[-1, :, :3], axis=1)
    for geom in np.flatnonzero(scene.board_of_geom >= 0):
        fraction = min(force[scene.board_of_geom[geom]] / FULL_SCALE_N, 1.0)
        model.geom_rgba[geom] = [0.5 + 0.5 * fraction, 0.55 * (1 - fraction), 0.5 * (1 - fraction), 1.0]
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, size, size) as renderer:
        renderer.update_scene(data, _make_camera(scene, approach, motion.link_poses[-1, 0]))
        return np.asarray(renderer.render().copy())


def _make_camera(scene: Scene, approach: Approach, palm: NDArray[np.float64]) -> mujoco.MjvCamera:
    """Make the camera of a picture: for side approaches above the thumb, for top approaches level with the palm."""
    is_top = approach.name == "top"
    # Direction of view, as weights of the axes of the palm.
    direction = 0.5 * palm[:3, 0] + 0.5 * palm[:3, 2] - (2.0 if is_top else 1.2) * palm[:3, 1]
    camera = mujoco.MjvCamera()
    camera.lookat[:] = make_standing_pose()[:3, 3] + [
        0.0,
        0.0,
        scene.grasp_object.shape.height * (0.9 if is_top else 0.5),
    ]
    camera.distance = CAMERA_DISTANCE_M
    camera.azimuth = np.rad2deg(np.arctan2(direction[1], direction[0]))
    camera.elevation = np.rad2deg(np.arcsin(direction[2] / np.linalg.norm(direction)))
    return camera


def _set_pose(model: mujoco.MjModel, data: mujoco.MjData, body: str, pose: NDArray[np.float64]) -> None:
    """Move a MuJoCo mocap body to a pose. pose: f64[4, 4], transform from the body to the world."""
    index = model.body_mocapid[model.body(body).id]
    data.mocap_pos[index] = pose[:3, 3]
    data.mocap_quat[index] = to_quaternion(pose)


def _save_picture(panels: list[tuple[Approach, NDArray[np.uint8], str]], path: Path) -> None:
    """Save the pictures of all approaches as one figure. panels: approach, picture, text below its title."""
    rows = -(-len(panels) // COLUMNS)
    figure, axes = plt.subplots(rows, COLUMNS, figsize=(3.2 * COLUMNS, 3.5 * rows), squeeze=False)
    for axis in axes.flat:
        axis.axis("off")
    for axis, (approach, picture, text) in zip(axes.flat, panels, strict=False):
        axis.imshow(picture)
        axis.set_title(f"{approach.object} {approach.name}\n{text}", fontsize=8)
    figure.tight_layout()
    save_figure(figure, path, dpi=110)


if __name__ == "__main__":
    main()
