"""What functions take, what they refuse and in which words, and what `help` and the stubs say of them."""

import ast
import inspect
import os
from pathlib import Path

import bodyflight
import numpy as np
import pytest
from bodyflight import _native

STUBS = Path(bodyflight.__file__).with_name("_native.pyi")


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64, np.uint8, list, tuple, np.asfortranarray])
def test_lists_and_other_numbers_are_taken_like_arrays(turn, kind):
    rows = [[1, 1, 1], [2, 1, 0]]
    given = kind(rows) if not isinstance(kind, type) or kind in (list, tuple) else np.array(rows, dtype=kind)
    flight = bodyflight.Flight(turn)
    assert bodyflight.sweep(flight, given).tobytes() == bodyflight.sweep(flight, np.array(rows, dtype=float)).tobytes()
    ours, theirs = bodyflight.Skydivers(2), bodyflight.Skydivers(2)
    action = [[0, 0, 0, 1, 0, 0, 0, -1]] * 2
    assert ours.step(action).tobytes() == theirs.step(np.array(action, dtype=np.float32)).tobytes()


def test_an_array_that_is_not_aligned_is_taken(turn):
    memory = np.zeros(1 + 6 * 8, dtype=np.uint8)[1:]
    factors = memory.view(np.float64).reshape(2, 3)
    factors[:] = 1.0
    assert bodyflight.sweep(bodyflight.Flight(turn), factors).shape == (2, 7)


@pytest.mark.parametrize(
    "given, found",
    [("up", "str"), (None, "NoneType"), ([[1j] * 8] * 2, "complex"), ([[1.0], [1.0, 2.0]], "list"), ([["a"] * 8] * 2, "U1")],
)
def test_what_is_no_array_of_numbers_is_a_type_error(given, found):
    with pytest.raises(TypeError, match=f"actions: expected an array of float32, 2 by 8, .*{found}"):
        bodyflight.Skydivers(2).step(given)


@pytest.mark.parametrize("given, found", [(np.zeros((3, 8)), "3 by 8"), (np.zeros(8), "8 numbers"), (1.0, "a single number")])
def test_another_shape_is_refused_with_both(given, found):
    with pytest.raises(ValueError, match=f"actions: expected an array of 2 by 8, found {found}"):
        bodyflight.Skydivers(2).step(given)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, 1e300])
@pytest.mark.filterwarnings("ignore:overflow")
def test_numbers_that_are_not_finite_are_refused(wrong):
    flights = bodyflight.Skydivers(2)
    before = flights.observe()
    actions = np.zeros((2, 8))
    actions[1, 3] = wrong
    with pytest.raises(bodyflight.BadInput, match="actions, row 1: expected finite numbers, found"):
        flights.step(actions)
    np.testing.assert_array_equal(flights.observe(), before)


def test_bad_input_is_a_value_error(turn):
    assert issubclass(bodyflight.BadInput, bodyflight.BodyflightError)
    with pytest.raises(ValueError) as raised:
        bodyflight.simulate(bodyflight.Flight(turn), start="last")
    assert type(raised.value) is bodyflight.BadInput
    assert raised.value.message in str(raised.value)


def test_a_flight_without_a_recording_fails_at_once(tmp_path, turn):
    with pytest.raises(bodyflight.Refused) as raised:
        bodyflight.Flight("nowhere")
    assert os.fspath(raised.value.file) == "nowhere"
    (tmp_path / "flight.toml").write_text('recording = "gone.mvnx"\n')
    with pytest.raises(bodyflight.Refused, match="gone.mvnx"):
        bodyflight.Flight(tmp_path)
    with pytest.raises(bodyflight.BadInput):
        bodyflight.Flight(turn / "inputs.csv")


def test_remedies_name_arguments_and_not_options(turn, tmp_path):
    there = tmp_path / "there.csv"
    there.write_text("kept")
    flight = bodyflight.Flight(turn)
    calls = {
        "force=True": lambda: bodyflight.export(flight, there),
        ".parquet": lambda: bodyflight.export(flight, tmp_path / "flight.xyz"),
        "library": lambda: bodyflight.fmu(turn / "flight.toml", tmp_path / "unit.fmu", library=tmp_path),
        "import_recording": lambda: bodyflight.Flight(bvh(tmp_path)),
    }
    for remedy, call in calls.items():
        with pytest.raises(bodyflight.BodyflightError) as raised:
            call()
        said = f"{raised.value} {raised.value.help}"
        assert "--" not in said, said
        assert remedy in said or remedy == "library", said
    assert there.read_text() == "kept"


def bvh(folder):
    path = folder / "walk.bvh"
    path.write_text("HIERARCHY\nROOT Hips\n{\n}\nMOTION\nFrames: 0\nFrame Time: 0.01\n")
    return path


def test_estimates_replace_a_file_only_if_told(turn, tmp_path):
    found, there = bodyflight.estimate(bodyflight.Flight(turn)), tmp_path / "inputs.csv"
    there.write_text("kept")
    with pytest.raises(bodyflight.BadInput, match="exists"):
        found.write_csv(there)
    assert there.read_text() == "kept"
    found.write_csv(there, force=True)
    assert there.read_text().startswith("time_s")


def public():
    """Everything that the package offers, with the methods of classes."""
    for name in bodyflight.__all__:
        item = getattr(bodyflight, name)
        if inspect.isclass(item) and not issubclass(item, BaseException):
            yield name, item
            for method in vars(item):
                if not method.startswith("_") and callable(getattr(item, method)):
                    yield f"{name}.{method}", getattr(item, method)
        elif inspect.isroutine(item):
            yield name, item


@pytest.mark.parametrize("name, item", list(public()))
def test_help_has_words_and_defaults(name, item):
    assert item.__doc__, name
    for parameter in inspect.signature(item).parameters.values():
        assert parameter.default is not Ellipsis, (name, parameter)


def test_defaults_that_are_shown_are_those_used(tmp_path):
    assert bodyflight.trim() == bodyflight.trim(density=inspect.signature(bodyflight.trim).parameters["density"].default)
    shown = inspect.signature(bodyflight.Skydivers).parameters["density"].default
    assert bodyflight.Skydivers(1).step([[0] * 8]).tobytes() == bodyflight.Skydivers(1, density=shown).step([[0] * 8]).tobytes()
    assert bodyflight.linearize().fall == bodyflight.linearize(density=shown).fall
    bodyflight.synth("rotations", tmp_path / "a")
    options = inspect.signature(bodyflight.synth).parameters.values()
    bodyflight.synth("rotations", tmp_path / "b", **{it.name: it.default for it in options if it.default is not it.empty})
    assert (tmp_path / "a/flight.mvnx").read_bytes() == (tmp_path / "b/flight.mvnx").read_bytes()


def arguments(function):
    """Names of the arguments of a stub with their defaults."""
    given = function.args
    names = [it.arg for it in given.posonlyargs + given.args]
    found = dict.fromkeys(names, inspect.Parameter.empty)
    found.update(zip(reversed(names), map(ast.literal_eval, reversed(given.defaults))))
    for argument, default in zip(given.kwonlyargs, given.kw_defaults):
        found[argument.arg] = inspect.Parameter.empty if default is None else ast.literal_eval(default)
    found.pop("self", None)
    return found


def stubs():
    for node in ast.parse(STUBS.read_text()).body:
        if isinstance(node, ast.FunctionDef):
            yield node.name, node
        elif isinstance(node, ast.ClassDef):
            for method in node.body:
                is_property = isinstance(method, ast.FunctionDef) and method.decorator_list[:1] and method.decorator_list[0].id
                if isinstance(method, ast.FunctionDef) and is_property != "property" and method.name != "__len__":
                    yield f"{node.name}.{method.name}".removesuffix(".__init__"), method


@pytest.mark.parametrize("name, stub", list(stubs()))
def test_stubs_have_the_signatures_of_the_functions(name, stub):
    item = _native
    for part in name.split("."):
        item = getattr(item, part)
    found = {it.name: it.default for it in inspect.signature(item).parameters.values() if it.name != "self"}
    assert arguments(stub) == found
    assert list(arguments(stub)) == list(found)
