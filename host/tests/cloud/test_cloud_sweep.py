"""The sweeps of Tables I-1 to I-6."""

from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from taxel.cloud.errors import CloudError, RegistrationError
from taxel.cloud.filters import force_filter, sor_mask
from taxel.cloud.models import models
from taxel.cloud.registration import align_to_mesh
from taxel.cloud.sweep import THRESHOLDS, force_sweep, neighbours, sor_rules, sor_sweep, to_csv


def test_the_force_sweep_has_the_rows_of_the_tables(surface_cloud):
    cloud, mesh = surface_cloud("cylinder", 1500), models()["cylinder"]
    rows = force_sweep(cloud, mesh, "cylinder")
    assert [row.threshold_counts for row in rows] == list(THRESHOLDS)
    assert all(rows[k].points >= rows[k + 1].points for k in range(len(rows) - 1))
    assert rows[0].filtered_out_percent == 0.0
    assert rows[4].points == (cloud.counts > 190.0).sum()
    assert rows[4].filtered_out_percent == pytest.approx(100.0 * (1.0 - rows[4].points / 1500))
    assert rows[4].rms_m == pytest.approx(align_to_mesh(force_filter(cloud, 190.0).points, mesh).rms_m)
    assert rows[4].rms_m ** 2 == pytest.approx(rows[4].mean_m ** 2 + rows[4].std_m ** 2)


def test_the_sor_sweep_works_on_what_the_force_filter_left(surface_cloud):
    cloud, mesh = surface_cloud("triangular_prism", 900), models()["triangular_prism"]
    left = force_filter(cloud, 190.0)
    rows = sor_sweep(cloud, mesh, "triangular_prism")
    assert len(rows) == 12
    for row in rows[:6]:
        assert row.points == sor_mask(left.points, row.n_neighbors, row.n_sigma).sum()
        assert row.filtered_out_percent == pytest.approx(100.0 * (1.0 - row.points / len(left)))


@pytest.mark.parametrize(
    ("name", "count"), [("rectangular_prism", 13), ("cylinder", 11), ("Triangular", 12), ("mug", 13)]
)
def test_rules_are_those_of_the_objects_table(name, count):
    assert len(sor_rules(name)) == count


def test_n_of_the_tables_as_shares_of_the_thesis_clouds():
    shares = dict.fromkeys(share for share, _ in sor_rules("cylinder"))
    assert [neighbours(share, 2760) for share in shares] == [20, 2759, 690, 1380]


def test_csv_has_the_columns_of_the_tables(surface_cloud):
    mesh = models()["cylinder"]
    force = force_sweep(surface_cloud("cylinder"), mesh, "cylinder", (150.0, 190.0))
    sor = sor_sweep(surface_cloud("cylinder"), mesh, "cylinder")
    told = list(csv.DictReader(io.StringIO(to_csv(force))))
    lengths = ["points", "rms_m", "max_m", "mean_m", "std_m", "filtered_out_percent"]
    assert list(told[0]) == ["object", "threshold_counts", *lengths]
    assert float(told[1]["mean_m"]) == pytest.approx(force[1].mean_m, rel=1e-8)
    assert list(csv.DictReader(io.StringIO(to_csv(sor))).fieldnames) == ["object", "n_neighbors", "n_sigma", *lengths]


def test_a_threshold_that_leaves_nothing_is_one_line(surface_cloud):
    with pytest.raises(RegistrationError, match=r"cylinder: points: expected three or more .* found 0"):
        force_sweep(surface_cloud("cylinder"), models()["cylinder"], "cylinder", (150.0, 4000.0))


def test_fewer_points_than_n_is_one_line(surface_cloud):
    few = surface_cloud("cylinder").take(np.arange(15))
    with pytest.raises(CloudError, match="points: expected 20 or more, the N of the outlier filter, found"):
        sor_sweep(few, models()["cylinder"], "cylinder")
