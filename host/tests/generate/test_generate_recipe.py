"""Recipe files: valid content, one-line error messages, and meshes as convex solids."""

import numpy as np
import pytest

from taxel.campaign.setup import Setup
from taxel.cloud.files import write_mesh
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import build_sphere
from taxel.generate.errors import RecipeError
from taxel.generate.placement import RECORDED_PRESS_M, shift_recorded_approach
from taxel.generate.ranges import Range, fixed
from taxel.generate.recipe import Recipe
from taxel.generate.recipe_file import add_mesh, read_recipe
from taxel.generate.sampling import sample_grasp, sample_sensor
from taxel.generate.solids import MAX_CORNERS
from taxel.grasp.plan import PlannedGrasp
from taxel.grasp.shapes import Cylinder

FULL_RECIPE = """
grasps = 500
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


@pytest.fixture
def folder(tmp_path):
    """Return a folder with the mesh of a ball in millimetres, away from the origin."""
    ball = build_sphere(0.03)
    write_mesh(
        TriangleMesh("ball", 1e3 * ball.vertices + np.array([5.0, 5.0, 50.0]), ball.faces), tmp_path / "ball.stl"
    )
    return tmp_path


def write_recipe(folder, text):
    """Write a recipe file and return its path."""
    path = folder / "recipe.toml"
    path.write_text(text)
    return path


def test_values_of_all_tables_of_a_recipe_file_are_read(folder):
    recipe = read_recipe(write_recipe(folder, FULL_RECIPE))
    assert (recipe.grasps, recipe.seed, recipe.grasps_per_shard, recipe.shards, recipe.fidelity) == (
        500,
        7,
        50,
        10,
        "full",
    )
    assert [(kind.name, kind.share, kind.approaches) for kind in recipe.objects] == [
        ("can", 2.0, "any"),
        ("ball", 1.0, "any"),
    ]
    assert recipe.objects[0].sizes == {"radius_mm": Range(18.0, 25.0), "height_mm": fixed(120.0)}
    assert recipe.grasp.grip == Range(0.5, 1.5)
    assert recipe.simulator.layer_stiffness == fixed(1.2)
    assert [effect.name for effect in recipe.effects] == ["noise"]
    assert recipe.digest != Recipe().digest


def test_recipe_of_another_hand_has_its_own_test_objects(folder):
    """The sizes range from -8 % to +8 %. The cylinder has a radius of 21 mm for allegro, 20 mm for the default hand."""
    recipe = read_recipe(write_recipe(folder, 'hand = "allegro"\n'))
    assert recipe.hand == "allegro"
    for each, radius_mm in ((recipe, 21.0), (Recipe(), 20.0)):
        cylinder = next(kind for kind in each.objects if kind.name == "cylinder")
        radius = cylinder.sizes["radius_mm"]
        assert (radius.low, radius.high) == pytest.approx((0.92 * radius_mm, 1.08 * radius_mm))
    assert recipe.digest != Recipe().digest


def test_default_hand_of_a_recipe_is_the_original_one():
    assert Recipe().to_json()["hand"] == "original"


def test_recorded_grasp_keeps_the_palms_distance_from_a_wider_object_and_is_shifted_by_the_samples():
    """The axes of the palm are x towards the object, y upwards along the axis of the object, z towards the fingertips.

    A sample `press_mm` shifts the palm along x, `reach_mm` against z, `along_mm` against y; `turn_deg` turns the grasp
    about the vertical axis of the object.
    """
    setup = Setup()
    approach = setup.approach(PlannedGrasp("", "cylinder", "side_1", 0, 0))
    zero = dict.fromkeys(("turn_deg", "reach_mm", "along_mm", "thumb_deg"), 0.0) | {"press_mm": 1e3 * RECORDED_PRESS_M}
    nominal, wider = setup.objects["cylinder"].shape, Cylinder(0.022, 0.215)
    x, y, z = approach.palm_pose[:3, :3].T

    def compute_shift(shape, **sampled):
        """Compute how far the palm is shifted from the recorded grasp, f64[3], metres."""
        shifted = shift_recorded_approach(approach, shape, nominal, zero | sampled)
        return shifted.palm_pose[:3, 3] - approach.palm_pose[:3, 3]

    assert np.abs(compute_shift(nominal)).max() < 1e-12
    assert compute_shift(wider) @ x == pytest.approx(-0.002, abs=1e-4)  # radius 22 mm instead of 20 mm
    assert compute_shift(nominal, press_mm=2.0) == pytest.approx(0.0005 * x)  # 1.5 mm is the recorded grasp
    assert compute_shift(nominal, reach_mm=3.0) == pytest.approx(-0.003 * z)
    assert compute_shift(nominal, along_mm=4.0) == pytest.approx(-0.004 * y)
    turned = shift_recorded_approach(approach, nominal, nominal, zero | {"turn_deg": 6.0})
    assert np.linalg.norm(turned.palm_pose[:2, 3]) == pytest.approx(np.linalg.norm(approach.palm_pose[:2, 3]))
    thumb = shift_recorded_approach(approach, nominal, nominal, zero | {"thumb_deg": 4.0})
    assert np.array_equal(
        np.isfinite(thumb.base_targets), np.isfinite(approach.base_targets)
    )  # the same joints are held


def test_samples_are_in_their_ranges_and_every_kind_of_object_has_its_share(folder):
    recipe = read_recipe(write_recipe(folder, FULL_RECIPE))
    samples = [sample_grasp(recipe, number) for number in range(300)]
    names = [sample.kind.name for sample in samples]
    assert 160 < names.count("can") < 240  # two of three
    radii = [sample.values["radius_mm"] for sample in samples if sample.kind.name == "can"]
    assert 18.0 <= min(radii) < 18.5
    assert 24.5 < max(radii) <= 25.0
    assert {sample.approach for sample in samples} == {"side", "top"}
    assert len({sample.item.name for sample in samples}) == 300


def test_every_shard_has_a_sensor_model_within_the_ranges(folder):
    recipe = read_recipe(write_recipe(folder, FULL_RECIPE))
    sensors = {sample_sensor(recipe, shard).half_force_n for shard in range(5)}
    assert len(sensors) == 5
    assert all(1.4 <= force <= 2.0 for force in sensors)


def test_samples_of_a_grasp_do_not_depend_on_the_number_of_grasps(folder):
    few, many = (read_recipe(write_recipe(folder, FULL_RECIPE.replace("500", str(count)))) for count in (100, 100_000))
    assert sample_grasp(few, 42).values == sample_grasp(many, 42).values


def test_mesh_becomes_its_reduced_convex_hull_upright_at_the_origin(folder):
    kind = add_mesh(Recipe(), folder / "ball.stl", "mm").objects[-1]
    assert kind.name == "ball"
    assert len(kind.hull) == MAX_CORNERS
    assert 0.0 < kind.outside_m < 0.003
    low, high = kind.solid({"scale": 1.0}, "ball").shape.bounds
    assert low == pytest.approx([-0.03, -0.03, 0.0], abs=1e-6)
    assert high == pytest.approx([0.03, 0.03, 0.06], abs=1e-6)
    assert np.ptp(kind.solid({"scale": 1.1}, "ball").shape.bounds, axis=0) == pytest.approx([0.066] * 3)


def test_mesh_with_holes_is_accepted(folder):
    (folder / "open.obj").write_text("v 0 0 0\nv 0.05 0 0\nv 0 0.05 0\nv 0 0 0.05\nf 1 2 3\nf 1 2 4\n")
    assert len(add_mesh(Recipe(), folder / "open.obj", "m").objects[-1].hull) == 4


@pytest.mark.parametrize(
    ("line", "replacement", "message"),
    [
        ("grasps = 500", "grasps = 0", "grasps: expected an integer from 1 to 1000000000, found 0"),
        ("seed = 7", "sede = 7", "sede: expected one of grasps, seed, "),
        ('fidelity = "full"', 'fidelity = "best"', "fidelity: expected one of quick, full, found 'best'"),
        ("[18, 25]", "[25, 18]", r"object\[0\].radius_mm: expected a number or \[lowest, highest\] from 5 to 500"),
        ("height_mm = 120", "depth_mm = 120", r"object\[0\].depth_mm: expected a key of a cylinder "),
        ("height_mm = 120", "", r"object\[0\]: expected a key height_mm, found none; add it"),
        ('name = "ball"', 'name = "can"', "object: expected each name once, found 'can'; rename one"),
        ('unit = "mm"', 'unit = "m"', "vertices: expected a size of 0.005 to 0.5 m, found 60 m; give its unit"),
        (
            "half_force_n = [1.4, 2.0]",
            "half_force_n = 0",
            "sensor.half_force_n: expected a finite number above 0, found 0.0",
        ),
        ("layer_stiffness = 1.2", "friction = 0.5", 'simulator.friction: expected 0 unless sensing is "rigid"'),
        ("top_share = 0.5", "top_share = 2", "grasp.top_share: expected a number from 0 to 1, found 2"),
        ("white_counts = [0, 20]", "loud = 3", "loud: expected one of white_counts, "),
        ("grasps = 500", "grasps = 500 500", "line 2, column 14: expected valid TOML, found "),
    ],
)
def test_invalid_recipe_is_refused_with_a_one_line_message(folder, line, replacement, message):
    assert line in FULL_RECIPE
    with pytest.raises(RecipeError, match=message) as caught:
        read_recipe(write_recipe(folder, FULL_RECIPE.replace(line, replacement)))
    assert "\n" not in str(caught.value)
