"""Random skins, calibration sessions and approaches for the check of the proximity estimator."""

from dataclasses import dataclass, field

import numpy as np

from taxel.emulated.target_stage import TargetMotion, tilt
from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand import Hand
from taxel.hand.transforms import from_rotation_vector
from taxel.types import FloatArray

Rng = np.random.Generator

LEAD_IN_S = 6.0
"""Power-up, discovery of the boards and the first baseline of the estimator (40 frames at 18.5 Hz)."""

START_M = 0.045
"""Distance from which a target approaches: beyond the range of every response."""

BRAKE_M = 0.012
"""Path on which a target brakes."""

PAUSE_S = 3.0
"""Time between two approaches."""


@dataclass(frozen=True)
class SkinParts:
    """Properties of one skin that persist: seed of its parts, size and range of its response before contact."""

    parts_seed: int
    share: float
    reach_m: float

    def format_effects(self, target: str, rng: Rng) -> list[str]:
        """Return the effects of a world with this skin: response to the target, gains, stiffness, drift and noise."""
        size = f"share={self.share:.6g} reach_m={self.reach_m:.6g}"
        effect = {
            "grounded": f"proximity conductor {size}",
            "acrylic": f"proximity dielectric {size} permittivity=3 thickness_m=0.003",
        }[target]
        effects = [effect, "gain electrode log_std=0.05", "modulus taxels log_std=0.1"]
        drift = rng.integers(3)
        if drift == 1:
            effects.append(f"drift warm_up counts={rng.uniform(20, 120):.4g} seconds={rng.uniform(60, 300):.4g}")
        elif drift == 2:
            effects.append(f"drift wander counts={rng.uniform(5, 20):.4g} seconds={rng.uniform(300, 900):.4g}")
        if rng.random() < 0.5:
            effects.append(f"noise pink counts={rng.uniform(0.5, 2.0):.4g}")
        return effects


@dataclass(frozen=True, eq=False)
class PlannedApproach:
    """One approach. kind: "contact", "stop", "pass" or "hold". shape: family. speed_m_s: while it approaches."""

    kind: str
    shape: str
    speed_m_s: float
    tilt_deg: float
    motion: TargetMotion


@dataclass(frozen=True, eq=False)
class Plan:
    """Approaches of one world in order of time, the shapes of their targets by name, and the duration."""

    shapes: dict[str, Shape] = field(default_factory=dict)
    approaches: list[PlannedApproach] = field(default_factory=list)
    duration_s: float = 0.0


def sample_skin(rng: Rng) -> SkinParts:
    """Return a random skin: response of 10 to 30 % of the fringe capacitance, electrodes 3 to 5 mm apart."""
    return SkinParts(int(rng.integers(1 << 31)), float(rng.uniform(0.10, 0.30)), float(rng.uniform(0.003, 0.005)))


def plan_approaches(
    hand: Hand, boards: list[str], count: int, rng: Rng, kinds: tuple[str, ...], speed_m_s: float | None
) -> Plan:
    """Plan random approaches to random boards, one after the other.

    count: number of approaches. kinds: kinds to choose from. speed_m_s: None: random, from 5 to 150 mm/s, uniform in
    the logarithm.
    """
    shapes: dict[str, Shape] = {}
    approaches: list[PlannedApproach] = []
    now = LEAD_IN_S
    for number in range(count):
        family, shape, upright = sample_shape(rng)
        name = f"{family}{number}"
        shapes[name] = shape
        kind = kinds[int(rng.integers(len(kinds)))]
        speed = speed_m_s or float(np.exp(rng.uniform(np.log(0.005), np.log(0.15))))
        angle = float(rng.uniform(0.0, 12.0)) if family in ("plate", "box") else 0.0
        orientation = tilt(np.deg2rad(angle), rng.uniform(0.0, 2 * np.pi)) @ turn(rng.uniform(0.0, 2 * np.pi)) @ upright
        board = boards[int(rng.integers(len(boards)))]
        times, distance, lateral = sample_path(kind, speed, rng)
        taxel = int(rng.integers(hand.find_board(board).kind.taxel_count))
        motion = TargetMotion(board, name, orientation, taxel, now + times, distance, lateral)
        approaches.append(PlannedApproach(kind, family, speed, angle, motion))
        now += float(times[-1]) + PAUSE_S
    return Plan(shapes, approaches, now)


def turn(angle_rad: float) -> FloatArray:
    """Return the rotation f64[4, 4] about the normal of the stage."""
    return from_rotation_vector(np.array([0.0, 0.0, angle_rad]))


def sample_shape(rng: Rng) -> tuple[str, Shape, FloatArray]:
    """Return a random target: family, shape, and the pose f64[4, 4] that turns the sensed side of the shape downwards.

    Lengths are in metres.
    """
    family = ("plate", "box", "cylinder", "sphere")[int(rng.integers(4))]
    if family == "plate":
        return family, ConvexPolytope.box(0.14, 0.14, 0.02), np.eye(4)
    if family == "box":
        return family, ConvexPolytope.box(rng.uniform(0.012, 0.04), rng.uniform(0.012, 0.04), 0.03), np.eye(4)
    if family == "cylinder":
        lying = from_rotation_vector(np.array([np.pi / 2, 0.0, 0.0]))
        length = 0.08
        lying = lying @ _shift(-0.5 * length)
        return family, Cylinder(float(rng.uniform(0.008, 0.03)), length), lying
    return family, make_sphere(float(rng.uniform(0.008, 0.03))), np.eye(4)


def _shift(z: float) -> FloatArray:
    """Return the translation along z as a pose f64[4, 4]; metres."""
    pose = np.eye(4)
    pose[2, 3] = z
    return pose


def make_sphere(radius_m: float, faces: int = 400) -> ConvexPolytope:
    """Return the polytope of the tangent planes of a sphere at the points of a spiral.

    It deviates from the sphere by 0.5 % of its radius.
    """
    index = np.arange(faces) + 0.5
    z = 1.0 - 2.0 * index / faces
    angle = np.pi * (1.0 + np.sqrt(5.0)) * index  # golden angle: nearly uniform distribution
    ring = np.sqrt(1.0 - z * z)
    return ConvexPolytope(np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=1), np.full(faces, radius_m))


def sample_path(kind: str, speed: float, rng: Rng) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a random path of a target: times f64[k] from 0, distances f64[k], lateral displacements f64[k, 2].

    kind: "contact", "stop" (the target brakes 1.5 to 8 mm before the skin), "hold" (the same at 0.5 to 5 mm) or "pass"
    (the target moves sideways at a constant height). After all kinds except "pass" the target retreats at 0.1 m/s.
    speed: m/s. Lengths are metres, times seconds.
    """
    if kind == "pass":
        height, span = rng.uniform(0.002, 0.008), 0.12
        angle = rng.uniform(0.0, 2 * np.pi)
        direction = np.array([np.cos(angle), np.sin(angle)])
        return np.array([0.0, span / speed]), np.full(2, height), np.array([-0.5, 0.5])[:, None] * span * direction
    end = (  # final distance, metres; a contact indents the skin by 0.2 mm
        -2e-4
        if kind == "contact"
        else float(rng.uniform(0.0005, 0.005) if kind == "hold" else rng.uniform(0.0015, 0.008))
    )
    if kind == "contact":
        reached = (START_M - end) / speed
        times, distance = [0.0, reached, reached + 0.3], [START_M, end, end]
    else:
        times, distance = _brake(speed, end)
    retreat = 0.1
    times.append(times[-1] + (START_M - end) / retreat)
    distance.append(START_M)
    return np.array(times), np.array(distance), np.zeros((len(times), 2))


def _brake(speed: float, end_m: float) -> tuple[list[float], list[float]]:
    """Return the times and distances of a target that brakes at constant deceleration and then rests for 0.8 s.

    end_m: final distance. Lengths are metres, times seconds. The mean speed during the braking is half the initial
    speed, so the path `BRAKE_M` takes 2 `BRAKE_M` / speed.
    """
    duration = 2.0 * BRAKE_M / speed
    fraction = np.linspace(0.0, 1.0, 20)
    approach = (START_M - end_m - BRAKE_M) / speed
    times = [0.0, *(approach + duration * fraction).tolist(), approach + duration + 0.8]
    return times, [START_M, *(end_m + BRAKE_M * (1.0 - fraction) ** 2).tolist(), end_m]
