import os
import subprocess
from pathlib import Path

import bodyflight
import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def program():
    """Runs the program as built from the workspace; returns its output as text."""
    path = os.environ.get("BODYFLIGHT")
    if path is None:
        pytest.skip("BODYFLIGHT does not name the program to compare with: cargo xtask python does")

    def run(*arguments):
        done = subprocess.run([path, *map(str, arguments)], capture_output=True, text=True, check=False)
        return done.stdout

    return run


@pytest.fixture(scope="session")
def turn(tmp_path_factory):
    """Folder of a synthetic flight with turns."""
    folder = tmp_path_factory.mktemp("turn")
    bodyflight.synth("aggressive-turns", folder, seed=3)
    return folder


@pytest.fixture(scope="session")
def acrobatics():
    """A real twisting somersault, part of the project."""
    return ROOT / "verbs/data/acrobatics/flight-1.toml"
