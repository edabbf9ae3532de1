"""Injected causes: every form changes the signal according to its strength, and a world has the required gap."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from taxel.blind.benchmark.bases import INDENTATION, BasePair
from taxel.blind.benchmark.worlds import INJECTED, sample_benchmark
from taxel.blind.hidden import UNKNOWN
from taxel.blind.injection.forms import INJECTED_FORMS, RESERVED_FORMS
from taxel.blind.injection.inject import inject_causes
from taxel.blind.injection.skin_counts import GraspSignal, SkinTable
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.effects.catalogue import OWN_EFFECTS
from taxel.gap.features.metric import measure_gap
from taxel.recording.grasp_format import Phase

SIDE, FRAMES, SEED = 5, 120, 7


def make_skin() -> SkinTable:
    """Make the table of two flat boards of 5 x 5 taxels, both at the same position in their bracket frames."""
    number = np.arange(2 * SIDE * SIDE)
    tx, rx = (number % (SIDE * SIDE)) // SIDE, number % SIDE
    position = np.column_stack([0.005 * tx, 0.005 * rx, np.zeros(len(number))])
    return SkinTable(position, 0x20 + number // (SIDE * SIDE), tx, rx, 4000.0)


def make_grasp(skin: SkinTable) -> GraspSignal:
    """Make a grasp of 6 s with a contact in the middle of the boards: baseline, closing, hold, release, recovery."""
    centre = np.exp(-np.sum((skin.position - skin.position[12]) ** 2, axis=1) / 0.006**2)
    time = 0.05 * np.arange(FRAMES)
    level = np.clip((time - 2.0) / 0.5, 0.0, 1.0) - np.clip((time - 4.5) / 0.5, 0.0, 1.0)
    phase = np.select([time < 2.0, time < 2.5, time < 4.5, time < 5.0], [0, 1, 2, 3], 4).astype(np.uint8)
    signal = 1500.0 * level[:, None] * centre
    separation = np.where(signal > 0.0, -1e-4, 2e-3) * np.ones_like(signal)
    return GraspSignal(signal, time, phase, np.random.default_rng(SEED), separation)


ALL_FORMS = (*INJECTED_FORMS, *RESERVED_FORMS)


def get_form_id(form) -> str:
    return f"{form.name}-{form.form}"


def compute_change(form, strength: float) -> np.ndarray:
    """Return the change of the signal by a form at a strength, f64[T, n], counts."""
    print("seed", SEED)
    skin = make_skin()
    inject = form.sample(skin, np.random.default_rng(SEED))
    return inject(make_grasp(skin), strength) - make_grasp(skin).signal


@pytest.mark.parametrize("form", ALL_FORMS, ids=get_form_id)
def test_form_changes_the_signal_by_less_than_2_counts_at_strength_0_and_more_with_the_strength(form):
    none, some, much = (compute_change(form, strength) for strength in (0.0, 0.3, 1.0))
    assert np.abs(none).max() < 2.0
    assert np.isfinite(much).all()
    assert 0.0 < np.sqrt(np.mean(some**2)) <= 1.05 * np.sqrt(np.mean(much**2))


NEEDS_CONTACT = ("gain_mismatch", "stiffness", "saturation", "contact_propagation", "electrode_crosstalk")
"""Effects that only change the signals of a contact."""


@pytest.mark.parametrize("form", [form for form in ALL_FORMS if form.name in NEEDS_CONTACT], ids=get_form_id)
def test_form_of_an_effect_that_needs_contact_leaves_the_baseline_phase_unchanged(form):
    is_baseline = make_grasp(make_skin()).phase == Phase.BASELINE
    assert np.abs(compute_change(form, 1.0)[is_baseline]).max() < 2.0


@pytest.mark.parametrize("forms", [INJECTED_FORMS, RESERVED_FORMS], ids=["calibration", "reserved"])
def test_forms_cover_all_effects_but_pose_error_and_nonlinearity_and_causes_outside_the_catalogue(forms):
    assert {form.name for form in forms} == {*set(OWN_EFFECTS) - {"pose_error", "nonlinearity"}, UNKNOWN}


def test_pairs_of_effect_and_form_are_unique():
    labels = [(form.name, form.form) for form in ALL_FORMS]
    assert len(set(labels)) == len(labels)


def test_six_injected_worlds_share_a_base():
    worlds = sample_benchmark(60, 3, [INJECTED])
    assert len({world.source[0] for world in worlds}) == 10


def test_worlds_of_reserved_forms_contain_no_form_of_the_calibration():
    used = {get_form_id(form) for form in INJECTED_FORMS}
    labels = {label for world in sample_benchmark(60, 3, [INJECTED], RESERVED_FORMS) for label in world.forms}
    assert len(labels) > 10
    assert not used & {label.replace(": ", "-") for label in labels}


def test_injected_worlds_have_a_form_and_a_gap_for_each_hidden_cause():
    for world in sample_benchmark(60, 3, [INJECTED]):
        assert [label.split(":")[0] for label in world.forms] == list(world.truth)
        assert len(world.floors) == len(world.truth)
        assert (world.kind == "none") == (not world.truth)


BASE = BasePair(INDENTATION, 5)


@pytest.fixture(scope="module")
def bases(tmp_path_factory):
    """Folder that contains the datasets of `BASE`."""
    folder = tmp_path_factory.mktemp("bases")
    BASE.provide(folder)
    return folder


@pytest.mark.slow
def test_existing_base_is_not_made_again(bases):
    times = [path.stat().st_mtime_ns for path in BASE.provide(bases)]
    assert [path.stat().st_mtime_ns for path in BASE.provide(bases)] == times


@pytest.mark.slow
def test_injected_cause_of_3_floors_gives_a_gap_of_about_3_3_floors(bases, tmp_path):
    """The base pair itself has a gap of about one floor, and independent gaps add up as squares.

    The estimate sqrt(3^2 + 1^2) = 3.2 floors lies within the tolerance of 30 % around 3.3 floors.
    """
    real, sim = BASE.provide(bases)
    (form,) = (one for one in INJECTED_FORMS if one.form == "ladder")
    (size,) = inject_causes(real, sim, tmp_path / "real.h5", [form], floors=[3.0], seed=1)
    assert size == pytest.approx(3.0, rel=0.2)
    fit_data = prepare_pair(read_pair(tmp_path / "real.h5", sim))
    gap = measure_gap(fit_data.sessions, fit_data.state.mean, fit_data.layout)
    assert gap.gap.value / gap.floor == pytest.approx(3.3, rel=0.3)


@pytest.mark.slow
def test_sizes_of_several_injected_causes_are_those_of_each_cause_alone(bases, tmp_path):
    """The sizes of two causes are those of two worlds with one cause each, in relation to the floor of their own pair.

    The noise increases the floor, so that the other cause becomes smaller in floors.
    """
    real, sim = BASE.provide(bases)
    ladder, noise = (next(one for one in INJECTED_FORMS if test(one)) for test in (is_ladder, is_noise))
    both = inject_causes(real, sim, tmp_path / "both.h5", [ladder, noise], floors=[3.0, 6.0], seed=1)
    floors = {}
    for name, path in (("base", real), ("both", tmp_path / "both.h5")):
        pair = prepare_pair(read_pair(path, sim))
        floors[name] = measure_gap(pair.sessions, pair.state.mean, pair.layout).floor
    assert floors["both"] > floors["base"]
    assert both[0] == pytest.approx(3.0 * floors["base"] / floors["both"], rel=0.2)


def is_ladder(form):
    """Whether a form is the ladder of resistances."""
    return form.form == "ladder"


def is_noise(form):
    """Whether a form is a noise."""
    return form.name == "noise"


@pytest.mark.slow
def test_strength_of_an_injected_cause_is_limited(bases, tmp_path):
    """A gap of 10,000 floors requires a strength beyond the limit; the size states the gap that was reached."""
    real, sim = BASE.provide(bases)
    (form,) = filter(is_ladder, INJECTED_FORMS)
    (size,) = inject_causes(real, sim, tmp_path / "real.h5", [form], floors=[1e4], seed=1)
    assert 1.0 < size < 1e3


@pytest.mark.slow
def test_injection_is_determined_by_its_seed(bases, tmp_path):
    real, sim = BASE.provide(bases)
    (form,) = (one for one in INJECTED_FORMS if one.form == "ladder")
    for name in ("first.h5", "second.h5"):
        inject_causes(real, sim, tmp_path / name, [form], floors=[3.0], seed=1)
    with h5py.File(tmp_path / "first.h5") as first, h5py.File(tmp_path / "second.h5") as second:
        for name in first["grasps"]:
            assert np.array_equal(first["grasps"][name]["raw_counts"][...], second["grasps"][name]["raw_counts"][...])
