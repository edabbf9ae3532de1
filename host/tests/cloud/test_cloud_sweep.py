"""Parameter sweeps of Tables I-1 to I-6."""

import csv
import io

import numpy as np
import pytest

from taxel.cloud.errors import CloudError, RegistrationError
from taxel.cloud.filters import filter_by_force, find_inliers
from taxel.cloud.models import get_builtin_models
from taxel.cloud.registration import align_to_mesh
from taxel.cloud.sweep import (
    FORCE_THRESHOLDS,
    count_neighbours,
    format_csv,
    get_sor_rules,
    sweep_force_filter,
    sweep_outlier_filter,
)


def test_force_filter_sweep_has_a_row_for_each_threshold_of_the_tables(surface_cloud):
    cloud, mesh = surface_cloud("cylinder", 1500), get_builtin_models()["cylinder"]
    rows = sweep_force_filter(cloud, mesh, "cylinder")
    assert [row.threshold_counts for row in rows] == list(FORCE_THRESHOLDS)


def test_row_of_the_force_filter_sweep_describes_the_filtered_and_aligned_cloud(surface_cloud):
    cloud, mesh = surface_cloud("cylinder", 1500), get_builtin_models()["cylinder"]
    (row,) = sweep_force_filter(cloud, mesh, "cylinder", (190.0,))
    assert row.points == (cloud.counts > 190.0).sum()
    assert row.filtered_out_percent == pytest.approx(100.0 * (1.0 - row.points / 1500))
    assert row.rms_m == pytest.approx(align_to_mesh(filter_by_force(cloud, 190.0).points, mesh).rms_m)
    assert row.rms_m**2 == pytest.approx(row.mean_m**2 + row.std_m**2)


def test_outlier_filter_sweep_filters_the_force_filtered_cloud(surface_cloud):
    cloud, mesh = surface_cloud("triangular_prism", 900), get_builtin_models()["triangular_prism"]
    filtered = filter_by_force(cloud, 190.0)
    rows = sweep_outlier_filter(cloud, mesh, "triangular_prism")
    assert len(rows) == 12  # settings (N, nSigma) in the table of the triangular prism; the first six are checked
    for row in rows[:6]:
        assert row.points == find_inliers(filtered.points, row.n_neighbors, row.n_sigma).sum()
        assert row.filtered_out_percent == pytest.approx(100.0 * (1.0 - row.points / len(filtered)))


@pytest.mark.parametrize(
    ("name", "count"), [("rectangular_prism", 13), ("cylinder", 11), ("Triangular", 12), ("mug", 13)]
)
def test_number_of_outlier_filter_settings_is_that_of_the_object_s_table(name, count):
    assert len(get_sor_rules(name)) == count


def test_shares_of_the_cylinder_s_2760_points_are_the_values_of_n_in_the_table():
    shares = dict.fromkeys(share for share, _ in get_sor_rules("cylinder"))
    assert [count_neighbours(share, 2760) for share in shares] == [20, 2759, 690, 1380]


def test_csv_has_the_columns_of_the_tables(surface_cloud):
    mesh = get_builtin_models()["cylinder"]
    force = sweep_force_filter(surface_cloud("cylinder"), mesh, "cylinder", (150.0, 190.0))
    sor = sweep_outlier_filter(surface_cloud("cylinder"), mesh, "cylinder")
    rows = list(csv.DictReader(io.StringIO(format_csv(force))))
    lengths = ["points", "rms_m", "max_m", "mean_m", "std_m", "filtered_out_percent"]
    assert list(rows[0]) == ["object", "threshold_counts", *lengths]
    assert float(rows[1]["mean_m"]) == pytest.approx(force[1].mean_m, rel=1e-8)
    assert list(csv.DictReader(io.StringIO(format_csv(sor))).fieldnames) == [
        "object",
        "n_neighbors",
        "n_sigma",
        *lengths,
    ]


def test_threshold_that_removes_every_point_is_refused_in_one_line(surface_cloud):
    with pytest.raises(RegistrationError, match=r"cylinder: points: expected three or more .* found 0"):
        sweep_force_filter(surface_cloud("cylinder"), get_builtin_models()["cylinder"], "cylinder", (150.0, 4000.0))


def test_fewer_points_than_n_are_refused_in_one_line(surface_cloud):
    few_points = surface_cloud("cylinder").select(np.arange(15))
    with pytest.raises(CloudError, match="points: expected 20 or more, the N of the outlier filter, found"):
        sweep_outlier_filter(few_points, get_builtin_models()["cylinder"], "cylinder")
