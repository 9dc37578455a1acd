"""The examples and the README do what they say."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import bodyflight
import numpy as np
import pytest

pytest.importorskip("gymnasium")
PACKAGE = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(PACKAGE / "examples"))

import learn_turn  # noqa: E402
import three_skydivers  # noqa: E402

PROGRAM = Path(sys.executable).with_name("bodyflight")


@pytest.fixture(scope="module")
def learned():
    """A learned policy with its heading errors before and after (rad)."""
    return learn_turn.learn(generations=6, population=16, report=lambda _line: None)


@pytest.fixture(scope="module")
def recording(learned, tmp_path_factory):
    """One flight of the learned policy as a recording."""
    path = tmp_path_factory.mktemp("learned") / "turn.mvnx"
    assert learn_turn.save(learned[0], path) == 300 * 8 + 1
    return path


@pytest.fixture(scope="module")
def page(recording):
    """The learned flight as a page of the installed program."""
    path = recording.with_suffix(".html")
    subprocess.run([PROGRAM, "view", recording, "--out", path], check=True, capture_output=True)
    return path


def test_a_turn_is_learned(learned):
    _, before, after = learned
    assert before > 0.5
    assert after < 0.2 * before


def test_a_recording_holds_the_flight_of_the_actions(tmp_path):
    flights = bodyflight.Skydivers(1)
    actions = np.random.default_rng(3).uniform(-0.5, 0.5, (30, len(flights.controls))).astype(np.float32)
    assert bodyflight.record(actions, tmp_path / "flight.mvnx") == 241
    recording = bodyflight.Flight(tmp_path / "flight.mvnx").read()
    place = [flights.observed.index(f"position_{axis}_m") for axis in ("north", "west", "up")]
    seen = np.array([flights.step(action[None])[0, place] for action in actions])
    # Observations use the geometry at the middle of an action, the recording that at its end.
    np.testing.assert_allclose(recording.motion.position[8::8], seen, rtol=0, atol=0.05)
    # The velocity is the rate of the position.
    flown = np.trapezoid(recording.motion.velocity, recording.time, axis=0)
    np.testing.assert_allclose(flown, recording.motion.position[-1] - recording.motion.position[0], atol=0.05)
    with pytest.raises(bodyflight.BadInput):
        bodyflight.record(actions, tmp_path / "flight.mvnx")


def test_the_page_holds_the_learned_flight(page, learned):
    text = page.read_text()
    data = re.search(r'<script type="application/json" id="bodyflight-data">(.*?)</script>', text, re.DOTALL)
    (run,) = json.loads(data.group(1))["runs"]
    # All but the first frame are compared.
    assert run["frames"] == 300 * 8
    # The flight turned, as the measured yaw rate shows.
    assert run["amplitude"]["yaw_rate_radps"] > 0.1


def test_a_browser_shows_the_learned_flight(page):
    names = ["chromium", "chromium-browser", "google-chrome"]
    browser = next((path for name in names if (path := shutil.which(name))), None)
    if browser is None:
        pytest.skip("no Chromium: cargo xtask viewer --test installs it")
    # Plots need no WebGL, which is slow in software.
    flags = ["--headless", "--no-sandbox", "--disable-3d-apis"]
    shown = subprocess.run(
        [browser, *flags, f"--user-data-dir={page.parent / 'browser'}", "--virtual-time-budget=2000", "--dump-dom", page.as_uri()],
        capture_output=True,
        text=True,
        check=True,
        timeout=180,
    )
    # Plots are made by the page's code, from its data.
    plot = 'data-plot="heading_rad"'
    assert plot in shown.stdout and plot not in page.read_text()


def test_the_patterns_of_three_skydivers_and_their_responses_are_recovered(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(three_skydivers, "HOLD", 2.5)
    flights, found = three_skydivers.analysed(tmp_path, seconds=10.0, error_deg=0.0)
    assert list(found) == list(flights) == ["skilled", "less skilled", "elite"]
    for name, (cosine, error, errors) in found.items():
        assert cosine > 0.999 and error < 0.05 and errors < 1.0, name
    against = three_skydivers.advised(flights)
    assert against["best"] == "skilled" and against["other"]["gain"] > 1.5 * against["own"]["gain"]
    assert "degrees in 2 s" in capsys.readouterr().out


def test_the_snippet_of_the_front_page_runs_on_the_flight_that_its_commands_write(tmp_path, monkeypatch):
    front_page = (PACKAGE.parent / "README.md").read_text()
    (lines,) = re.findall(r"```python\n(.*?)```", front_page, re.DOTALL)
    (command,) = re.findall(r"-- (synth \w+ --out t)\n(?=cargo run --release -- inspect)", front_page)
    subprocess.run([PROGRAM, *command.split()], cwd=tmp_path, check=True)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(lines, names)
    assert names["run"].report["rms"] and names["found"] is not None
    assert names["env"].reset()[0].shape == names["env"].observation_space.shape


def test_the_lines_of_the_readme_reproduce_the_demo(tmp_path, monkeypatch, capsys):
    blocks = re.findall(r"```python\n(.*?)```", (PACKAGE / "README.md").read_text(), re.DOTALL)
    (lines,) = [block for block in blocks if "bodyflight.synth(" in block and "print(" in block]
    assert len(lines.strip().splitlines()) <= 10
    demo = subprocess.run([PROGRAM, "--json", "demo", "--out", tmp_path / "demo"], capture_output=True, text=True, check=True)
    wanted = json.loads(demo.stdout)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "demo").rename(tmp_path / "written")
    names = {}
    exec(lines, names)
    found = names["run"].report
    for table in ["rms", "amplitude"]:
        assert found[table] == wanted[table]
    # The recordings are the same, to the byte.
    assert (tmp_path / "demo/flight.mvnx").read_bytes() == (tmp_path / "written/flight.mvnx").read_bytes()
    printed = capsys.readouterr().out
    assert all(f"{wanted['rms'][channel]:.4f}" in printed for channel in bodyflight.Run.channels)
