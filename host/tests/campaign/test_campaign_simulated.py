"""A campaign in the simulator: dataset, sensing levels, and conversion of force into counts."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from taxel.campaign.failure import Failure
from taxel.campaign.outcomes import OutcomeCount, count_outcomes
from taxel.campaign.point_counts import count_contact_points
from taxel.campaign.simulated import SimSettings, run_simulated, simulate_planned_grasp
from taxel.campaign.variation import NO_VARIATION
from taxel.grasp.timeline import Phase
from taxel.recording.errors import DatasetError
from taxel.recording.grasp_dataset import GraspDataset
from taxel.sim.sensing import LEVELS, Sensing
from taxel.sim.sensor_model import SimSensor


def read_grasps(path) -> dict[str, bytes]:
    """Read the numeric datasets of a file, and the attributes of everything below its root, by name."""
    items: dict[str, bytes] = {}

    def visit(name: str, item) -> None:
        """Add the attributes and the values of one item of the file to `items`."""
        items.update({f"{name}@{key}": np.asarray(value).tobytes() for key, value in item.attrs.items() if name})
        if isinstance(item, h5py.Dataset) and item.dtype.kind != "O":
            items[name] = np.asarray(item[()]).tobytes()

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    return items


@pytest.fixture(scope="module")
def settings(timeline):
    return SimSettings(timeline=timeline)


@pytest.fixture(scope="module")
def complete_file(setup, plan, settings, tmp_path_factory):
    """Simulate the plan in one process; return the path of its dataset."""
    path = tmp_path_factory.mktemp("complete") / "sim.h5"
    run_simulated(path, plan, settings, setup, jobs=1)
    return path


def test_the_file_is_a_simulated_dataset_of_the_plan(complete_file, plan, timeline):
    with GraspDataset(complete_file) as data:
        data.check()
        assert (data.source, data.hand, data.ids) == ("sim", "original", tuple(planned.id for planned in plan))
        assert "layer sensing" in data.generator
        for grasp in data:
            assert grasp.phase.tolist() == timeline.find_phases(grasp.timestamp).tolist()
            assert grasp.valid.all()
            assert grasp.joint_position.shape == (len(grasp.timestamp), 22)


def test_the_grasped_cylinder_has_contact_points(complete_file):
    assert count_contact_points(complete_file)["cylinder"].points > 20


def test_the_dataset_states_the_sensor_model_with_the_areas_of_the_taxels(complete_file, settings, setup):
    with GraspDataset(complete_file) as data:
        model, sensor = data.sensor_model, settings.sensor
    assert model.baseline_counts == sensor.baseline_counts
    assert model.full_scale_drop_counts == sensor.full_scale_drop_counts
    assert model.noise_counts == sensor.noise_counts
    assert np.allclose(model.half_force_n, sensor.half_force_n * setup.hand.area_share)
    assert model.contact_stiffness_n_per_m == settings.sensing.stiffness_n_per_m
    assert model.layer == "uncoupled"


def test_counts_agree_with_the_stated_sensor_model_and_noise(complete_file):
    with GraspDataset(complete_file) as data:
        grasp, model = data[data.ids[0]], data.sensor_model
        signal = model.full_scale_drop_counts * grasp.contact_force / (grasp.contact_force + model.half_force_n)
        noise = grasp.raw_counts - (model.baseline_counts - signal)
    assert noise.mean() == pytest.approx(0.0, abs=0.1)
    rounding = 12**-0.5  # standard deviation of the rounding to whole counts
    assert noise.std() == pytest.approx(np.hypot(model.noise_counts, rounding), rel=0.03)


def test_taxels_with_force_are_indented_and_indented_taxels_have_force(complete_file):
    """Separation is measured at a taxel's centre and force over its whole square: they disagree only at edges."""
    with GraspDataset(complete_file) as data:
        for grasp in data:
            assert grasp.contact_force.min() >= 0
            assert not grasp.contact_force[grasp.phase == Phase.BASELINE].any()
            hold = grasp.phase == Phase.HOLD
            force, separation = grasp.contact_force[hold], grasp.separation[hold]
            assert force.sum(axis=1).min() > 5.0
            assert (force[separation < -1e-4] > 0).all()
            assert force[separation < 2e-4].sum() > 0.85 * force.sum()


def test_one_and_two_processes_make_files_with_the_same_content(complete_file, plan, settings, tmp_path):
    run_simulated(tmp_path / "sim.h5", plan, settings, jobs=2)
    assert read_grasps(tmp_path / "sim.h5") == read_grasps(complete_file)


def test_an_interrupted_campaign_leaves_a_valid_file_and_resumes_to_the_same_content(
    complete_file, plan, settings, setup, tmp_path
):
    def interrupt(done: int, total: int) -> None:
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_simulated(tmp_path / "sim.h5", plan, settings, setup, jobs=1, progress=interrupt)
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        assert data.ids == (plan[0].id,)
    progress = []
    run_simulated(
        tmp_path / "sim.h5",
        plan,
        settings,
        setup,
        jobs=1,
        resume=True,
        progress=lambda *counts: progress.append(counts),
    )
    assert read_grasps(tmp_path / "sim.h5") == read_grasps(complete_file)
    assert progress == [(1, 2), (2, 2)]


@pytest.mark.parametrize("options", [{"resume": True}, {}])
def test_a_file_of_other_settings_is_rejected_with_and_without_resume(options, complete_file, plan, settings, setup):
    with pytest.raises(DatasetError) as caught:
        run_simulated(complete_file, plan, replace(settings, seed=2), setup, **options)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("level", LEVELS)
def test_every_level_makes_a_valid_file_that_states_its_layer(level, plan, timeline, setup, tmp_path):
    settings = SimSettings(sensing=Sensing(level), timeline=timeline)
    run_simulated(tmp_path / "sim.h5", plan[:1], settings, setup, jobs=1)
    with GraspDataset(tmp_path / "sim.h5") as data:
        data.check()
        assert data.sensor_model.layer == ("coupled" if level == "coupled" else "uncoupled")
        assert f"{level} sensing" in data.generator
        assert (data[data.ids[0]].contact_force > 0).any()


def test_noise_depends_only_on_seed_and_grasp(setup, plan, settings):
    settings = replace(settings, sensing=Sensing("rigid"))
    counts = [simulate_planned_grasp(setup, planned, settings).raw_counts for planned in (plan[0], plan[1], plan[0])]
    assert (counts[0] == counts[2]).all()
    assert (counts[0][0] != counts[1][0]).any()
    other_seed = simulate_planned_grasp(setup, plan[0], replace(settings, seed=2))
    assert (counts[0] != other_seed.raw_counts).any()
    noiseless = replace(settings, sensor=SimSensor(noise_counts=0.0))
    first_frame = simulate_planned_grasp(setup, plan[0], noiseless).raw_counts[0]
    assert (first_frame == round(noiseless.sensor.baseline_counts)).all()


@pytest.fixture(scope="module")
def displaced_settings(settings):
    """Return settings that place the object 30 mm beside its pose on each axis.

    With this seed, one of the two grasps fails in its first attempt.
    """
    return replace(settings, variation=replace(NO_VARIATION, object_m=0.03), seed=8)


@pytest.fixture(scope="module")
def displaced_file(setup, plan, displaced_settings, tmp_path_factory):
    """Simulate the plan with displaced objects in one process; return the path of its dataset."""
    path = tmp_path_factory.mktemp("displaced") / "sim.h5"
    run_simulated(path, plan, displaced_settings, setup, jobs=1)
    return path


def test_a_failed_grasp_is_repeated_and_counted(displaced_file):
    with GraspDataset(displaced_file) as data:
        assert [(grasp.attempts, grasp.failure) for grasp in data] == [(1, "none"), (2, "none")]
    assert count_outcomes(displaced_file) == {"cylinder": OutcomeCount(grasps=2, repeated=1)}


def test_a_grasp_whose_attempts_all_fail_is_kept_and_marked(setup, plan, displaced_settings):
    record = simulate_planned_grasp(setup, plan[1], replace(displaced_settings, max_attempts=1))
    assert record.attempts == 1
    assert record.failure in set(Failure)


def test_an_interrupted_campaign_resumes_with_the_same_attempts(
    setup, plan, displaced_settings, displaced_file, tmp_path
):
    path = tmp_path / "sim.h5"
    run_simulated(path, plan[:1], displaced_settings, setup, jobs=1)
    run_simulated(path, plan, displaced_settings, setup, jobs=1, resume=True)
    assert read_grasps(path) == read_grasps(displaced_file)


@pytest.mark.slow
def test_repeated_attempts_do_not_depend_on_the_number_of_processes(
    setup, plan, displaced_settings, displaced_file, tmp_path
):
    run_simulated(tmp_path / "sim.h5", plan, displaced_settings, setup, jobs=2)
    assert read_grasps(tmp_path / "sim.h5") == read_grasps(displaced_file)
