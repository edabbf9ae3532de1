"""Stiffness that an experimenter finds who presses a flat block into the emulated skin: force on a taxel over depth.

python tools/sim/fit_stiffness.py
"""

import sys

import numpy as np

from taxel.emulated.contact import SkinContact
from taxel.emulated.scene import Scene, format_scene
from taxel.grasp.shapes import ConvexPolytope
from taxel.hand import load_hand

LOW_N, HIGH_N = 0.05, 3.0
"""Forces that grasps put on single taxels."""

MOST_N = 25.0
"""Of the curve that the simulator's layer follows."""

BLOCK_M = 0.2


def main() -> int:
    """Print the ladder and the stiffness that fits it best, in log force."""
    hand = load_hand("flat8")
    block = np.eye(4)
    force, depth = [], np.linspace(0.02e-3, 1.4e-3, 70)
    with SkinContact(format_scene(hand, Scene({"block": ConvexPolytope.box(BLOCK_M, BLOCK_M, BLOCK_M)}))) as skin:
        for sunk in depth:
            block[2, 3] = (hand.layer_m or 0.0) - sunk
            force.append(float(skin.compute_forces(0, block, np.eye(4)[None]).mean()))
    pressed = np.array(force)
    used = (pressed >= LOW_N) & (pressed <= HIGH_N)
    print(" depth mm  force N   N/mm")
    for sunk, newtons in zip(depth[::5], pressed[::5], strict=True):
        print(f"{1e3 * sunk:9.2f} {newtons:8.3f} {1e-3 * newtons / sunk:6.2f}")
    stiffness = float(np.exp(np.mean(np.log(pressed[used] / depth[used]))))
    print(f"contact_stiffness_n_per_m {stiffness:.0f}, geometric mean over {LOW_N:g} to {HIGH_N:g} N on a taxel")
    depth, pressed = depth[pressed <= MOST_N], pressed[pressed <= MOST_N]
    columns = np.column_stack([np.ones_like(depth), depth, depth**4])
    (start, rise, bend), *_ = np.linalg.lstsq(columns, np.log(pressed / depth), rcond=None)
    worst = np.abs(np.exp(columns @ [start, rise, bend]) * depth / pressed - 1.0).max()
    print(
        f"LayerLaw: stiffness_n_per_m {np.exp(start):.0f}, stiffening_m {1.0 / rise:.3g}, closing_m {bend**-0.25:.3g}; "
        f"within {100 * worst:.0f} % up to {pressed[-1]:.0f} N"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
