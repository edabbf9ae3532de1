"""Components of the floor: isolated sources, selected grasps, and the floors of datasets with known variances."""

from dataclasses import replace

import numpy as np
import pytest

from host.tests.recording.test_grasp_writer import N, S, make_header, make_record
from taxel.campaign.floor_components import (
    ALL,
    SOURCES,
    FloorComponents,
    compute_components,
    isolate_source,
    pool,
    select_grasps,
)
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.variation import NO_VARIATION, Variation
from taxel.grasp.plan import make_thesis_plan
from taxel.recording.grasp_writer import GraspDatasetWriter

KEYS = [("cylinder", "side_1"), ("triangular_prism", "side_1")]
BASELINE = 30_000
SESSIONS = 4


def test_each_source_keeps_only_its_own_variation():
    settings = EmulatedSettings(effects=("noise white counts=8", "spread film length_m=0.002"))
    variations = {source: isolate_source(settings, source).variation for source in SOURCES}
    full = Variation()
    assert variations["object pose"] == replace(NO_VARIATION, object_m=full.object_m, object_rad=full.object_rad)
    assert variations["grip"] == replace(NO_VARIATION, grip=full.grip)
    assert variations["mounting"] == replace(NO_VARIATION, remount_m=full.remount_m, remount_rad=full.remount_rad)
    # Finger bases depend on the iteration of a grasp, and noise on other settings: no field of `Variation` has them.
    assert variations["finger bases"] == variations["noise"] == NO_VARIATION


def test_all_sources_together_leave_the_settings_unchanged():
    settings = EmulatedSettings(effects=("noise white counts=8", "spread film length_m=0.002"))
    assert isolate_source(settings, ALL) == settings


def test_only_the_source_noise_has_noise_and_all_sources_have_the_other_effects():
    noise, spread = "noise white counts=8", "spread film length_m=0.002"
    settings = EmulatedSettings(effects=(noise, spread))
    for source in SOURCES:
        isolated = isolate_source(settings, source)
        has_noise = source == "noise"
        assert isolated.noise_counts == (settings.noise_counts if has_noise else 0.0)
        assert isolated.effects == ((noise, spread) if has_noise else (spread,))


def test_one_grasp_of_each_condition_and_session_is_selected_with_equal_finger_bases():
    """Two conditions in six sessions give 12 grasps. Grasps of one iteration have equal finger bases."""
    plan = make_thesis_plan(1)
    grasps = select_grasps(plan, KEYS, "grip")
    assert len(grasps) == len({(grasp.object, grasp.session) for grasp in grasps}) == 12
    assert {grasp.iteration for grasp in grasps} == {0}
    varied = select_grasps(plan, KEYS, ALL)
    assert [grasp.id for grasp in varied] == [grasp.id for grasp in grasps]
    assert {grasp.iteration for grasp in varied} != {0}


def write_signals(path, signals: np.ndarray) -> None:
    """Write a dataset with one grasp per session. signals: signal of all taxels in each session's hold, counts."""
    record = make_record(0)
    frames = len(record.phase)
    phase = np.repeat([0, 2], [frames // 2, frames - frames // 2]).astype(np.uint8)
    with GraspDatasetWriter.create(path, make_header()) as out:
        for session, signal in enumerate(signals.tolist()):
            counts = np.full((frames, N), BASELINE, np.uint16)
            counts[phase == 2] -= np.uint16(signal)
            valid = np.ones((frames, S), bool)
            out.add(replace(record, session=session, phase=phase, raw_counts=counts, valid=valid))


def test_floors_of_sources_are_standard_errors_of_the_mean_over_sessions(tmp_path):
    """The signals of the sessions deviate by +d and -d in turn; `scale` times d is the standard error of their mean.

    The deviations 30 and 40 add up in squares to 50, so the sum of the components equals the total.
    """
    deviations = {"object pose": 30.0, "grip": 40.0, "mounting": 0.0, "finger bases": 0.0, "noise": 0.0, ALL: 50.0}
    signs = np.array([1.0, -1.0, 1.0, -1.0])
    paths = {source: tmp_path / f"{source}.h5" for source in deviations}
    for source, deviation in deviations.items():
        write_signals(paths[source], 500.0 + deviation * signs)
    (floor,) = compute_components(paths).values()
    scale = np.sqrt(SESSIONS / (SESSIONS - 1) / SESSIONS)
    assert floor.taxels == N
    assert floor.components == pytest.approx({source: scale * deviations[source] for source in SOURCES})
    assert floor.total == pytest.approx(scale * 50.0)
    assert floor.sum == pytest.approx(floor.total)


def test_the_interval_of_the_floor_is_that_of_the_chi_squared_distribution():
    """Six sessions have 5 degrees of freedom, with the quantiles 1.1455 (0.05) and 11.070 (0.95) in any table."""
    part = FloorComponents(10, {"grip": 3.0}, 10.0, (0.0, 0.0))
    pooled = pool([part], sessions=6)
    assert pooled.interval == pytest.approx((10.0 * np.sqrt(5 / 11.070), 10.0 * np.sqrt(5 / 1.1455)), rel=1e-3)


def test_floors_of_conditions_are_pooled_by_their_root_mean_square():
    parts = [FloorComponents(10, {"grip": 3.0}, 6.0, (0.0, 0.0)), FloorComponents(20, {"grip": 4.0}, 8.0, (0.0, 0.0))]
    pooled = pool(parts, sessions=6)
    assert pooled.taxels == 30
    assert pooled.components["grip"] == pytest.approx(np.sqrt(12.5))  # (3^2 + 4^2) / 2
    assert pooled.total == pytest.approx(np.sqrt(50.0))  # (6^2 + 8^2) / 2
    # Two conditions have 10 degrees of freedom. The 5 of a single condition would give 0.67 times the total.
    assert pooled.interval[0] > 0.7 * pooled.total
