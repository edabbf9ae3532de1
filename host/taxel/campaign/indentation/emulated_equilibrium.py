"""Equilibrium of an object on a compliant mount against the emulated skin, for forces from first contact to hold.

The mount pushes along its line with a given force and holds the object with springs across this line and about its
centre; the contact solver of the emulator gives the load of the skin. The six equations of force and moment are solved
by Newton's method with the skin's stiffness. This stiffness neglects the curvature of the surfaces; secant updates
(Broyden 1965) compensate for the error.
"""

from typing import NamedTuple

import numpy as np

from taxel.campaign.indentation.errors import EquilibriumError
from taxel.campaign.indentation.plan import IndenterMount
from taxel.emulated.contact import SkinContact
from taxel.types import FloatArray

FORCE_SHARES = (0.01, 0.03, 0.07, 0.13, 0.2, 0.3, 0.42, 0.55, 0.7, 0.85, 1.0)
"""Shares of the nominal force at which the equilibrium is solved; denser at low forces, where the layer is soft."""

TOLERANCE, FALLBACK_TOLERANCE = 3e-4, 1e-2
"""Residual force as a share of the mount's force. The fallback holds where a contact element at the rim of a cylinder
switches between loaded and unloaded, so that no better balance exists."""

ARM_M = 0.02
"""Lever arm that converts moments into forces."""

MAX_STEPS = 30
MAX_STEP = np.array([3e-4] * 3 + [0.01] * 3)
MIN_STEP_SHARE = 1.0 / 64.0
FIRST_DEPTH_M = 2e-5
MAX_SEARCH_M = 0.02


class EquilibriumPath(NamedTuple):
    """Equilibria of an object at k travels of its mount, from first contact to hold.

    travel_m: f64[k], travel of the mount along its line, not decreasing. pose: f64[k, 4, 4], pose of the object, world.
    """

    travel_m: FloatArray
    pose: FloatArray


class EmulatedEquilibrium:
    """Solver for the equilibrium of one object that a mount with springs presses into the emulated skin."""

    def __init__(
        self,
        contact: SkinContact,
        index: int,
        bracket_poses: FloatArray,
        mount: IndenterMount,
        centre: FloatArray,
        touch_pose: FloatArray,
        direction: FloatArray,
    ) -> None:
        """Create the solver of one object.

        contact: computes the contact loads of the skin. index: number of the object in the world file. bracket_poses:
        nominal poses f64[s, 4, 4] of the s boards' brackets, world. mount: springs that hold the object. centre: point
        f64[3] at which the mount holds the object, object frame. touch_pose: f64[4, 4], pose of the object at travel 0,
        the nominal first contact. direction: unit vector f64[3] of the travel.
        """
        self._contact, self._index, self._brackets = contact, index, bracket_poses
        self._rest, self._direction = touch_pose, direction
        self._centre = touch_pose[:3, :3] @ centre + touch_pose[:3, 3]
        across = mount.n_per_m * (np.eye(3) - np.outer(direction, direction))
        self._along = mount.n_per_m
        self._springs = np.zeros((6, 6))
        self._springs[:3, :3], self._springs[3:, 3:] = across, mount.nm_per_rad * np.eye(3)
        self._to_world = np.stack(
            [_wrench_map(pose @ contact.get_bracket_offset(board)) for board, pose in enumerate(bracket_poses)]
        )

    def solve_path(self, force_n: float) -> EquilibriumPath:
        """Solve for the equilibrium of the object at increasing forces from first contact to `force_n` newtons.

        Raises `EquilibriumError` if there is no equilibrium.
        """
        touch = self._find_touch_travel()
        travels, poses = [touch], [self._compute_pose(np.concatenate([touch * self._direction, np.zeros(3)]))]
        state = self._first_guess(touch, FORCE_SHARES[0] * force_n)
        previous, slope = 0.0, np.zeros(6)
        for share in FORCE_SHARES:
            # The motion is nearly linear in the logarithm of the force: good enough for a first guess.
            guess = state + slope * (np.log(share / previous) if previous else 0.0)
            solution = self._solve(guess, share * force_n)
            slope = (solution - state) / np.log(share / previous) if previous else np.zeros(6)
            state, previous = solution, share
            # The mount moves as far as the object, and further by the compression of its spring, force / stiffness.
            travels.append(float(state[:3] @ self._direction) + share * force_n / self._along)
            poses.append(self._compute_pose(state))
        # The mount does not move backwards at a snap-through.
        return EquilibriumPath(np.maximum.accumulate(travels), np.stack(poses))

    def _compute_pose(self, state: FloatArray) -> FloatArray:
        """Compute the pose f64[4, 4] of the object, world, after the motion `state` f64[6] from its pose at travel 0.

        state: translation state[:3], metres, and rotation vector state[3:], radians, about the point at which the mount
        holds the object.
        """
        rotation = _rotation_matrix(state[3:])
        pose = self._rest.copy()
        pose[:3, :3] = rotation @ self._rest[:3, :3]
        pose[:3, 3] = state[:3] + self._centre + rotation @ (self._rest[:3, 3] - self._centre)
        return pose

    def _is_touching(self, travel: float) -> bool:
        """Return whether the object touches the skin if its mount has moved by `travel` metres and is not deflected."""
        pose = self._rest.copy()
        pose[:3, 3] += travel * self._direction
        return self._contact.compute_load(self._index, pose, self._brackets).touched_board_count > 0

    def _find_touch_travel(self) -> float:
        """Search for the travel of the undeflected mount at first contact with the skin, metres, to one micrometre.

        Raises EquilibriumError if the object starts inside the skin or never meets it.
        """
        step, free = 4e-4, 0.0
        while self._is_touching(free):
            free -= step
            if free < -MAX_SEARCH_M:
                raise EquilibriumError("starts inside the skin")
        while not self._is_touching(free + step):
            free += step
            if free > MAX_SEARCH_M:
                raise EquilibriumError("meets no skin")
        touching = free + step
        while touching - free > 1e-6:
            middle = 0.5 * (free + touching)
            free, touching = (free, middle) if self._is_touching(middle) else (middle, touching)
        return touching

    def _first_guess(self, touch: float, force: float) -> FloatArray:
        """Find a pure translation f64[6] to a depth at which the skin carries more than `force` newtons.

        Newton's method converges reliably from this motion. touch: travel to first contact, metres. Raises
        EquilibriumError if the skin carries less force at any depth.
        """
        depth = FIRST_DEPTH_M
        while depth < MAX_SEARCH_M:
            state = np.concatenate([(touch + depth) * self._direction, np.zeros(3)])
            residual, _ = self._balance(state, force)
            if residual[:3] @ self._direction < 0.0:
                return state
            depth *= 1.6
        raise EquilibriumError("meets no skin that carries the force")

    def _balance(self, state: FloatArray, force: float) -> tuple[FloatArray, FloatArray]:
        """Compute the sum of forces and moments on the object, f64[6], and its negative derivative f64[6, 6].

        The sum, the residual, is 0 in equilibrium; the negative derivative is the stiffness of skin and mount. state:
        translation and rotation vector of the object. force: spring force of the mount along its line, newtons. Moments
        are about the point at which the mount holds the object.
        """
        load = self._contact.compute_load(self._index, self._compute_pose(state), self._brackets)
        loaded = np.flatnonzero(load.wrench.any(axis=1))
        to_point = np.eye(6)
        to_point[3:, :3] = -_cross_matrix(self._centre + state[:3])  # moments about the world's origin to the point
        maps = to_point @ self._to_world[loaded]
        stiffness = (maps @ load.stiffness[loaded] @ maps.transpose(0, 2, 1)).sum(axis=0)
        residual = -(maps @ load.wrench[loaded, :, None]).sum(axis=0)[:, 0] - self._springs @ state
        residual[:3] += force * self._direction
        return residual, stiffness + self._springs

    def _solve(self, state: FloatArray, force: float) -> FloatArray:
        """Solve for the motion f64[6] of the object in equilibrium under `force` newtons of the mount.

        Newton's method with secant updates. state: first guess, translation and rotation vector f64[6]. Raises
        EquilibriumError if there is no equilibrium.
        """
        residual, system = self._balance(state, force)
        norm = _norm(residual)
        best_state, best_norm = state, norm
        for _ in range(MAX_STEPS):
            if norm < TOLERANCE * force:
                return state
            step = _solve_scaled(system, residual)
            step *= min(1.0, 1.0 / float(np.max(np.abs(step) / MAX_STEP)))
            share = 1.0
            while True:
                next_residual, next_system = self._balance(state + share * step, force)
                next_norm = _norm(next_residual)
                if next_norm < norm or share <= MIN_STEP_SHARE:
                    break
                share *= 0.5
            motion = share * step
            # Secant (Broyden) update: the new stiffness must reproduce the change of the residual in the last step.
            # Division by `SCALE` makes translations and rotations comparable.
            error = (residual - next_residual) - next_system @ motion
            system = next_system + np.outer(error, motion / SCALE) / (motion @ (motion / SCALE))
            state, residual, norm = state + motion, next_residual, next_norm
            best_state, best_norm = (state, norm) if norm < best_norm else (best_state, best_norm)
        if best_norm < FALLBACK_TOLERANCE * force:
            return best_state
        raise EquilibriumError(f"has no equilibrium under {force:.1f} N")


SCALE = np.array([1.0] * 3 + [1.0 / ARM_M**2] * 3)
"""Weights of the secant update; they convert rotations into lengths at the lever arm."""


def _norm(residual: FloatArray) -> float:
    """Compute the norm of a residual f64[6] in newtons; moments are divided by a typical lever arm."""
    return float(np.sqrt(residual[:3] @ residual[:3] + residual[3:] @ residual[3:] / ARM_M**2))


def _solve_scaled(system: FloatArray, residual: FloatArray) -> FloatArray:
    """Solve for the Newton step f64[6] of the equilibrium. residual: forces and moments f64[6].

    system: negative derivative of the residual f64[6, 6]. Raises EquilibriumError for a singular system.
    """
    # Forces and moments have different units; the scaling improves the condition of the system.
    scale = np.array([1.0] * 3 + [ARM_M] * 3)
    scaled = system / scale[:, None] / scale
    try:
        return np.asarray(np.linalg.solve(scaled, residual / scale) / scale)
    except np.linalg.LinAlgError:
        raise EquilibriumError("loses the skin") from None


def _wrench_map(pose: FloatArray) -> FloatArray:
    """Make the matrix f64[6, 6] that maps force and moment from a bracket's frame to the world frame.

    Moments are about the origin of the frame in question. pose: of the bracket f64[4, 4].
    """
    rotation = pose[:3, :3]
    result = np.zeros((6, 6))
    result[:3, :3] = result[3:, 3:] = rotation
    result[3:, :3] = _cross_matrix(pose[:3, 3]) @ rotation
    return result


def _rotation_matrix(vector: FloatArray) -> FloatArray:
    """Compute the matrix f64[3, 3] of the rotation by |vector| radians about its direction (Rodrigues' formula)."""
    angle = float(np.sqrt(vector @ vector))
    skew = _cross_matrix(vector)
    sine, cosine = (np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2) if angle > 1e-8 else (1.0, 0.5)
    return np.asarray(np.eye(3) + sine * skew + cosine * (skew @ skew))


def _cross_matrix(v: FloatArray) -> FloatArray:
    """Return the matrix f64[3, 3] that computes the cross product v x w of a vector v f64[3] with any w."""
    x, y, z = v.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
