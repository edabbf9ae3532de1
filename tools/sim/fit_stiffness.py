"""Fit the contact stiffness of the simulator to the emulated skin: force on a taxel over the depth of a flat block.

python tools/sim/fit_stiffness.py
"""

import sys

import numpy as np

from taxel.emulated.contact import SkinContact
from taxel.emulated.scene import EmulatedScene, format_scene
from taxel.grasp.shapes import ConvexPolytope
from taxel.hand import load_hand

LOW_N, HIGH_N = 0.05, 3.0
"""Range of the forces of grasps on single taxels, for the constant stiffness."""

MAX_FORCE_N = 25.0
"""Largest force on a taxel in the fit of the force law of the simulator's layer."""

BLOCK_M = 0.2


def main() -> int:
    """Print indentation depths under several forces, the fitted constant stiffness and the parameters of the force
    law.
    """
    hand = load_hand("flat8")
    block = np.eye(4)
    force, depth = [], np.linspace(0.02e-3, 1.4e-3, 70)
    with SkinContact(
        format_scene(hand, EmulatedScene({"block": ConvexPolytope.box(BLOCK_M, BLOCK_M, BLOCK_M)}))
    ) as skin:
        for depth_m in depth:
            block[2, 3] = (hand.layer_m or 0.0) - depth_m
            force.append(float(skin.compute_forces(0, block, np.eye(4)[None]).mean()))
    force_n = np.array(force)
    is_used = (force_n >= LOW_N) & (force_n <= HIGH_N)
    print(" depth mm  force N   N/mm")
    for depth_m, newtons in zip(depth[::5], force_n[::5], strict=True):
        print(f"{1e3 * depth_m:9.2f} {newtons:8.3f} {1e-3 * newtons / depth_m:6.2f}")
    stiffness = float(np.exp(np.mean(np.log(force_n[is_used] / depth[is_used]))))
    print(f"contact_stiffness_n_per_m {stiffness:.0f}, geometric mean over {LOW_N:g} to {HIGH_N:g} N on a taxel")
    depth, force_n = depth[force_n <= MAX_FORCE_N], force_n[force_n <= MAX_FORCE_N]
    columns = np.column_stack([np.ones_like(depth), depth, depth**4])
    (start, rise, bend), *_ = np.linalg.lstsq(columns, np.log(force_n / depth), rcond=None)
    largest_error = np.abs(np.exp(columns @ [start, rise, bend]) * depth / force_n - 1.0).max()
    print(
        f"LayerLaw: stiffness_n_per_m {np.exp(start):.0f}, stiffening_m {1.0 / rise:.3g}, closing_m {bend**-0.25:.3g}; "
        f"within {100 * largest_error:.0f} % up to {force_n[-1]:.0f} N"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
