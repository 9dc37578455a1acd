"""Exported files, read with the libraries that users read them with, agree with the output of the program."""

import json

import bodyflight
import numpy as np
import pytest


@pytest.fixture(scope="module")
def exported(turn, tmp_path_factory):
    """The flight with turns in every format, with estimates."""
    folder = tmp_path_factory.mktemp("exported")
    files = {}
    for name in ["parquet", "csv", "mcap", "npz"]:
        files[name] = folder / f"run.{name}"
        report = bodyflight.export(bodyflight.Flight(turn), files[name], estimates="smooth")
        assert report["format"] == name
        assert report["bytes"] == files[name].stat().st_size
    return files


def test_pandas_and_polars_open_the_table_with_what_simulate_writes(exported, turn, program, tmp_path):
    pandas, polars, parquet = (pytest.importorskip(name) for name in ["pandas", "polars", "pyarrow.parquet"])
    table = tmp_path / "run.csv"
    program("simulate", turn / "flight.toml", "--out", table)
    simulated = pandas.read_csv(table)
    ours, theirs = pandas.read_parquet(exported["parquet"]), polars.read_parquet(exported["parquet"])
    assert list(ours.columns) == theirs.columns
    # The first frame is where the run starts.
    assert len(ours) == theirs.height == len(simulated) + 1
    for name in simulated.columns:
        np.testing.assert_allclose(ours[name].to_numpy()[1:], simulated[name], rtol=0, atol=5.01e-7)
        np.testing.assert_array_equal(theirs[name].to_numpy(), ours[name])
    schema = parquet.read_schema(exported["parquet"])
    about = schema.field("l_hand_force_dorsal_n").metadata
    assert about[b"unit"] == b"N" and b"force" in about[b"meaning"]
    assert schema.field("simulated_velocity_up_mps").metadata[b"unit"] == b"m/s"
    # Missing values are null.
    assert theirs["estimated_pitch"].null_count() < 10
    assert theirs["time_s"].null_count() == 0


def test_every_format_has_the_same_numbers(exported):
    pandas = pytest.importorskip("pandas")
    table, text = pandas.read_parquet(exported["parquet"]), pandas.read_csv(exported["csv"])
    assert list(text.columns) == list(table.columns)
    np.testing.assert_array_equal(text.to_numpy(), table.to_numpy())
    with np.load(exported["npz"]) as arrays:
        about = json.loads(arrays["about.json"])
        names = [name for name in arrays.files if name != "about.json"]
        assert set(names) == set(about)
        frames = len(table)
        columns = 0
        for name in names:
            array = arrays[name]
            assert array.shape[0] == frames and array.dtype == np.float64
            columns += array[0].size
        assert columns == table.shape[1]
        assert about["segment_force_n"]["segments"] == bodyflight.Subject.segments
        hand = about["segment_force_n"]["segments"].index("l_hand")
        dorsal = about["segment_force_n"]["parts"].index("dorsal")
        np.testing.assert_array_equal(arrays["segment_force_n"][:, hand, dorsal], table["l_hand_force_dorsal_n"])
        attitude = np.stack([table[f"simulated_attitude_{part}"] for part in "wxyz"], axis=1)
        np.testing.assert_array_equal(arrays["simulated_attitude"], attitude)


def test_a_body_moves_when_mcap_is_read(exported):
    pandas = pytest.importorskip("pandas")
    reader = pytest.importorskip("mcap.reader")
    table = pandas.read_parquet(exported["parquet"])
    topics = {}
    with open(exported["mcap"], "rb") as file:
        for schema, channel, message in reader.make_reader(file, validate_crcs=True).iter_messages():
            assert schema.encoding == "jsonschema" and channel.message_encoding == "json"
            topics.setdefault((channel.topic, schema.name), []).append((message.log_time, json.loads(message.data)))
    transforms = topics["/tf", "foxglove.FrameTransforms"]
    assert len(transforms) == len(table)
    for row in [0, len(table) // 2, len(table) - 1]:
        time, message = transforms[row]
        assert time * 1e-9 == pytest.approx(table["time_s"][row], abs=1e-8)
        moved = {one["child_frame_id"]: one for one in message["transforms"]}
        assert len(moved) == 32
        place = moved["simulated/r_foot"]["translation"]
        wanted = [table[f"r_foot_simulated_position_{part}_m"][row] for part in ["north", "west", "up"]]
        np.testing.assert_allclose([place["x"], place["y"], place["z"]], wanted, rtol=0, atol=1e-9)
    (_, body), *more = topics["/body", "foxglove.SceneUpdate"]
    frames = {entity["frame_id"] for entity in body["entities"]}
    assert not more and frames == set(moved)
    numbers = pandas.DataFrame([message for _, message in topics["/flight", "bodyflight.Body"]])
    np.testing.assert_allclose(numbers.astype(float), table[numbers.columns], rtol=0, atol=1e-9)


def test_the_forces_of_the_air_move_the_centre_of_gravity(exported):
    """Newton's law, by differences of the exported numbers alone."""
    pandas = pytest.importorskip("pandas")
    table = pandas.read_parquet(exported["parquet"])
    time = table["time_s"].to_numpy()
    w, x, y, z = (table[f"simulated_attitude_{part}"].to_numpy() for part in "wxyz")
    up = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    force = np.stack(
        [table.filter(regex=f"_force_{part}_n$").to_numpy().sum(axis=1) for part in ["left", "dorsal", "cranial"]]
    )
    cg = np.stack([table[f"cg_{part}_m"].to_numpy() for part in ["left", "dorsal", "cranial"]])
    height = table["simulated_position_up_m"].to_numpy() + (up * cg).sum(axis=0)
    velocity = np.gradient(height, time)
    mass = bodyflight.trim()["mass_kg"]
    # Over several seconds, the change of velocity equals the impulse per mass.
    gained = velocity[-100] - velocity[100]
    pushed = np.trapezoid((up * force).sum(axis=0)[100:-99] / mass - 9.81, time[100:-99])
    assert gained == pytest.approx(pushed, abs=0.05)


def test_typing_errors_are_reported_and_nothing_is_replaced_by_default(turn, tmp_path):
    flight, out = bodyflight.Flight(turn), tmp_path / "run.csv"
    with pytest.raises(bodyflight.BadInput) as raised:
        bodyflight.export(flight, out, format="parqet")
    assert "parquet" in raised.value.help
    with pytest.raises(bodyflight.BadInput):
        bodyflight.export(flight, tmp_path / "run.xlsx")
    bodyflight.export(flight, out)
    with pytest.raises(bodyflight.BadInput) as raised:
        bodyflight.export(flight, out)
    assert "force" in raised.value.help
    bodyflight.export(flight, out, force=True)
