"""All benchmarks of the package in one run: prints the tables of docs/benchmarks.md and docs/scale.md, or writes them there.

    pip install mujoco pin biorbd jsbsim distributed pandas pyarrow gymnasium
    python benchmarks/run.py [--seconds 3] [--only sweep] [--write]

Programs that are not installed are left out, and named. Each benchmark is a process of its own, since the package's threads are
chosen when it starts.
"""

import argparse
import datetime
import os
import platform
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
DOCS = HERE.parents[1] / "docs"

# The page of each table, and the benchmarks that make it, with their numbers of threads. The pages have the tables between
# `<!-- NAME -->` and `<!-- end of NAME -->`.
TABLES = {
    "programs": ("benchmarks.md", [("throughput.py --only programs", 1)]),
    "environments": ("benchmarks.md", [("throughput.py --only environments", 1), ("throughput.py --only environments", 2)]),
    "sweep": ("benchmarks.md", [("sweep_cost.py", 1)]),
    "cluster": ("scale.md", [("dask_efficiency.py --flights 960 --chunk 32", 1)]),
}


def machine():
    """Names the processor, the cores that this process may use, and how busy they are."""
    name = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return f"{names[0] if names else name}, {cores} cores, load average {os.getloadavg()[0]:.1f}"


def measured(benchmarks, seconds):
    """Runs the benchmarks of a table; returns it with commands, date and machine."""
    parts = []
    for command, threads in benchmarks:
        script, *arguments = command.split()
        timed = ["--seconds", str(seconds)] if script == "throughput.py" else []
        begin = f"{datetime.date.today()}, {machine()}"
        done = subprocess.run(
            [sys.executable, str(HERE / script), *arguments, *timed],
            env={**os.environ, "RAYON_NUM_THREADS": str(threads)},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        )
        parts.append(f"`RAYON_NUM_THREADS={threads} python/benchmarks/{command}`, {begin}:\n\n{done.stdout.strip()}")
    return "\n\n".join(parts)


def put(page, name, text):
    """Returns the page with this text between the markers of a table."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    before, found, rest = page.partition(begin)
    _, ended, after = rest.partition(end)
    if not found or not ended:
        raise ValueError(f"the page lacks {begin.strip()} followed by {end.strip()}: add both where the table belongs")
    return f"{before}{begin}\n{text}\n\n{end}{after}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3.0, help="duration of each measurement")
    parser.add_argument("--only", choices=TABLES, help="make this table alone")
    parser.add_argument("--write", action="store_true", help="write the tables into the pages")
    arguments = parser.parse_args()
    for name, (page, benchmarks) in TABLES.items():
        if arguments.only not in (None, name):
            continue
        text = measured(benchmarks, arguments.seconds)
        print(f"{text}\n", flush=True)
        if arguments.write:
            path = DOCS / page
            path.write_text(put(path.read_text(encoding="utf-8"), name, text), encoding="utf-8")


if __name__ == "__main__":
    main()
