"""The examples do what they say."""

import sys
from pathlib import Path

import pytest

pytest.importorskip("gymnasium")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))

import learn_turn  # noqa: E402


def test_a_turn_is_learned():
    _, before, after = learn_turn.learn(generations=6, population=16, report=lambda _line: None)
    assert before > 0.5
    assert after < 0.2 * before
