"""The verbs about files give what the program gives."""

import json

import bodyflight
import numpy as np
import pytest
from conftest import ROOT

ROW = "2024-07-14T12:{minute:02}:{second:05.2f}Z,46.0,{lon:.7f},{height:.3f},0.00,{east:.2f},{down:.2f},1.0,1.5,0.3,3,12\n"


def same(printed, found):
    """Whether a printed report says the same, but for what made it."""
    printed = json.loads(printed)
    printed.pop("made_by", None)
    return printed == found


@pytest.fixture(scope="module")
def track(tmp_path_factory):
    """A jump as a FlySight writes it: in the aircraft, a minute of fall with drag, and a canopy."""
    path = tmp_path_factory.mktemp("track") / "12-00-00.CSV"
    text = "time,lat,lon,hMSL,velN,velE,velD,hAcc,vAcc,sAcc,gpsFix,numSV\n,(deg),(deg),(m),(m/s),(m/s),(m/s),(m),(m),(m/s),,\n"
    height, lon, down, step = 4000.0, 7.0, 0.0, 0.2
    for index in range(1700):
        time, east = step * index, 45.0
        if time < 20.0:
            down = 0.0
        elif height > 1000.0:
            down += step * 9.81 * (1.0 - (down / 53.0) ** 2)
            east = 45.0 * max(0.0, 1.0 - (time - 20.0) / 10.0)
        else:
            down, east = (max(5.0, down - step * 20.0), 8.0) if height > 0.0 else (0.0, 0.0)
        height -= step * down
        lon += step * east / 77_340.0
        text += ROW.format(minute=int(time // 60), second=time % 60, lon=lon, height=height, down=down, east=east)
    path.write_text(text)
    return path


def test_a_recording_is_described_as_by_the_program(turn, program):
    file, told = turn / "flight.mvnx", []
    assert same(program("--json", "inspect", file), bodyflight.inspect(file, progress=told.append))
    assert max(told) > 5.0
    # An exception ends the work.
    with pytest.raises(ZeroDivisionError):
        bodyflight.inspect(file, progress=lambda _: 1 / 0)


def test_a_jump_is_analysed_as_by_the_program(track, program):
    found = bodyflight.fall(track, mass=85)
    assert same(program("--json", "fall", track, "--mass", "85"), found)
    assert found["fall_s"] == pytest.approx(59.0, abs=2.0)
    still = track.with_name("still.CSV")
    still.write_text("".join(line for line in track.read_text().splitlines(True)[:90]))
    with pytest.raises(bodyflight.BadInput, match="no free fall"):
        bodyflight.fall(still)
    with pytest.raises(bodyflight.BadInput, match="mass: expected 30 to 300, found 850"):
        bodyflight.fall(track, mass=850)
    shares = []
    book = bodyflight.fall(track.parent, progress=shares.append)
    assert book["tracks"] == 2 and shares and all(0.0 <= share <= 1.0 for share in shares)


def test_a_failed_validation_tells_its_report(track, acrobatics):
    """This flight alone is predicted a little worse than the checks allow for both that are bundled."""
    shares = []
    with pytest.raises(bodyflight.Disagreement, match="expected at most") as raised:
        bodyflight.validate([track, acrobatics], progress=shares.append)
    assert shares and all(0.0 <= share <= 1.0 for share in shares)
    report = raised.value.report
    assert len(report["falls"]) == 1
    assert [check["data"] for check in report["checks"] if not check["holds"]] == ["flight-1"]


def test_motion_of_another_system_becomes_a_flight(tmp_path, program):
    file = ROOT / "verbs/data/cmu/01_01.amc.gz"
    printed = program("--json", "import", file, "--out", tmp_path / "theirs")
    found = bodyflight.import_recording(file, tmp_path / "ours")
    assert found["frames"] == json.loads(printed)["frames"] == 261
    assert (tmp_path / "ours/flight.mvnx").read_bytes() == (tmp_path / "theirs/flight.mvnx").read_bytes()
    with pytest.raises(bodyflight.BadInput, match="exists|overwritten"):
        bodyflight.import_recording(file, tmp_path / "ours")


def test_figures_are_those_of_the_program(turn, program, tmp_path):
    program("figures", turn, "--from", "1", "--to", "3", "--out", tmp_path / "theirs", "--title", "turn")
    drawn = bodyflight.figures(bodyflight.Flight(turn), tmp_path / "ours", between=(1, 3), title="turn")
    assert len(drawn) == 4
    for path in drawn:
        assert path.read_bytes() == (tmp_path / "theirs" / path.name).read_bytes()
    flights = [bodyflight.Flight(turn)] * 2
    together = bodyflight.figures(flights, tmp_path / "two", between=(1, 3))
    names = ["reconstruction", "inputs", "top-view", "snapshots-A", "snapshots-B"]
    assert [path.stem for path in together] == names
    with pytest.raises(bodyflight.BadInput, match="1 to 5 flights in a figure, found 6"):
        bodyflight.figures(flights * 3, tmp_path / "six")
    with pytest.raises(bodyflight.BadInput, match="unknown format"):
        bodyflight.figures(bodyflight.Flight(turn), tmp_path / "other", formats=["svg", "gif"])


def test_a_page_has_the_flights(turn, tmp_path):
    flight = bodyflight.Flight(turn)
    page, told = tmp_path / "page.html", []
    written = bodyflight.view([flight, flight], page, discovery={"verdict": "a finding"}, progress=told.append)
    assert written == {"page": str(page), "bytes": page.stat().st_size, "runs": 2}
    assert "a finding" in page.read_text()
    assert told and np.isfinite(told).all()
    with pytest.raises(bodyflight.BadInput, match="exists"):
        bodyflight.view(flight, page)
