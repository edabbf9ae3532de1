"""Targets: files that users write by hand: hands, robots, rigs, plans, calibrations, priors, recipes and mappings."""

from __future__ import annotations

import re
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any, Final

import numpy as np

from fuzz_files.document import Flat, flatten
from fuzz_files.target import Rules, Target
from fuzz_files.text_codecs import Toml
from hil_tests.harness.rig_file import RIGS, load_rig
from taxel.cloud.files import write_mesh
from taxel.cloud.mesh import TriangleMesh
from taxel.gap.fitting.priors import read_priors
from taxel.generate.recipe_file import read_recipe
from taxel.grasp.calibration import load_calibration
from taxel.hand import load_hand
from taxel.hand.robot import load_robot
from taxel.recording.importers.mapping import load_mapping
from taxel_tools.provisioning_plan import read_plan as read_provisioning_plan
from taxel_tools.testing.plan import read_plan as read_test_plan

TOML: Final = ((r"\.toml$", (Toml(),)),)

PROVISIONING: Final = """taxel_provisioning = 1
[[board]]
unique_id = "0011223344556677"
address = 0x21
kind = 1
serial_number = "FT-0007"
idac_codes = [16, 17]
[[board]]
unique_id = "0011223344556678"
address = 0x22
"""

CALIBRATION: Final = """format = "taxel-calibration"
version = 1
[[objects]]
name = "cylinder"
measured = 2024-05-17
instrument = "C-Track 780"
sigma_m = 25e-6
points = [
    ["a", 0.0, 0.0, 0.0, 0.6, 0.1, 0.02],
    ["b", 0.06, 0.0, 0.0, 0.66, 0.1, 0.02],
    ["c", 0.06, 0.04, 0.0, 0.66, 0.14, 0.02],
    ["d", 0.0, 0.04, 0.1, 0.6, 0.14, 0.12],
    ["e", 0.0, 0.0, 0.1, 0.6, 0.1, 0.12],
]
[[objects]]
name = "cube"
pose = { position_m = [0.5, -0.1, 0.05], quaternion_wxyz = [1.0, 0.0, 0.0, 0.0] }
[[brackets]]
sensor = "palm"
pose = { position_m = [0.0, 0.0, 0.0951], quaternion_wxyz = [1.0, 0.0, 0.0, 0.0] }
"""

PRIORS: Final = """[contact_propagation]
spread_mm = { value = 2.0, std = 0.5 }
"""

TEST_PLAN: Final = """taxel_test_plan = 1
name = "boards"
version = "1"
serial_pattern = "[A-Z]{2}-[0-9]{4}"
stop_at_failure = false
[phases.noise]
enabled = true
seconds = 4.0
[phases.noise.limits]
white = { max = 8.0 }
drift = { min = -3.5, max = 3.5 }
[phases.touch]
force_n = 2.0
[kinds.fingertip.noise.limits]
white = { max = 10.0 }
"""

MAPPING: Final = """format = "taxel-import-map"
version = 1
source = "real"
sensor = "mat"
unit = "kPa"
contact = "raises"
full_scale = 250.0
resolution = 0.5
modality = "resistive"
[time]
field = "t"
unit = "ms"
[values]
fields = ["a", "b"]
components = 1
"""

RECIPE: Final = """grasps = 500
seed = 7
shard = 50
fidelity = "full"
[[object]]
name = "can"
shape = "cylinder"
radius_mm = [18, 25]
height_mm = 120
share = 2
[[object]]
name = "ball"
shape = "mesh"
file = "ball.stl"
unit = "mm"
scale = [0.8, 1.2]
[grasp]
grip = [0.5, 1.5]
top_share = 0.5
[simulator]
layer_stiffness = 1.2
[sensor]
half_force_n = [1.4, 2.0]
[[effect]]
name = "noise"
white_counts = [0, 20]
share = 0.5
"""


def _write(text: str, name: str = "a.toml") -> Callable[[Path], str]:
    """Return a function that writes `text` to the file `name` of a folder and returns the name."""

    def make(folder: Path) -> str:
        """Write the text and return the file's name."""
        (folder / name).write_text(text)
        return name

    return make


def _write_packaged(folder_name: str, name: str) -> Callable[[Path], str]:
    """Return a function that writes a packaged description to a folder.

    folder_name: subfolder of taxel.hand. name: name without suffix.
    """
    return _write((resources.files("taxel.hand") / folder_name / f"{name}.toml").read_text())


def write_recipe(folder: Path) -> str:
    """Write a recipe and the mesh that it names, a tetrahedron in millimetres. Returns the recipe's name."""
    points = 30.0 * np.array([[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]])
    write_mesh(
        TriangleMesh("ball", points, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])), folder / "ball.stl"
    )
    return _write(RECIPE)(folder)


def _flatten(read: Callable[[Path], Any], *skip: str) -> Callable[[Path], Flat]:
    """Return a reader whose data are the fields of the object that `read` returns.

    skip: names of fields that are omitted.
    """
    names = (*skip, "source", "path", "location", "sha256")
    return lambda path: flatten(read(path), "", names)


def _read_rig(path: Path) -> Flat:
    """Read a rig and return its parts; the hand is represented by its name."""
    rig = load_rig(str(path))
    devices = {name: {"driver": device.driver.name, **device.options} for name, device in rig.devices.items()}
    return flatten(
        {"name": rig.name, "hand": rig.hand.name, "devices": devices, "world": rig.world, "run": rig.executed}
    )


def _read_calibration(path: Path) -> Flat:
    """Read the objects and brackets of a calibration with their poses."""
    calibration = load_calibration(path)
    return flatten({kind: getattr(calibration, kind) for kind in ("objects", "brackets")})


_COMPUTED: Final = re.compile(
    r"#$|\.points|\.quaternion|\.position|taxels|margin|crossings|pose|origin|axis|sigma_m|measured|^objects|^brackets"
)
_HAND: Final = Rules(
    derived=re.compile(r"#$|geometry|crossings|quaternion|position|wiring|robot|layout"), unused=re.compile("^$")
)

_RECIPE: Final = Rules(derived=re.compile(r"file|unit|shape"))

TARGETS: Final = (
    Target("hand", _write_packaged("descriptions", "flat8"), TOML, _flatten(load_hand), 2.0, _HAND),
    Target("wired-hand", _write_packaged("descriptions", "rig4"), TOML, _flatten(load_hand), 1.0, _HAND),
    Target("robot", _write_packaged("robots", "plate"), TOML, _flatten(load_robot), 4.0, Rules(derived=_COMPUTED)),
    Target("rig", _write((RIGS / "virtual.toml").read_text()), TOML, _read_rig, 2.0, Rules()),
    Target("bench-plan", _write(TEST_PLAN), TOML, _flatten(read_test_plan, "locations", "place"), 6.0, Rules()),
    Target(
        "provisioning",
        _write(PROVISIONING),
        TOML,
        _flatten(read_provisioning_plan),
        8.0,
        Rules(derived=re.compile(r"#$|unique_id")),
    ),
    Target("calibration", _write(CALIBRATION), TOML, _read_calibration, 2.0, Rules(derived=_COMPUTED)),
    Target("priors", _write(PRIORS), TOML, _flatten(read_priors), 8.0, Rules()),
    Target("recipe", write_recipe, TOML, _flatten(read_recipe), 1.0, _RECIPE, mutable=r"\.toml$"),
    Target("mapping", _write(MAPPING), TOML, _flatten(load_mapping), 6.0, Rules()),
)
