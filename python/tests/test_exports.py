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


def decoded(path):
    """Messages with their times by topic and schema, decoded by Protobuf from what the file says about them; and the schemas."""
    reader = pytest.importorskip("mcap.reader")
    factory = pytest.importorskip("mcap_protobuf.decoder").DecoderFactory()
    topics, schemas = {}, {}
    with open(path, "rb") as file:
        read = reader.make_reader(file, validate_crcs=True, decoder_factories=[factory])
        for schema, channel, message, told in read.iter_decoded_messages():
            assert schema.encoding == channel.message_encoding == "protobuf"
            schemas[schema.name] = schema.data
            topics.setdefault((channel.topic, schema.name), []).append((message.log_time, told))
    return topics, schemas


def placed(transforms):
    """Rotation and place of each frame in the world."""
    poses = {"world": (np.eye(3), np.zeros(3))}
    for one in transforms:
        turned, moved = poses[one.parent_frame_id]
        w, x, y, z = (getattr(one.rotation, part) for part in "wxyz")
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        step = np.array([getattr(one.translation, part) for part in "xyz"])
        poses[one.child_frame_id] = (turned @ turn, moved + turned @ step)
    return poses


def test_a_body_moves_when_mcap_is_read(exported):
    pandas = pytest.importorskip("pandas")
    table = pandas.read_parquet(exported["parquet"])
    topics, _ = decoded(exported["mcap"])
    transforms = topics["/tf", "foxglove.FrameTransforms"]
    for time, message in [transforms[0], transforms[len(transforms) // 2], transforms[-1]]:
        row = int(np.abs(table["time_s"] - time * 1e-9).argmin())
        assert time * 1e-9 == pytest.approx(table["time_s"][row], abs=1e-8)
        poses = placed(message.transforms)
        assert len(poses) == 33
        for side in ["simulated", "measured"]:
            wanted = [table[f"r_foot_{side}_position_{part}_m"][row] for part in ["north", "west", "up"]]
            np.testing.assert_allclose(poses[f"{side}/r_foot"][1], wanted, rtol=0, atol=1e-9)
    (_, body), *more = topics["/body", "foxglove.SceneUpdate"]
    frames = {entity.frame_id for entity in body.entities}
    assert not more and frames == set(poses) - {"world"}
    rows = [message for _, message in topics["/flight", "bodyflight.Body"]]
    names = [field.name for field in rows[0].DESCRIPTOR.fields]
    numbers = np.array([[getattr(row, name) for name in names] for row in rows])
    np.testing.assert_array_equal(numbers.astype(np.float32), table[names].astype(np.float32))
    # Times and places are exact.
    wide = [name for name in names if name.endswith("_m") or name == "time_s"]
    np.testing.assert_array_equal(numbers[:, [names.index(name) for name in wide]], table[wide])
    _, last = topics["/segments", "bodyflight.Segments"][-1]
    force = table["l_hand_force_dorsal_n"].iloc[-1]
    assert last.l_hand.force_dorsal_n == np.float32(force)


def test_the_schemas_are_those_that_foxglove_publishes(exported):
    pb = pytest.importorskip("google.protobuf.descriptor_pb2")
    published = pytest.importorskip("foxglove_schemas_protobuf")
    compared = set()
    for name, data in decoded(exported["mcap"])[1].items():
        for ours in pb.FileDescriptorSet.FromString(data).file:
            if ours.package == "bodyflight":
                meanings = [one.leading_comments for one in ours.source_code_info.location]
                assert any(meaning.endswith("(m/s)") for meaning in meanings) or name != "bodyflight.Body"
                continue
            (own,) = ours.message_type
            package = published.__name__ if ours.package == "foxglove" else "google.protobuf"
            module = __import__(f"{package}.{ours.name.split('/')[-1][:-6]}_pb2", fromlist=["DESCRIPTOR"])
            theirs = pb.FileDescriptorProto()
            module.DESCRIPTOR.CopyToProto(theirs)
            wanted = next(one for one in theirs.message_type if one.name == own.name)

            def fields(message):
                return [(one.name, one.number, one.type, one.type_name, one.label) for one in message.field]

            def values(message):
                return [[(value.name, value.number) for value in one.value] for one in message.enum_type]

            assert fields(own) == fields(wanted) and values(own) == values(wanted), own.name
            assert list(ours.dependency) == sorted(theirs.dependency)
            compared.add(own.name)
    assert {"SceneEntity", "LinePrimitive", "FrameTransform", "PoseInFrame", "Timestamp"} <= compared


def test_files_say_whose_flight_they_hold_and_how_they_were_made(exported, turn):
    parquet = pytest.importorskip("pyarrow.parquet")
    reader = pytest.importorskip("mcap.reader")
    stored = parquet.read_metadata(exported["parquet"]).metadata
    of_table = {name.decode(): text.decode() for name, text in stored.items()}
    with open(exported["mcap"], "rb") as file:
        (record,) = reader.make_reader(file).iter_metadata()
    assert record.name == "bodyflight"
    for about in [record.metadata, of_table]:
        assert about["program"] == f"bodyflight {bodyflight.__version__}"
        assert json.loads(about["arguments"])[0] == "bodyflight.export"
        assert about["subject"] == bodyflight.Flight(turn).subject.to_toml()
        assert "flight.mvnx" in about["flight"]


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
