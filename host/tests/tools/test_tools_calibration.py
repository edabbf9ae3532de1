"""Calibration of the comparison: weights of the worlds, and the packaged models."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.blind.benchmark.worlds import FAMILIES, KINDS, SENSOR_FAMILIES
from taxel.gap.calibration.calibration import load_calibration


@pytest.fixture
def tool(import_tool):
    """The module that stores and weights the evidence."""
    return import_tool("gap", "calibration_evidence")


def test_weights_give_every_family_its_share(tool):
    """Few worlds of a family, which are slow to make, have a large weight. The mean weight is 1."""
    families = np.array(["indentations"] * 30 + ["grasps"] * 5 + ["resistive mat"] * 10)
    weights = tool.compute_weights([(name, "single") for name in families])
    assert weights.mean() == pytest.approx(1.0)
    indentations, grasps = (weights[families == name].sum() for name in ("indentations", "grasps"))
    assert indentations / grasps == pytest.approx(FAMILIES["indentations"] / FAMILIES["grasps"])


def test_weights_give_every_kind_its_share_within_the_own_skin(tool):
    """The shares do not depend on how many worlds of a kind the sample contains. A world of the kind "lookalike" has a
    single cause."""
    worlds = [(name, kind) for name in FAMILIES for kind in (*KINDS, "lookalike", "several", "several")]
    worlds += [("resistive mat", "single")] * 7
    weights = tool.compute_weights(worlds)
    skin = np.array([name in FAMILIES for name, _ in worlds])
    kinds = np.array(["single" if kind == "lookalike" else kind for _, kind in worlds])
    shares = {kind: weights[skin & (kinds == kind)].sum() / weights[skin].sum() for kind in KINDS}
    assert shares == pytest.approx(KINDS)
    families = np.array([name for name, _ in worlds])
    assert weights[families == "grasps"].sum() / weights[skin].sum() == pytest.approx(FAMILIES["grasps"])


def test_the_own_skin_and_the_other_sensors_have_fixed_shares_of_the_weights(tool):
    families = np.array([*FAMILIES, *FAMILIES, *SENSOR_FAMILIES])
    weights = tool.compute_weights([(name, "none") for name in families])
    assert weights[np.isin(families, list(SENSOR_FAMILIES))].sum() / len(families) == pytest.approx(tool.SENSOR_SHARE)


def test_both_comparisons_of_a_world_have_the_weight_of_one_world(tool):
    single = {"family": "grasps", "kind": "single", "truth": ["noise"], "gap": [9.0, 2.0, 77.0]}
    withheld = single | {"kind": "outside", "truth": ["unknown"]}
    failed = {"family": "grasps", "kind": "single", "truth": [], "error": "no grasps"}
    compared = tool.list_comparisons([single | {"without": withheld}, single, failed])
    assert [one["family"] for one in compared] == ["grasps", tool.WITHHELD_SKIN, "grasps"]
    assert compared[0]["weight"] + compared[1]["weight"] == pytest.approx(compared[2]["weight"])
    assert compared[1]["weight"] == pytest.approx(tool.WITHHELD_WEIGHT * compared[2]["weight"])


def test_a_single_cause_below_half_a_floor_is_no_cause(tool):
    weak = {"family": "grasps", "kind": "single", "truth": ["noise"], "gap": [2.1, 2.0, 0.4]}
    assert tool.list_comparisons([weak]) == []


def test_missing_evidence_gives_one_line(tool, tmp_path):
    with pytest.raises(SystemExit, match=r"expected stored evidence, found .*; collect it with --out"):
        tool.read_stored(tmp_path / "absent.gz")


def test_the_packaged_calibration_is_the_fit_to_the_packaged_evidence(tool, import_tool):
    found = tool.read_stored(tool.PACKAGED)
    fitted = import_tool("gap", "calibrate_comparison").fit(tool.list_comparisons(found), tool.describe_source(found))
    packaged = load_calibration()
    assert fitted.source == packaged.source
    assert fitted.not_compared == pytest.approx(packaged.not_compared, abs=1e-5)
    for name in ("effect", "unknown", "any_cause"):
        model, expected = getattr(fitted, name), getattr(packaged, name)
        assert model.intercept == pytest.approx(expected.intercept, abs=1e-3)
        assert model.coefficients == pytest.approx(expected.coefficients, abs=1e-3)
