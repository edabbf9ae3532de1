"""Injected causes: every form changes the signal by its strength, and a world has the wanted gap."""

from __future__ import annotations

import shutil

import h5py
import numpy as np
import pytest

from taxel.blind.benchmark.bases import INDENTATION, BasePair
from taxel.blind.benchmark.worlds import INJECTED, sample_benchmark
from taxel.blind.hidden import UNKNOWN
from taxel.blind.injection.forms import INJECTED_FORMS
from taxel.blind.injection.inject import inject_causes
from taxel.blind.injection.skin_counts import GraspSignal, SkinTable
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.recording.grasp_format import Phase

SIDE, FRAMES, SEED = 5, 120, 7


def make_skin() -> SkinTable:
    """Two flat boards of 5 x 5 taxels."""
    number = np.arange(2 * SIDE * SIDE)
    tx, rx = (number % (SIDE * SIDE)) // SIDE, number % SIDE
    position = np.column_stack([0.005 * tx, 0.005 * rx, np.zeros(len(number))])
    return SkinTable(position, 0x20 + number // (SIDE * SIDE), tx, rx, 4000.0)


def make_grasp(skin: SkinTable) -> GraspSignal:
    """A contact in the middle of the first board, and a light one on the second."""
    centre = np.exp(-np.sum((skin.position - skin.position[12]) ** 2, axis=1) / 0.006**2)
    time = 0.05 * np.arange(FRAMES)
    level = np.clip((time - 2.0) / 0.5, 0.0, 1.0) - np.clip((time - 4.5) / 0.5, 0.0, 1.0)
    phase = np.select([time < 2.0, time < 2.5, time < 4.5, time < 5.0], [0, 1, 2, 3], 4).astype(np.uint8)
    signal = 1500.0 * level[:, None] * centre
    separation = np.where(signal > 0.0, -1e-4, 2e-3) * np.ones_like(signal)
    return GraspSignal(signal, time, phase, np.random.default_rng(SEED), separation)


@pytest.mark.parametrize("form", INJECTED_FORMS, ids=lambda form: f"{form.name}-{form.form}")
def test_a_form_changes_nothing_at_strength_0_and_more_with_the_strength(form):
    print("seed", SEED)
    skin = make_skin()
    inject = form.sample(skin, np.random.default_rng(SEED))
    plain = make_grasp(skin).signal
    none, some, much = (inject(make_grasp(skin), strength) - plain for strength in (0.0, 0.3, 1.0))
    assert np.abs(none).max() < 2.0
    assert np.isfinite(much).all()
    assert 0.0 < np.sqrt(np.mean(some**2)) <= 1.05 * np.sqrt(np.mean(much**2))
    rest = make_grasp(skin).phase == Phase.BASELINE
    if form.name in ("gain_mismatch", "stiffness", "saturation", "contact_propagation", "electrode_crosstalk"):
        assert np.abs(much[rest]).max() < 2.0


def test_forms_have_names_of_the_catalogue_or_are_unknown():
    assert {form.name for form in INJECTED_FORMS} == {*set(OWN_EFFECTS) - {"pose_error", "nonlinearity"}, UNKNOWN}
    labels = [(form.name, form.form) for form in INJECTED_FORMS]
    assert len(set(labels)) == len(labels)


def test_injected_worlds_share_bases_and_have_the_sampled_causes():
    worlds = sample_benchmark(60, 3, [INJECTED])
    assert len({world.source[0] for world in worlds}) == 10
    for world in worlds:
        assert [label.split(":")[0] for label in world.forms] == list(world.truth)
        assert len(world.floors) == len(world.truth)
        assert (world.kind == "none") == (not world.truth)


@pytest.mark.slow
def test_an_injected_cause_has_the_wanted_gap_and_a_base_is_made_once(tmp_path):
    base = BasePair(INDENTATION, 5)
    real, sim = base.provide(tmp_path / "bases")
    times = [path.stat().st_mtime_ns for path in (real, sim)]
    assert [path.stat().st_mtime_ns for path in base.provide(tmp_path / "bases")] == times
    (form,) = (one for one in INJECTED_FORMS if one.form == "ladder")
    (strength,) = inject_causes(real, sim, tmp_path / "real.h5", [form], [3.0], 1)
    assert strength > 0.0
    from taxel.gap.data.pair import read_pair
    from taxel.gap.data.prepare import prepare_pair
    from taxel.gap.features.metric import measure_gap

    fit_data = prepare_pair(read_pair(tmp_path / "real.h5", sim))
    gap = measure_gap(fit_data.sessions, fit_data.state.mean, fit_data.layout)
    assert gap.gap.value / gap.floor == pytest.approx(3.3, rel=0.3)
    shutil.copy(tmp_path / "real.h5", tmp_path / "again.h5")
    inject_causes(real, sim, tmp_path / "again.h5", [form], [3.0], 1)
    with h5py.File(tmp_path / "real.h5") as first, h5py.File(tmp_path / "again.h5") as second:
        for name in first["grasps"]:
            assert np.array_equal(first["grasps"][name]["raw_counts"][...], second["grasps"][name]["raw_counts"][...])
