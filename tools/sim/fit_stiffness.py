"""Fit the contact stiffness of the simulator to the emulated skin: force on a taxel over the depth of a flat block.

python tools/sim/fit_stiffness.py
"""

import sys

import numpy as np
from scipy.optimize import least_squares

from taxel.emulated.contact import SkinContact
from taxel.emulated.scene import EmulatedScene, format_scene
from taxel.grasp.shapes import ConvexPolytope
from taxel.hand import load_hand
from taxel.sim.soft_contact import LayerLaw
from taxel.types import FloatArray

LOW_N, HIGH_N = 0.05, 3.0
"""Range of the forces of grasps on single taxels, for the constant stiffness."""

MAX_FORCE_N = 200.0
"""Largest force on a taxel in the fit of the force law of the simulator's layer: an edge presses columns with the same
pressure.
"""

BLOCK_M = 0.2


def fit_law(depth_m: FloatArray, force_n: FloatArray) -> tuple[LayerLaw, float]:
    """Fit the logarithm of the force law to the forces f64[k] in N at the depths f64[k] in metres.

    Returns the law and its largest relative error.
    """

    def make_law(values: FloatArray) -> LayerLaw:
        """Make the force law from its stiffness in N/mm and three lengths in millimetres."""
        stiffness, stiffening, closing, solid = (1e-3 * values).tolist()
        # The law continues along its tangent beyond straight_m; 1 m excludes this part from the fit.
        return LayerLaw(1e6 * stiffness, stiffening, closing, solid, straight_m=1.0)

    def compute_errors(values: FloatArray) -> FloatArray:
        """Return the logarithm of fitted divided by measured force, f64[k]."""
        return np.asarray(np.log(make_law(values).compute_force(depth_m) / force_n))

    values = least_squares(compute_errors, [0.6, 0.6, 1.5, 1.6]).x  # initial values in N/mm and mm
    return make_law(values), float(np.abs(np.expm1(compute_errors(values))).max())


def main() -> int:
    """Print indentation depths and forces, the fitted constant stiffness, and the parameters of the force law."""
    hand = load_hand("flat8")
    block = np.eye(4)
    force, depth = [], np.linspace(0.03e-3, 1.62e-3, 160)
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
    law, largest_error = fit_law(depth, force_n)
    print(
        f"LayerLaw: stiffness_n_per_m {law.stiffness_n_per_m:.0f}, stiffening_m {law.stiffening_m:.3g}, "
        f"closing_m {law.closing_m:.3g}, solid_m {law.solid_m:.3g}; "
        f"within {100 * largest_error:.0f} % up to {force_n[-1]:.0f} N"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
