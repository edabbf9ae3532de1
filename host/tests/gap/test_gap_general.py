"""Datasets of other sensors (version 2): three modalities, with wrong or incomplete input."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from taxel.blind.benchmark.modalities import SENSORS, ModalityWorld, sample_modality_worlds
from taxel.cli.main import build_app
from taxel.errors import TaxelError
from taxel.gap.comparison.compare import compare
from taxel.gap.data.general_pair import open_pair
from taxel.gap.data.missing_inputs import FORCES, GEOMETRY, LINES, PHASES
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.effects.catalogue import OWN_EFFECTS, find_unavailable_reason
from taxel.gap.features.metric import measure_gap
from taxel.recording.general import GeneralDataset, Properties, TaxelPlaces, write_general


@pytest.fixture(scope="module", params=SENSORS)
def pair(request, tmp_path_factory) -> tuple[Path, Path]:
    """Paths of a real and a simulated dataset of one modality without a cause."""
    folder = tmp_path_factory.mktemp("pair")
    world = ModalityWorld(request.param, "", 1.0, 77, sessions=4, repeats=1, conditions=7)
    world.make(folder / "real.h5", folder / "sim.h5")
    return folder / "real.h5", folder / "sim.h5"


def rewrite_dataset(source: Path, target: Path, change=lambda contact: contact, **header) -> Path:
    """Write a copy of a dataset with changed contacts (None: excluded) and a changed header."""
    with GeneralDataset(source) as data:
        contacts = [other for contact in data if (other := change(contact)) is not None]
        write_general(target, replace(data.header, **header), contacts)
    return target


def get_refusal(real: Path, sim: Path) -> str:
    """Return the error line of a pair that cannot be compared."""
    with pytest.raises(TaxelError) as caught:
        compare(real, sim)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def join_losses(real: Path, sim: Path) -> str:
    return " | ".join(read_pair(real, sim).losses)


def test_a_pair_without_a_cause_has_no_gap_above_its_floor(pair):
    fit_data = prepare_pair(read_pair(*pair))
    gap = measure_gap(fit_data.sessions, fit_data.state.mean, fit_data.layout)
    assert gap.gap.value < 1.4 * gap.floor


def test_effects_that_need_absent_data_are_unavailable_with_a_reason(pair):
    state = prepare_pair(read_pair(*pair)).state
    assert state.pair.missing_inputs >= {LINES, FORCES}
    reasons = {name: find_unavailable_reason(state, forms) for name, forms in OWN_EFFECTS.items()}
    assert "no electrode lines" in reasons["electrode_crosstalk"]
    assert "no contact force" in reasons["stiffness"]
    available = {name for name, reason in reasons.items() if not reason}
    assert available == {
        *("contact_propagation", "noise", "gain_mismatch", "nonlinearity", "baseline_drift"),
        *("hysteresis", "saturation", "dropout", "latency"),
    }


def test_a_reversed_sign_is_rejected(pair, tmp_path):
    undeclared = replace(read_header(pair[1]).properties, contact=None)
    negative = rewrite_dataset(pair[1], tmp_path / "sim.h5", negate_values, properties=undeclared)
    line = get_refusal(pair[0], negative)
    assert "sign" in line or "contact lowers" in line


def negate_values(contact):
    return replace(contact, values=-contact.values)


def read_header(path: Path):
    with GeneralDataset(path) as data:
        return data.header


def test_a_declared_direction_that_the_values_contradict_is_rejected(pair, tmp_path):
    if read_header(pair[0]).properties.contact is None:
        pytest.skip("the direction of a vector taxel is not declared")
    assert "contact lowers" in get_refusal(rewrite_dataset(pair[0], tmp_path / "real.h5", negate_values), pair[1])


def test_another_unit_is_rejected_whether_it_is_declared_or_not(pair, tmp_path):
    def scale(contact):
        return replace(contact, values=1000.0 * contact.values)

    unit = replace(read_header(pair[1]).properties, unit="mV", full_scale=None)
    assert "convert the values" in get_refusal(
        pair[0], rewrite_dataset(pair[1], tmp_path / "a.h5", scale, properties=unit)
    )
    nothing = replace(unit, unit=None)
    other = rewrite_dataset(pair[1], tmp_path / "b.h5", scale, properties=nothing)
    assert "declare the unit in both files" in get_refusal(pair[0], other)


@pytest.mark.parametrize("is_shuffled", [False, True])
def test_an_exchange_of_taxels_is_rejected_or_stated_as_unobservable(pair, tmp_path, is_shuffled):
    with GeneralDataset(pair[1]) as data:
        signal = np.mean([np.abs(one.values - one.values[0]).max(axis=0).reshape(data.n, -1).sum(1) for one in data], 0)
        order = np.arange(data.n)
        # The taxel with the strongest signal, and a taxel whose signal is clearly different but still strong.
        strong = np.argsort(-signal)[:: max(data.n // 8, 1)][:2]
        order[strong] = order[strong[::-1]]
        if is_shuffled:
            order = np.random.default_rng(3).permutation(data.n)
    changed = rewrite_dataset(pair[0], tmp_path / "real.h5", lambda one: replace(one, values=one.values[:, order]))
    # The contacts load all taxels of the capacitive plate equally, so an exchange does not change the signals.
    if "capacitive" in read_header(pair[0]).sensor:
        assert "do not determine the order of the taxels" in join_losses(changed, pair[1])
    else:
        assert "correct the order of the columns" in get_refusal(changed, pair[1])


def test_one_session_gives_an_unknown_verdict_with_a_reason(pair, tmp_path):
    def keep(contact):
        return contact if contact.session == 0 else None

    one = rewrite_dataset(pair[0], tmp_path / "real.h5", keep)
    words = ["gap", "diagnose", str(one), str(pair[1]), "--out", str(tmp_path / "gap")]
    result = CliRunner().invoke(build_app("gap"), words)
    assert result.exit_code == 0, result.output
    verdict = json.loads((tmp_path / "gap" / "report.json").read_text())["verdict"]
    assert verdict["status"] == "unknown"
    assert "too few sessions for a verdict: 1 recorded, needs 3" in verdict["reasons"]


def test_missing_repeats_unequal_rates_and_gaps_in_time_are_stated(pair, tmp_path):
    once = rewrite_dataset(pair[0], tmp_path / "a.h5", lambda one: one if one.session == 0 else None)
    assert "no condition was repeated" in join_losses(once, pair[1])

    def halve(contact):
        return replace(contact, time=contact.time[::2], values=contact.values[::2], phase=contact.phase[::2])

    slow = rewrite_dataset(pair[1], tmp_path / "b.h5", halve)
    rates = [part for part in join_losses(pair[0], slow).split(" | ") if "frames per second" in part]
    assert len(rates) == 2
    fit_data = prepare_pair(read_pair(pair[0], slow))
    gap_counts = measure_gap(fit_data.sessions, fit_data.state.mean, fit_data.layout).gap.value
    assert gap_counts < 25.0  # half the frame rate alone is no gap; the signals are hundreds of counts

    def interrupt(contact):
        rows = np.r_[0:20, 30 : len(contact.time)]
        return replace(contact, time=contact.time[rows], values=contact.values[rows], phase=contact.phase[rows])

    interrupted = rewrite_dataset(pair[0], tmp_path / "c.h5", interrupt)
    assert "gaps in time" in join_losses(interrupted, pair[1])


def test_phases_are_detected_from_the_values_if_they_are_not_stated(pair, tmp_path):
    paths = [
        rewrite_dataset(path, tmp_path / f"{k}.h5", lambda one: replace(one, phase=None)) for k, path in enumerate(pair)
    ]
    with open_pair(*paths) as opened, GeneralDataset(pair[0]) as data:
        assert PHASES in opened.missing_inputs
        for made, contact in zip(opened.real, data, strict=True):
            agreeing = (made.phase == contact.phase).mean()
            assert agreeing > 0.8


def test_without_positions_a_spread_is_unavailable(pair, tmp_path):
    paths = [rewrite_dataset(path, tmp_path / f"{k}.h5", places=TaxelPlaces()) for k, path in enumerate(pair)]
    state = prepare_pair(read_pair(*paths)).state
    assert GEOMETRY in state.pair.missing_inputs
    # The last two forms spread signals, which needs positions. The other forms spread contact forces.
    assert "no positions" in find_unavailable_reason(state, OWN_EFFECTS["contact_propagation"][-2:])


def test_frames_at_the_edge_of_two_nodes_do_not_depend_on_rounding_of_times(pair, tmp_path):
    """Times with another origin are rounded differently, but the mean signals in the time nodes remain the same."""

    def shift(contact):
        return replace(contact, time=contact.time - 1234.5678 + 7e4 * contact.session)

    moved = rewrite_dataset(pair[0], tmp_path / "real.h5", shift)
    first, second = (read_pair(path, pair[1]).real.node_signal_counts for path in (pair[0], moved))
    np.testing.assert_allclose(first, second, atol=1e-3)


def test_two_real_datasets_have_the_variance_of_both_in_the_floor(pair, tmp_path):
    """Two halves of one real dataset without a cause, with two sessions each, are compared with `--real-real`; without
    this option the pair is refused.

    The squared floor is the sum of the variances of both means. With equal variances, the floor is sqrt(2) = 1.41 times
    the floor of one half beside the simulation. The limit 1.1 permits the error of variances from two sessions. The
    status is not "explained", because there is no cause, and because a verdict needs three sessions.
    """
    days = []
    for day in range(2):
        sessions = [2 * day, 2 * day + 1]
        days.append(
            rewrite_dataset(
                pair[0], tmp_path / f"{day}.h5", lambda one, kept=sessions: one if one.session in kept else None
            )
        )
    words = ["gap", "diagnose", *map(str, days), "--out", str(tmp_path / "gap")]
    with pytest.raises(TaxelError, match="--real-real"):
        CliRunner().invoke(build_app("gap"), words, catch_exceptions=False)
    result = CliRunner().invoke(build_app("gap"), [*words, "--real-real"])
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "gap" / "report.json").read_text())
    assert report["verdict"]["status"] != "explained"
    alone = prepare_pair(read_pair(days[0], pair[1]))
    single = measure_gap(alone.sessions, alone.state.mean, alone.layout).floor
    assert report["gap"]["floor"] > 1.1 * single


@pytest.mark.parametrize(
    ("sensor", "cause"),
    [
        ("resistive mat", "contact_propagation"),
        ("magnetic pad", "saturation"),
        ("capacitive plate", "dropout"),
    ],
)
def test_a_hidden_cause_is_named_first(sensor, cause, tmp_path):
    real, sim = tmp_path / "real.h5", tmp_path / "sim.h5"
    ModalityWorld(sensor, cause, 1.0, 4, sessions=3, repeats=2, conditions=7).make(real, sim)
    probabilities = compare(real, sim).compute_probabilities()
    assert max(probabilities, key=probabilities.__getitem__) == cause


def test_worlds_have_causes_of_every_kind():
    worlds = sample_modality_worlds(40, 1, "resistive mat")
    assert len(worlds) == 40
    causes = [world.cause for world in worlds]
    # A fifth of the worlds has no cause, an eighth an unknown one; the others have one of the 9 possible causes.
    assert causes.count("") == 8
    assert causes.count("unknown") == 5
    assert len(set(causes)) == 11
    assert worlds == sample_modality_worlds(40, 1, "resistive mat")


def test_wrong_declarations_are_rejected_with_one_line(pair, tmp_path):
    with pytest.raises(TaxelError, match="expected one of raises, lowers, signed"):
        rewrite_dataset(pair[0], tmp_path / "a.h5", properties=Properties(contact="up"))
    with pytest.raises(TaxelError, match="expected shape"):
        rewrite_dataset(pair[0], tmp_path / "b.h5", places=TaxelPlaces(position=np.zeros((3, 3))))
    assert not list(tmp_path.iterdir())


def test_an_offset_of_the_rest_values_is_stated_and_is_no_gap(pair, tmp_path):
    scale = read_header(pair[0]).properties.full_scale
    moved = rewrite_dataset(pair[0], tmp_path / "real.h5", lambda one: replace(one, values=one.values + 0.5 * scale))
    assert "the rest values differ by" in join_losses(moved, pair[1])
    first, second = (prepare_pair(read_pair(path, pair[1])) for path in (pair[0], moved))
    gaps = [
        measure_gap(fit_data.sessions, fit_data.state.mean, fit_data.layout).gap.value for fit_data in (first, second)
    ]
    assert gaps[0] == pytest.approx(gaps[1], rel=1e-3)


def test_show_draws_maps_and_states_the_size_of_the_datasets(pair, tmp_path):
    result = CliRunner().invoke(build_app("show"), ["show", *map(str, pair), "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "maps.png").stat().st_size > 10_000
    with GeneralDataset(pair[0]) as data:
        assert f"{len(data)} contacts in 4 sessions" in result.output
    assert "contacts in 1 session\n" in result.output


def test_the_report_of_a_sensor_without_lines_names_no_line(pair, tmp_path):
    real = rewrite_dataset(pair[0], tmp_path / "real.h5", lambda one: replace(one, values=1.3 * one.values))
    words = ["gap", "diagnose", str(real), str(pair[1]), "--out", str(tmp_path / "gap")]
    result = CliRunner().invoke(build_app("gap"), words)
    assert result.exit_code == 0, result.output
    report = json.loads((tmp_path / "gap" / "report.json").read_text())
    assert report["where"]["lines"] == []
    assert report["inputs"]["unit"]["name"] == read_header(pair[0]).properties.unit
    assert "lines" in report["inputs"]["lacking"]
    unavailable = {one["name"]: one["reason"] for one in report["effects"] if one["identifiability"] == "unavailable"}
    assert "no electrode lines" in unavailable["electrode_crosstalk"]
    page = (tmp_path / "gap" / "report.html").read_text()
    assert "TX lines: a different signal" not in page
    assert "no electrode lines" in page
