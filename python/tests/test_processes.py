"""Other processes and Ctrl-C: pools by fork and spawn, copies, and interrupted work."""

import copy
import multiprocessing
import pickle
import subprocess
import sys

import bodyflight
import numpy as np
import pytest

FACTORS = np.random.default_rng(3).normal(1.0, 0.1, (6, 3))


def fly(seed):
    """A hundred skydivers for half a second, as bytes."""
    flights = bodyflight.Skydivers(100)
    random = np.random.default_rng(seed)
    for _ in range(15):
        seen = flights.step(random.uniform(-1.0, 1.0, (100, 8)))
    return seen.tobytes()


# From Python 3.12 on, a fork of a process with threads is warned of.
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("method", sorted({"fork", "spawn"} & set(multiprocessing.get_all_start_methods())))
def test_a_pool_of_processes_gives_the_same_bytes(turn, method):
    flight = bodyflight.Flight(turn)
    # The threads of this process, which a fork does not get, have worked.
    here, flown = bodyflight.sweep(flight, FACTORS), fly(1)
    with multiprocessing.get_context(method).Pool(2) as pool:
        parts = pool.starmap_async(bodyflight.sweep, [(flight, part) for part in np.split(FACTORS, 3)]).get(timeout=60)
        assert np.concatenate(parts).tobytes() == here.tobytes()
        assert pool.map_async(fly, [1, 1]).get(timeout=60) == [flown, flown]
    # And go on working.
    assert bodyflight.sweep(flight, FACTORS).tobytes() == here.tobytes()


def test_joblib_gives_the_same_bytes(turn):
    joblib = pytest.importorskip("joblib")
    flight = bodyflight.Flight(turn)
    here = bodyflight.sweep(flight, FACTORS)
    calls = (joblib.delayed(bodyflight.sweep)(flight, part) for part in np.split(FACTORS, 3))
    assert np.concatenate(joblib.Parallel(n_jobs=2)(calls)).tobytes() == here.tobytes()


INTERRUPTED = """
import os, signal, sys, threading, time
import bodyflight

flight = bodyflight.Flight(sys.argv[1])
sent = []

def interrupt():
    sent.append(time.process_time())
    os.kill(os.getpid(), signal.SIGINT)

threading.Timer(0.4, interrupt).start()
try:
    {call}
except KeyboardInterrupt:
    print(time.process_time() - sent[0])
"""
CALLS = {
    "estimate": "bodyflight.estimate(flight, method='smooth')",
    "discover": "bodyflight.discover([flight])",
    "tune": "bodyflight.tune([flight], draws=100_000)",
    "sweep": "bodyflight.sweep(flight, [[1.0, 1.0, 1.0]] * 5000)",
    "record": "bodyflight.record([[0.0] * 8] * 200_000, sys.argv[2])",
}


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot send itself Ctrl-C there")
@pytest.mark.parametrize("call", CALLS)
def test_ctrl_c_ends_long_work_at_once(turn, tmp_path, call):
    """In a process of its own, that has made no array before."""
    script = INTERRUPTED.format(call=CALLS[call])
    out = tmp_path / "flight.mvnx"
    done = subprocess.run([sys.executable, "-c", script, turn, out], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "panicked" not in done.stderr
    # Seconds of computing, of which the estimate takes 1.5 and the search 2.5.
    assert float(done.stdout) < 0.4
    assert not out.exists()


@pytest.mark.parametrize("copied", [lambda it: pickle.loads(pickle.dumps(it)), copy.copy, copy.deepcopy])
def test_flights_persons_and_runs_are_copied_whole(turn, copied, monkeypatch, tmp_path):
    monkeypatch.chdir(turn)
    flight = bodyflight.Flight("flight.toml", equations="as-published")
    flight = flight.with_subject(flight.subject.scaled(drag=1.1, lift=0.9))
    # A relative path means the same to a process that works elsewhere.
    monkeypatch.chdir(tmp_path)
    same = copied(flight)
    monkeypatch.chdir(turn)
    run, again = bodyflight.simulate(flight), bodyflight.simulate(same)
    assert again.simulated.tobytes() == run.simulated.tobytes()
    assert copied(flight.subject).to_toml() == flight.subject.to_toml()
    kept = copied(run)
    assert kept.report == run.report
    assert kept.motion.velocity.tobytes() == run.motion.velocity.tobytes()
    assert kept.measured.tobytes() == run.measured.tobytes()


@pytest.fixture(scope="module")
def technique(tmp_path_factory):
    """Movement patterns of a turn, with their responses."""
    folder = tmp_path_factory.mktemp("rotations")
    bodyflight.synth("rotations", folder)
    return bodyflight.technique(bodyflight.Flight(folder))


@pytest.mark.parametrize("copied", [lambda it: pickle.loads(pickle.dumps(it)), copy.deepcopy])
def test_recordings_estimations_comparisons_and_techniques_are_copied_whole(turn, technique, copied, tmp_path):
    flight = bodyflight.Flight(turn)
    found = bodyflight.estimate(flight)
    made = [flight.read(), found, bodyflight.compare(flight, flight), technique]
    for it in made:
        same = copied(it)
        for name in [name for name in dir(it) if not name.startswith("__") and not callable(getattr(it, name))]:
            one, other = getattr(it, name), getattr(same, name)
            if isinstance(one, np.ndarray):
                assert one.tobytes() == other.tobytes() and one.shape == other.shape, name
            elif not isinstance(one, bodyflight.MotionArrays):
                assert one == other, name
    assert copied(made[0]).motion.velocity.tobytes() == made[0].motion.velocity.tobytes()
    found.write_csv(tmp_path / "one.csv")
    copied(found).write_csv(tmp_path / "other.csv")
    assert (tmp_path / "other.csv").read_bytes() == (tmp_path / "one.csv").read_bytes()


def test_a_person_with_a_segment_table_is_copied_with_it(tmp_path):
    (tmp_path / "segments.json").write_text('{"segments": [{"name": "head", "mass": 6.0}]}')
    (tmp_path / "subject.toml").write_text(bodyflight.Subject().to_toml() + '\n')
    text = 'segments = "segments.json"\n' + (tmp_path / "subject.toml").read_text()
    (tmp_path / "subject.toml").write_text(text)
    subject = bodyflight.Subject(tmp_path)
    same = pickle.loads(pickle.dumps(subject))
    assert same.segment_table().tobytes() == subject.segment_table().tobytes()
    assert same.mass == subject.mass != bodyflight.Subject().mass
