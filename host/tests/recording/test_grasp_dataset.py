"""Reading a grasp dataset that h5py alone has written according to the page of the format."""

import pickle

import h5py
import numpy as np
import pytest

from taxel.recording import DatasetError, GraspDataset, Phase, SensorModel

TAXELS, SENSORS = 5, 2  # three taxels on board 0x20, two on board 0x21
PHASES = np.repeat(np.arange(5, dtype=np.uint8), (6, 2, 4, 2, 1))  # 6 baseline frames, ..., 4 hold frames, ...
HOLD_FRAMES = np.flatnonzero(PHASES == Phase.HOLD)
FRAMES = len(PHASES)


def write_file(path, source="real", grasps=("0001", "0002")):
    """Write the content of the format page with h5py only."""
    with h5py.File(path, "w") as file:
        file.attrs.update(format="taxel-grasp-dataset", version=1, source=source, hand="two boards")
        file.attrs.update(created="2024-05-31T12:00:00+00:00", generator="a test 1.0")
        file["taxels/sensor"] = np.array([0x20, 0x20, 0x20, 0x21, 0x21], np.uint8)
        file["taxels/tx"] = np.array([0, 0, 1, 0, 1], np.uint8)
        file["taxels/rx"] = np.array([0, 1, 0, 0, 0], np.uint8)
        file["taxels/position"] = np.arange(15.0).reshape(5, 3) * 0.005
        file["taxels/normal"] = np.tile([0.0, 0.0, 1.0], (5, 1))
        file["taxels/size"] = np.full(5, 0.003)
        file["sensors/address"] = np.array([0x21, 0x20], np.uint8)
        file["sensors/name"] = ["fingertip_index", "palm"]
        file["sensors/kind"] = ["fingertip", "palm"]
        file["sensors/rate_hz"] = np.array([6.0, 6.5])
        file["objects/tetrahedron/vertices"] = np.vstack([np.zeros(3), np.eye(3)]) * 0.05
        file["objects/tetrahedron/faces"] = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], np.int32)
        if source == "sim":
            model = file.create_group("sensor_model").attrs
            model.update(baseline_counts=30_000, full_scale_drop_counts=4000.0, half_force_n=2.0, layer="uncoupled")
        file.create_group("grasps")
        for number, grasp_id in enumerate(grasps):
            write_grasp(file, grasp_id, number, source)


def write_grasp(file, grasp_id, number, source):
    """Write a grasp with 30,000 + `number` raw counts, which are 1000 lower in the hold frames."""
    grasp = file.create_group(f"grasps/{grasp_id}")
    grasp.attrs.update(object="tetrahedron", approach="from above", iteration=number, session=0)
    grasp["timestamp"] = np.arange(FRAMES) / 6.0
    grasp["phase"] = PHASES
    counts = np.full((FRAMES, TAXELS), 30_000 + number, np.uint16)
    counts[PHASES == Phase.HOLD] -= 1000
    grasp.create_dataset("raw_counts", data=counts, chunks=(FRAMES, TAXELS), compression="gzip", fletcher32=True)
    grasp["valid"] = np.ones((FRAMES, SENSORS), bool)
    grasp["sensor_pose"] = np.tile(np.eye(4), (SENSORS, 1, 1))
    grasp["object_pose"] = np.eye(4)
    if source == "sim":
        grasp["contact_force"] = np.full((FRAMES, TAXELS), 0.5)
        grasp["separation"] = np.full((FRAMES, TAXELS), 0.05)


@pytest.fixture
def real_file(tmp_path):
    """Path of a real dataset with two grasps."""
    write_file(tmp_path / "real.h5")
    return tmp_path / "real.h5"


def replace_field(path, field, value, grasp="0001"):
    """Replace an array of a grasp with h5py."""
    with h5py.File(path, "r+") as file:
        del file[f"grasps/{grasp}/{field}"]
        file[f"grasps/{grasp}/{field}"] = value


def read_counts(path, grasp="0001"):
    """Read the raw counts and the validity of a grasp with h5py."""
    with h5py.File(path) as file:
        return file[f"grasps/{grasp}/raw_counts"][()], file[f"grasps/{grasp}/valid"][()]


def test_header_and_tables_are_read(real_file):
    with GraspDataset(real_file) as data:
        assert (data.source, data.hand, data.generator) == ("real", "two boards", "a test 1.0")
        assert data.created == "2024-05-31T12:00:00+00:00"
        assert data.taxels.n == 5
        assert data.taxels.position[4].tolist() == pytest.approx([0.06, 0.065, 0.07])
        assert data.taxels.rx_line.tolist() == [0, 1, 0, 2, 2]
        assert data.sensors.address.tolist() == [0x21, 0x20]
        assert data.sensors.name == ("fingertip_index", "palm")
        assert data.sensors.kind == ("fingertip", "palm")
        assert data.sensors.index_of(data.taxels).tolist() == [1, 1, 1, 0, 0]
        assert list(data.objects) == ["tetrahedron"]
        assert data.objects["tetrahedron"].faces.dtype == np.int32
        assert data.sensor_model is None
        data.check()


def test_grasps_are_in_order_of_time_with_all_their_arrays(tmp_path):
    write_file(tmp_path / "x.h5", grasps=("0010", "0002", "0001"))
    with GraspDataset(tmp_path / "x.h5") as data:
        assert len(data) == 3
        assert data.ids == ("0001", "0002", "0010")
        assert [grasp.id for grasp in data] == list(data.ids)
        assert "0010" in data
        grasp = data["0002"]
        assert (grasp.object, grasp.approach, grasp.iteration, grasp.session) == ("tetrahedron", "from above", 1, 0)
        assert grasp.n_frames == FRAMES
        assert grasp.raw_counts.dtype == np.uint16
        assert grasp.valid.dtype == np.bool_
        assert grasp.sensor_pose.shape == (2, 4, 4)
        assert not grasp.raw_counts.flags.writeable
        optional = ("sensor_time", "sensor_pose_t", "joint_position", "contact_force", "separation", "distance")
        assert [getattr(grasp, name) for name in optional] == [None] * 6


def test_forces_and_sensor_model_of_a_simulated_file_are_read(tmp_path):
    write_file(tmp_path / "sim.h5", "sim")
    with GraspDataset(tmp_path / "sim.h5") as data:
        assert data["0001"].contact_force.max() == 0.5
        assert data["0001"].separation.max() == 0.05
        assert data["0001"].distance is None
        model = data.sensor_model
        assert (model.baseline_counts, model.noise_counts, model.layer) == (30_000.0, 0.0, "uncoupled")
        assert model.contact_stiffness_n_per_m is None
        # Signal of a force F (newtons): full scale 4000 counts * F / (F + 2 N).
        assert model.predict_signal([0.0, 2.0, 6.0]).tolist() == [0.0, 2000.0, 3000.0]
        data.check()


def test_sensor_model_subtracts_the_signal_of_a_force_and_clips_the_counts_at_0():
    """The half force, 2 N, gives half of the full scale; a huge force gives the full scale, more than the baseline."""
    model = SensorModel(baseline_counts=1000.4, full_scale_drop_counts=900.0, half_force_n=2.0)
    assert model.counts(np.array([[0.0, 2.0]]), np.random.default_rng(0)).tolist() == [[1000, 550]]
    model = SensorModel(baseline_counts=1000.4, full_scale_drop_counts=2000.0, half_force_n=2.0)
    assert model.counts(np.array([[1e9]]), np.random.default_rng(0)).tolist() == [[0]]


def test_line_noise_of_the_sensor_model_is_equal_on_the_taxels_of_one_receive_line():
    """Taxels 0 and 2 are on one line, taxel 1 is on another; the standard deviation is 50 counts."""
    model = SensorModel(30_000.0, 2000.0, 2.0, noise_line_counts=50.0)
    rx_line = np.array([0, 1, 0])
    counts = model.counts(np.zeros((400, 3)), np.random.default_rng(1), rx_line)
    assert (counts[:, 0] == counts[:, 2]).all()
    assert (counts[:, 0] != counts[:, 1]).any()
    assert 45 < counts[:, 0].std() < 55


def test_line_noise_without_the_receive_lines_of_the_taxels_is_refused():
    model = SensorModel(30_000.0, 2000.0, 2.0, noise_line_counts=50.0)
    with pytest.raises(ValueError, match="rx_line"):
        model.counts(np.zeros((1, 3)), np.random.default_rng(0))


def test_other_integer_widths_and_string_types_are_accepted_if_every_value_fits(real_file):
    counts, valid = read_counts(real_file)
    replace_field(real_file, "raw_counts", counts.astype(">i8"))
    replace_field(real_file, "valid", valid.astype(np.int32))
    replace_field(real_file, "timestamp", np.arange(FRAMES, dtype=np.float32))
    with h5py.File(real_file, "r+") as file:
        file["grasps/0001"].attrs["object"] = np.bytes_("tetrahedron")
        file["grasps/0001"].attrs["iteration"] = np.uint8(3)
        del file["sensors/name"]
        file["sensors/name"] = np.array([b"index", b"palm"])
        file["taxels"].attrs["remark"] = "an attribute outside the format"
        file["notes/anything"] = np.arange(3)
    with GraspDataset(real_file) as data:
        assert data["0001"].raw_counts.dtype == np.uint16
        assert np.array_equal(data["0001"].raw_counts, counts)
        assert data["0001"].valid.dtype == np.bool_
        assert data["0001"].timestamp.dtype == np.float64
        assert data["0001"].iteration == 3
        assert data.sensors.name == ("index", "palm")
        data.check()


def test_file_without_grasps_is_readable(tmp_path):
    write_file(tmp_path / "empty.h5", grasps=())
    with GraspDataset(tmp_path / "empty.h5", baseline_frames=100) as data:
        assert len(data) == 0
        assert list(data) == []
        data.check()


def test_baseline_is_the_mean_of_the_first_valid_frames_of_the_taxels_own_sensor(real_file):
    """Taxel 0: mean of 100 to 400. Taxel 3, whose board has no valid frame 1: mean of 10, 30, 40 and 50."""
    counts, valid = read_counts(real_file)
    counts[:6, 0] = (100, 200, 300, 400, 999, 999)
    counts[:6, 3] = (10, 999, 30, 40, 50, 60)
    valid[1, 0] = False  # column 0 is board 0x21: taxels 3 and 4
    replace_field(real_file, "raw_counts", counts)
    replace_field(real_file, "valid", valid)
    with GraspDataset(real_file) as data:
        assert data["0001"].baseline(4).tolist() == [250.0, 30_000.0, 30_000.0, 32.5, 30_000.0]


def test_signal_equal_to_the_threshold_is_not_active(real_file):
    """The default threshold is 150 counts. Taxel 1 has a mean signal slightly above it, taxel 2 slightly below it."""
    counts, _ = read_counts(real_file)
    baseline_counts = np.array([30_000, 30_001, 30_000])  # the mean is not representable as a float
    counts[:3] = baseline_counts[:, None]
    phases = PHASES.copy()
    phases[HOLD_FRAMES[3:]] = Phase.BASELINE  # three hold frames remain, as many as baseline frames
    replace_field(real_file, "phase", phases)
    hold = HOLD_FRAMES[:3]
    counts[HOLD_FRAMES] = 29_850
    counts[hold] = baseline_counts[:, None] - 150
    counts[hold[0], 1] -= 1
    counts[hold[0], 2] += 1
    replace_field(real_file, "raw_counts", counts)
    with GraspDataset(real_file) as data:
        signal = data["0001"].mean_hold_signal(3)
        assert signal[[0, 3, 4]].tolist() == [150.0] * 3
        active, is_known = data["0001"].active_taxels(baseline_frames=3)
        assert active.tolist() == [False, True, False, False, False]
        assert is_known.all()
        assert data["0001"].active_taxels(threshold=149.0, baseline_frames=3)[0].all()


def test_sensor_without_a_valid_hold_frame_is_unknown_not_inactive(real_file):
    _, valid = read_counts(real_file)
    valid[PHASES == Phase.HOLD, 0] = False
    replace_field(real_file, "valid", valid)
    with GraspDataset(real_file) as data:
        active, is_known = data["0001"].active_taxels(baseline_frames=6)
        assert is_known.tolist() == [True, True, True, False, False]
        assert active.tolist() == [True, True, True, False, False]
        assert np.isnan(data["0001"].mean_hold_signal(6)).tolist() == (~is_known).tolist()


def test_grasp_without_a_hold_phase_has_no_known_taxel(real_file):
    replace_field(real_file, "phase", np.zeros(FRAMES, np.uint8))
    with GraspDataset(real_file) as data:
        active, is_known = data["0001"].active_taxels(baseline_frames=6)
        assert not active.any()
        assert not is_known.any()


def test_invalid_hold_frames_are_ignored(real_file):
    """The signal in hold is 1000 counts; the first hold frame, with raw count 0, is invalid."""
    counts, valid = read_counts(real_file)
    first = HOLD_FRAMES[0]
    counts[first] = 0
    valid[first] = False
    replace_field(real_file, "raw_counts", counts)
    replace_field(real_file, "valid", valid)
    with GraspDataset(real_file) as data:
        assert data["0001"].mean_hold_signal(6).tolist() == [1000.0] * 5


def test_too_few_baseline_frames_are_refused(real_file):
    """Every grasp of the file has six baseline frames; one frame of the second grasp is then marked invalid."""
    with pytest.raises(DatasetError, match=r"real\.h5: /grasps/0001/phase: expected 7 baseline frames.*found 6"):
        GraspDataset(real_file, baseline_frames=7)
    _, valid = read_counts(real_file, "0002")
    valid[2, 1] = False
    replace_field(real_file, "valid", valid, "0002")
    with GraspDataset(real_file) as data:
        data.require_baseline(5)
        with pytest.raises(DatasetError, match=r"/grasps/0002/valid: expected 6 baseline frames.*found 5 valid"):
            data.require_baseline(6)
        with pytest.raises(DatasetError, match="/grasps/0002/valid"):
            data["0002"].baseline(6)
        with pytest.raises(DatasetError, match="/grasps/0002/valid"):
            data["0002"].active_taxels(baseline_frames=6)


def test_baseline_of_0_frames_is_refused(real_file):
    with GraspDataset(real_file) as data, pytest.raises(ValueError, match="1 or more"):
        data["0001"].baseline(0)


def test_board_without_any_frame_is_missing_not_short_of_baseline_frames(real_file):
    _, valid = read_counts(real_file)
    valid[:, 0] = False
    replace_field(real_file, "valid", valid)
    with GraspDataset(real_file, baseline_frames=6) as data:
        assert np.isnan(data["0001"].baseline(6)).tolist() == [False, False, False, True, True]
        assert data["0001"].active_taxels(baseline_frames=6)[1].tolist() == [True, True, True, False, False]


def test_reading_one_grasp_does_not_read_another(real_file):
    """The stored counts of the first grasp are damaged, which is an error only when these counts are read."""
    with h5py.File(real_file) as file:
        chunk = file["grasps/0001/raw_counts"].id.get_chunk_info(0)
    with open(real_file, "r+b") as file:
        file.seek(chunk.byte_offset)
        file.write(b"\xff" * chunk.size)
    with GraspDataset(real_file) as data:
        assert data["0002"].raw_counts[0, 0] == 30_001
        assert data["0001"].phase[0] == 0
        with pytest.raises(
            DatasetError, match=r"real\.h5: /grasps/0001/raw_counts: expected complete chunks"
        ) as caught:
            _ = data["0001"].raw_counts
        assert "\n" not in str(caught.value)
        with pytest.raises(DatasetError, match="/grasps/0001/raw_counts"):
            data.check()


def test_a_grasp_object_keeps_its_arrays_and_a_new_object_reads_them_again(real_file):
    with GraspDataset(real_file) as data:
        grasp = data["0001"]
        assert grasp.raw_counts is grasp.raw_counts
        assert data["0001"].raw_counts is not grasp.raw_counts


def test_unknown_grasp_and_closed_file_are_refused(real_file):
    with GraspDataset(real_file) as data:
        grasp = data["0001"]
        with pytest.raises(DatasetError, match=r"real\.h5: /grasps/7: expected a grasp of this file"):
            _ = data["7"]
    with pytest.raises(DatasetError, match="expected an open dataset"):
        _ = data["0001"]
    with pytest.raises(DatasetError, match="/grasps/0001/phase"):
        _ = grasp.phase


def test_a_pickled_dataset_error_keeps_its_text_and_field(real_file):
    with pytest.raises(DatasetError) as caught:
        GraspDataset(real_file, baseline_frames=1000)
    copy = pickle.loads(pickle.dumps(caught.value))
    assert str(copy) == str(caught.value)
    assert copy.field == "/grasps/0001/phase"


def test_a_name_that_is_not_utf8_is_refused(real_file):
    with h5py.File(real_file, "r+") as file:
        h5py.h5g.create(file["objects"].id, b"cu\xe2e")  # "cube" with one damaged byte
    with pytest.raises(DatasetError, match="/objects: expected names in UTF-8"):
        GraspDataset(real_file)
