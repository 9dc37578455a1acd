"""The package installs the program, including its page."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

PROGRAM = Path(sys.executable).with_name("bodyflight")


def run(*arguments, **options):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, check=False, **options)


def test_it_answers_as_the_program_does(program, turn):
    ours = run("--json", "estimate", turn)
    assert ours.returncode == 0, ours.stderr
    found, wanted = json.loads(ours.stdout), json.loads(program("--json", "estimate", turn))
    found.pop("filter_s"), wanted.pop("filter_s")
    assert found == wanted
    assert run("--version").stdout == program("--version")
    module = subprocess.run([sys.executable, "-m", "bodyflight", "trim"], capture_output=True, text=True, check=True)
    assert module.stdout == program("trim")


def test_problems_have_its_exit_codes(tmp_path):
    missing = run("simulate", tmp_path / "none.toml", "--json")
    assert missing.returncode == 3
    assert json.loads(missing.stderr)["error"]["exit_code"] == 3
    assert run("simulte").returncode == 2


def test_it_has_the_page(turn, tmp_path):
    page = tmp_path / "page.html"
    seen = run("view", turn, "--out", page)
    assert seen.returncode == 0, seen.stderr
    text = page.read_text()
    assert "bodyflight-data" in text and len(text) > 100_000
    # The provenance names the command without the interpreter.
    assert f"bodyflight view {turn.name}" in text


def test_ctrl_c_ends_it(turn):
    process = subprocess.Popen(
        [PROGRAM, "tune", turn, "--draws", "100000"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    time.sleep(1.0)
    os.kill(process.pid, signal.SIGINT)
    _, message = process.communicate(timeout=20)
    assert process.returncode == 130, message
