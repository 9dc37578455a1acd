"""The pages have the tables that `benchmarks/run.py --write` makes."""

import importlib.util

import pytest
from conftest import ROOT


@pytest.fixture(scope="module")
def run():
    spec = importlib.util.spec_from_file_location("benchmarks_run", ROOT / "python/benchmarks/run.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_table_has_its_place_and_the_commands_that_made_it(run):
    for name, (page, benchmarks) in run.TABLES.items():
        text = (ROOT / "docs" / page).read_text(encoding="utf-8")
        table = text.split(f"<!-- {name} -->\n")[1].split(f"<!-- end of {name} -->\n")[0]
        for command, threads in benchmarks:
            assert f"`RAYON_NUM_THREADS={threads} python/benchmarks/{command}`" in table
        # What the command writes again changes nothing else.
        assert run.put(text, name, table.strip("\n")) == text


def test_a_page_without_the_markers_is_refused(run):
    with pytest.raises(ValueError, match="<!-- sweep -->"):
        run.put("<!-- cluster -->\n<!-- end of cluster -->\n", "sweep", "")


def test_a_table_is_what_its_benchmark_prints(run, monkeypatch, tmp_path):
    (tmp_path / "b.py").write_text("import os, sys\nprint('|', os.environ['RAYON_NUM_THREADS'], *sys.argv[1:], '|')\n")
    monkeypatch.setattr(run, "HERE", tmp_path)
    table = run.measured([("b.py --x 1", 2)], seconds=3.0)
    assert table.startswith("`RAYON_NUM_THREADS=2 python/benchmarks/b.py --x 1`, 20")
    assert table.endswith("\n\n| 2 --x 1 |")
