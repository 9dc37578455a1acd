"""Exceptions have the parts of the problem as attributes, and Ctrl-C interrupts long work."""

import os
import signal
import threading

import bodyflight
import numpy as np
import pytest


def test_a_missing_file_is_refused_by_name(tmp_path):
    with pytest.raises(bodyflight.Refused) as raised:
        bodyflight.Flight(tmp_path / "none.toml")
    assert os.fspath(raised.value.file) == os.fspath(tmp_path / "none.toml")


def test_a_bad_value_is_named_by_line_and_field():
    with pytest.raises(bodyflight.BadInput) as raised:
        bodyflight.Subject.from_toml("height_m = 1.8\nmass_kg = -3\nsex = \"male\"\n")
    assert raised.value.line == 2
    assert "mass_kg" in raised.value.place
    assert isinstance(raised.value, bodyflight.BodyflightError)


@pytest.mark.parametrize(
    "call",
    [
        lambda turn: bodyflight.Flight(turn, equations="exakt"),
        lambda turn: bodyflight.simulate(bodyflight.Flight(turn), start="smooth"),
        lambda turn: bodyflight.simulate(bodyflight.Flight(turn), precision="doubel"),
        lambda turn: bodyflight.estimate(bodyflight.Flight(turn), method="smoth"),
        lambda turn: bodyflight.synth("barel-roll", turn),
        lambda turn: bodyflight.Skydivers(1, start="neutrall"),
    ],
)
def test_a_typing_error_gets_a_suggestion(turn, call):
    with pytest.raises(bodyflight.BadInput) as raised:
        call(turn)
    assert raised.value.help


def test_an_exception_in_progress_ends_the_work(turn):
    class Enough(Exception):
        pass

    def progress(_time):
        raise Enough

    flight = bodyflight.Flight(turn)
    with pytest.raises(Enough):
        bodyflight.simulate(flight, progress=progress)
    # The next call is not interrupted.
    assert bodyflight.simulate(flight).report["frames"] > 1000


def test_ctrl_c_ends_long_work(turn):
    flight = bodyflight.Flight(turn)
    timer = threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        bodyflight.tune([flight], draws=100_000)
    assert bodyflight.simulate(flight).report["frames"] > 1000


def test_other_threads_keep_running(turn):
    """The interpreter's lock is released: one thread counts while another simulates."""
    flight = bodyflight.Flight(turn)
    counted, done = [0], threading.Event()

    def count():
        while not done.is_set():
            counted[0] += 1

    thread = threading.Thread(target=count)
    thread.start()
    before = counted[0]
    bodyflight.sweep(flight, np.ones((4, 3)))
    during = counted[0] - before
    done.set()
    thread.join()
    assert during > 1000
