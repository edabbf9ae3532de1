"""The presets of `taxel import`: the values of a small file of each documented layout, and the error lines."""

import mujoco
import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from host.tests.importers.files import FRAMES, make_time, make_values, number_columns, write_csv, write_lerobot
from taxel.recording.general import GeneralDataset


@pytest.fixture
def import_preset(tmp_path):
    """Function that runs `taxel import ARGUMENTS --out out.h5` and returns the dataset's header and contacts."""

    def run(*arguments):
        assert run_taxel("import", *arguments, "--out", tmp_path / "out.h5", "--overwrite") == 0
        with GeneralDataset(tmp_path / "out.h5") as data:
            return data.header, list(data)

    return run


@pytest.fixture
def refuse_preset(tmp_path, capsys):
    """Function that runs the refused command `taxel import ARGUMENTS --out out.h5` and returns its error line."""
    return lambda *arguments: run_refused_command(capsys, "import", *arguments, "--out", tmp_path / "out.h5")


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_lerobot_episodes_are_contacts_with_the_task_as_object(tmp_path, import_preset, version):
    episodes = [make_values(8), make_values(8, frames=30) + 1, make_values(8)]
    folder = write_lerobot(tmp_path / "robot", version, episodes)
    _, contacts = import_preset("lerobot", folder, "--column", "observation.tactile", "--session", 4)
    assert [contact.object for contact in contacts] == ["pick", "place", "pick"]
    assert {contact.session for contact in contacts} == {4}
    for contact, values in zip(contacts, episodes, strict=True):
        np.testing.assert_allclose(contact.values, values, rtol=1e-6)


def test_lerobot_elements_are_selected_and_grouped_into_vectors(tmp_path, import_preset):
    folder = write_lerobot(tmp_path / "robot", "v3.0", [make_values(8)])
    arguments = ("lerobot", folder, "--column", "observation.tactile")
    _, (contact,) = import_preset(*arguments, "--elements", "1-6", "--vectors", "--object", "cup")
    np.testing.assert_allclose(contact.values, make_values(8)[:, 1:7].reshape(FRAMES, 2, 3), rtol=1e-6)
    assert contact.object == "cup"


def test_lerobot_column_that_does_not_exist_is_refused_with_a_similar_name(tmp_path, refuse_preset):
    folder = write_lerobot(tmp_path / "robot", "v3.0", [make_values(8)])
    assert "use observation.tactile" in refuse_preset("lerobot", folder, "--column", "observation.tactil")


def test_lerobot_elements_that_are_no_range_are_refused(tmp_path, refuse_preset):
    folder = write_lerobot(tmp_path / "robot", "v3.0", [make_values(8)])
    arguments = ("lerobot", folder, "--column", "observation.tactile", "--elements", "6")
    assert "--elements: expected a range" in refuse_preset(*arguments)


def write_tactile_map(path, values, first=0):
    """Write a table as the simulation of Lab-CORO does: time_sec, frame, pred_0 ... pred_27. first: first frame."""
    frame = np.arange(len(values)) + first
    return write_csv(path, {"time_sec": frame / 50.0, "frame": frame, **number_columns("pred_", values)})


def test_tsf85_files_of_both_pads_are_joined_by_their_common_frames(tmp_path, import_preset):
    values = make_values(56)  # 28 taxels of each pad
    first = write_tactile_map(tmp_path / "TactileData_s1_tactile_maps.csv", values[:, :28])
    second = write_tactile_map(tmp_path / "TactileData_s2_tactile_maps.csv", values[2:, 28:], first=2)
    header, (contact,) = import_preset("tsf85", first, second, "--source", "sim")
    np.testing.assert_array_equal(contact.values, values[2:])
    assert np.bincount(header.places.sensor).tolist() == [28, 28]
    assert (header.source, header.sensor) == ("sim", "TSF-85")


def test_tsf85_files_without_common_frames_are_refused(tmp_path, refuse_preset):
    values = make_values(28)
    first = write_tactile_map(tmp_path / "TactileData_s1_tactile_maps.csv", values)
    second = write_tactile_map(tmp_path / "TactileData_s2_tactile_maps.csv", values, first=100)
    assert "/frame: expected frames that are also in" in refuse_preset("tsf85", first, second)


@pytest.fixture
def tsf85_log(tmp_path):
    """Path of a table as the TSF-85 hardware writes it: time, and two sets of 28 columns with `make_values(56)`."""
    values = make_values(56)
    columns = {"timestamp_ms": make_time() * 1e3, **number_columns("finger1_", values[:, :28], 1)}
    return write_csv(tmp_path / "log.csv", columns | number_columns("finger2_", values[:, 28:], 1))


def test_tsf85_table_of_the_hardware_has_two_sets_of_28_columns(tsf85_log, import_preset):
    values = make_values(56)
    header, (contact,) = import_preset("tsf85", tsf85_log)
    np.testing.assert_array_equal(contact.values, values)
    np.testing.assert_allclose(contact.time, make_time())
    assert header.properties.unit == "counts"
    _, (contact,) = import_preset("tsf85", tsf85_log, "--columns", "finger2_1,finger2_28")
    np.testing.assert_array_equal(contact.values, values[:, 28:])


def test_tsf85_table_without_28_columns_of_a_pad_is_refused(tmp_path, tsf85_log, refuse_preset):
    line = refuse_preset("tsf85", tsf85_log, "--columns", "finger2_1,finger2_2")
    assert "expected 28 or 56 columns, found 2" in line
    other = write_csv(tmp_path / "b.csv", {"time": make_time(), **number_columns("p", make_values(20))})
    assert "expected one or two sets of 28 numbered columns" in refuse_preset("tsf85", other)


def make_uskin_columns():
    """Make the columns of a uSkin table, ordered by axis: raw values `make_values(16, 3)`, and these values minus 1."""
    values = make_values(16, 3)
    columns = {"t": make_time()}
    for axis, name in enumerate("xyz"):
        columns |= number_columns(f"raw_{name}", values[:, :, axis])
        columns |= number_columns(f"d_{name}", values[:, :, axis] - 1)
    return columns


def test_uskin_columns_of_one_set_are_ordered_by_taxel_and_axis(tmp_path, import_preset):
    values = make_values(16, 3)
    path = write_csv(tmp_path / "log.csv", make_uskin_columns())
    header, (contact,) = import_preset("uskin", path, "--prefix", "d_")
    np.testing.assert_array_equal(contact.values, values - 1)  # the columns d_; the columns raw_ contain `values`
    assert header.properties.to_attributes() == {"unit": "counts", "contact": "signed", "modality": "magnetic"}


def test_uskin_table_without_a_column_of_a_taxel_or_of_the_prefix_is_refused(tmp_path, refuse_preset):
    columns = make_uskin_columns()
    columns.pop("raw_y3")
    path = write_csv(tmp_path / "log.csv", columns)
    assert "log.csv: /taxel 3: expected columns x, y and z, found no column y" in refuse_preset("uskin", path)
    assert "none with the prefix 'q_'" in refuse_preset("uskin", path, "--prefix", "q_")


@pytest.mark.parametrize("has_time", [True, False])
def test_uskin_table_without_header_is_in_the_order_of_the_server(tmp_path, import_preset, has_time):
    values = make_values(16, 3)
    columns = {"t": make_time()} if has_time else {}
    path = write_csv(tmp_path / "log.csv", columns | number_columns("c", values.reshape(FRAMES, -1)), header=False)
    _, (contact,) = import_preset("uskin", path, *(() if has_time else ("--rate-hz", 50)))
    np.testing.assert_array_equal(contact.values, values)
    np.testing.assert_allclose(contact.time, make_time())


MODEL = """<mujoco>
<extension><plugin plugin="mujoco.sensor.touch_grid"/></extension>
<asset><mesh name="pad" builtin="plate" params="4 3" scale=".05 .05 .01"/></asset>
<worldbody>
  <body name="board"><geom type="box" size=".05 .05 .01"/>
  <site name="site" pos="0 0 .03" type="box" size=".05 .05 .03"/>
  <geom name="skin" type="mesh" mesh="pad" pos="0 0 .012" contype="0" conaffinity="0"/></body>
  <body pos="0 0 .029"><freejoint/><geom type="sphere" size=".02"/></body>
</worldbody>
<sensor>
  <gyro name="imu" site="site"/>
  <touch name="tip" site="site"/>
  <plugin name="grid" plugin="mujoco.sensor.touch_grid" objtype="site" objname="site">
    <config key="nchannel" value="3"/><config key="size" value="4 3"/>
    <config key="fov" value="90 90"/><config key="gamma" value="0"/></plugin>
  <tactile name="skin" geom="skin" mesh="pad"/>
</sensor></mujoco>"""


@pytest.fixture
def simulated(tmp_path):
    """Recorded simulation of `MODEL`: a folder with model.xml and run.npz, and the sensordata f64[T frames, k numbers].

    The k numbers are 3 of the gyroscope, 1 of the touch sensor, 36 of the touch grid (3 channels of 4 x 3), and 36 of
    the tactile sensor (12 vertices).
    """
    from taxel.recording.importers.mujoco_sensors import _load_plugins

    _load_plugins(mujoco)
    (tmp_path / "model.xml").write_text(MODEL)
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "model.xml"))
    data = mujoco.MjData(model)
    rows, times = [], []
    for _ in range(FRAMES):
        mujoco.mj_step(model, data)
        rows.append(data.sensordata.copy())
        times.append(data.time)
    np.savez(tmp_path / "run.npz", sensordata=rows, time=times)
    return tmp_path, np.array(rows)


@pytest.fixture
def model_arguments(simulated):
    """Arguments of `taxel import` for the recorded simulation and its model."""
    folder, _ = simulated
    return ("mujoco-sensors", folder / "run.npz", "--model", folder / "model.xml")


def test_mujoco_touch_sensor_gives_one_value_in_newtons(simulated, model_arguments, import_preset):
    """The touch sensor "tip" is number 3 of the sensor data, after the three numbers of a gyroscope."""
    _, data = simulated
    header, (contact,) = import_preset(*model_arguments, "--sensors", "tip")
    np.testing.assert_array_equal(contact.values, data[:, 3:4])
    assert contact.values.max() > 0
    assert (header.source, header.properties.unit, header.properties.contact) == ("sim", "N", "raises")


def test_mujoco_touch_grid_gives_a_vector_of_each_taxel_with_the_normal_component_last(
    simulated, model_arguments, import_preset
):
    """In the sensor data, the grid has the numbers 4 to 39: normal and two tangential forces of 12 taxels each."""
    _, data = simulated
    _, (contact,) = import_preset(*model_arguments, "--sensors", "grid")
    normal, first_tangential, _ = data[:, 4:40].reshape(FRAMES, 3, 12).swapaxes(0, 1)
    np.testing.assert_array_equal(contact.values[..., 2], normal)
    np.testing.assert_array_equal(contact.values[..., 0], first_tangential)


def test_mujoco_tactile_sensor_gives_vectors_without_a_unit(model_arguments, import_preset):
    header, (contact,) = import_preset(*model_arguments, "--sensors", "skin")
    assert contact.values.shape == (FRAMES, 12, 3)
    assert header.properties.unit is None


def test_mujoco_sensors_with_values_and_with_vectors_are_joined_only_as_normal_components(
    model_arguments, import_preset, refuse_preset
):
    assert "expected sensors of one number of components" in refuse_preset(*model_arguments)
    header, (contact,) = import_preset(*model_arguments, "--normal-only")
    assert contact.values.shape == (FRAMES, 1 + 12 + 12)
    assert np.bincount(header.places.sensor).tolist() == [1, 12, 12]


LAYOUT = "imu:skip:3,tip:touch,grid:touch_grid:4x3x3,skin:tactile:12"  # sensors of MODEL


def test_mujoco_values_are_the_same_with_a_layout_instead_of_the_model(simulated, model_arguments, import_preset):
    folder, _ = simulated
    arguments = ("mujoco-sensors", folder / "run.npz", "--layout", LAYOUT)
    _, (by_layout,) = import_preset(*arguments, "--sensors", "grid,skin")
    _, (by_model,) = import_preset(*model_arguments, "--sensors", "grid,skin")
    np.testing.assert_array_equal(by_layout.values, by_model.values)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--layout", "tip:touch:4"), "expected sensors such as"),
        ((), "--model and --layout: expected one of them"),
        (("--layout", "a:tactile:300"), "expected shape [T, k] with k of at least 900"),
        (("--layout", LAYOUT, "--sensors", "tap"), "none of this name"),
    ],
    ids=["length of a touch sensor", "neither model nor layout", "too few numbers", "unknown sensor"],
)
def test_mujoco_wrong_layout_gives_one_error_line(simulated, refuse_preset, options, message):
    folder, _ = simulated
    assert message in refuse_preset("mujoco-sensors", folder / "run.npz", *options)


def test_mujoco_model_that_cannot_be_read_gives_one_error_line(simulated, refuse_preset):
    folder, _ = simulated
    (folder / "bad.xml").write_text("<mujoco><x/></mujoco>")
    line = refuse_preset("mujoco-sensors", folder / "run.npz", "--model", folder / "bad.xml")
    assert "expected a MuJoCo model" in line


def test_isaac_force_field_has_shear_and_normal_components(tmp_path, import_preset):
    normal, shear = make_values(4, 5), make_values(4, 5, 2)  # 4 rows of 5 taxels, or 4 environments of 5 taxels
    arrays = {"tactile_normal_force": normal, "tactile_shear_force": shear}
    np.savez(tmp_path / "a.npz", time=make_time(), **arrays)
    header, (contact,) = import_preset("isaac", tmp_path / "a.npz")
    np.testing.assert_array_equal(contact.values[..., 2], normal.reshape(FRAMES, 20))
    np.testing.assert_array_equal(contact.values[..., :2], shear.reshape(FRAMES, 20, 2))
    assert (header.sensor, header.properties.contact) == ("Isaac Lab", "signed")
    _, contacts = import_preset("isaac", tmp_path / "a.npz", "--environments")
    assert len(contacts) == 4
    np.testing.assert_array_equal(contacts[3].values[..., 2], normal[:, 3])


def test_isaac_shear_forces_of_another_shape_than_the_normal_forces_are_refused(tmp_path, refuse_preset):
    arrays = {"tactile_normal_force": make_values(4, 5), "tactile_shear_force": make_values(3, 5, 2)}
    np.savez(tmp_path / "a.npz", time=make_time(), **arrays)
    assert "a.npz: /tactile_shear_force: expected shape (40, 4, 5, 2)" in refuse_preset("isaac", tmp_path / "a.npz")


def test_isaac_net_forces_of_each_environment_are_a_contact_with_one_vector_of_each_body(tmp_path, import_preset):
    net_forces = make_values(2, 3, 3)  # 2 environments, 3 bodies, 3 components
    np.savez(tmp_path / "a.npz", net_forces_w=net_forces)
    _, contacts = import_preset("isaac", tmp_path / "a.npz", "--rate-hz", 50)
    np.testing.assert_array_equal(contacts[1].values, net_forces[:, 1])


def test_isaac_force_matrix_is_summed_over_the_filtered_objects(tmp_path, import_preset):
    force_matrix = make_values(3, 2, 3)  # 3 bodies, 2 filtered objects, 3 components
    np.savez(tmp_path / "a.npz", force_matrix_w=force_matrix, time=make_time())
    _, (contact,) = import_preset("isaac", tmp_path / "a.npz")
    np.testing.assert_allclose(contact.values, force_matrix.sum(axis=2))


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"net_forces_w": make_values(2, 3, 3)}, "--rate-hz"),
        ({"time": make_time(), "other": make_values(2, 3, 3)}, "expected an array tactile_normal_force"),
        ({"time": make_time(), "net_forces_w": make_values(4)}, "a.npz: /net_forces_w: expected shape [T, bodies, 3]"),
    ],
    ids=["no time", "no force", "shape"],
)
def test_isaac_file_of_another_layout_gives_one_error_line(tmp_path, refuse_preset, arrays, message):
    np.savez(tmp_path / "a.npz", **arrays)
    assert message in refuse_preset("isaac", tmp_path / "a.npz")


def test_genesis_field_of_each_environment_is_a_contact(tmp_path, import_preset):
    force, penetration = make_values(2, 6, 3), make_values(2, 6)  # 2 environments, 6 probes
    np.savez(tmp_path / "a.npz", force=force, penetration=penetration, time=make_time())
    header, contacts = import_preset("genesis", tmp_path / "a.npz", "--environments")
    np.testing.assert_array_equal(contacts[1].values, force[:, 1])
    assert header.properties.to_attributes() == {"unit": "N", "contact": "signed", "modality": "other"}
    header, contacts = import_preset("genesis", tmp_path / "a.npz", "--environments", "--field", "penetration")
    np.testing.assert_array_equal(contacts[0].values, penetration[:, 0])
    assert header.properties.unit == "m"


def test_genesis_array_of_a_grid_of_probes_has_one_taxel_for_each_probe(tmp_path, import_preset):
    values = make_values(4, 5, 3)  # 4 rows of 5 probes, 3 components
    np.save(tmp_path / "a.npy", values)
    _, (contact,) = import_preset("genesis", tmp_path / "a.npy", "--rate-hz", 50)
    np.testing.assert_array_equal(contact.values, values.reshape(FRAMES, 20, 3))


def test_genesis_file_with_several_unknown_arrays_is_refused_with_their_names(tmp_path, refuse_preset):
    np.savez(tmp_path / "a.npz", x=make_values(2, 6, 3), y=make_values(2, 6, 3))
    assert "choose one with --field: x, y" in refuse_preset("genesis", tmp_path / "a.npz")


def test_genesis_array_without_a_probe_axis_is_refused(tmp_path, refuse_preset):
    np.save(tmp_path / "a.npy", make_time())
    assert "expected shape [T, probes]" in refuse_preset("genesis", tmp_path / "a.npy", "--rate-hz", 50)


def test_a_pause_of_more_than_gap_s_divides_a_recording_into_two_contacts(tmp_path, import_preset):
    time = make_time()
    time[20:] += 5.0  # a pause of 5 s in the middle
    np.savez(tmp_path / "a.npz", force=make_values(6, 3), time=time)
    _, contacts = import_preset("genesis", tmp_path / "a.npz", "--gap-s", 1, "--object", "cup", "--approach", "top")
    assert [(len(contact.time), contact.object, contact.approach) for contact in contacts] == [(20, "cup", "top")] * 2


@pytest.mark.parametrize("option", [("--source", "fake"), ("--time-unit", "h"), ("--columns", "a")])
def test_an_invalid_option_gives_one_error_line(tmp_path, refuse_preset, option):
    write_csv(tmp_path / "a.csv", {"time": make_time(), **number_columns("p", make_values(28))})
    assert f"{option[0]}: expected" in refuse_preset("tsf85", tmp_path / "a.csv", *option)
