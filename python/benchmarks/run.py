"""All benchmarks of the package in one run; prints the tables of docs/benchmarks.md and docs/scale.md.

    pip install mujoco pin jsbsim distributed pandas pyarrow gymnasium
    python benchmarks/run.py [--seconds 3]

Programs that are not installed are left out, and named. Each benchmark is a process of its own, since the package's threads are
chosen when it starts.
"""

import argparse
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent


def run(script, *arguments, threads=1):
    """Runs a benchmark on this number of threads; its table goes to standard output."""
    command = [sys.executable, str(HERE / script), *arguments]
    print(f"`{script} {' '.join(arguments)}`, {threads} thread(s):\n", flush=True)
    code = subprocess.run(command, env={**os.environ, "RAYON_NUM_THREADS": str(threads)}, check=False).returncode
    print(flush=True)
    return code


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3.0, help="duration of each measurement")
    seconds = ["--seconds", str(parser.parse_args().seconds)]
    codes = [
        run("throughput.py", *seconds),
        run("throughput.py", *seconds, "--only", "environments", threads=2),
        run("sweep_cost.py"),
        run("dask_efficiency.py", "--flights", "200", "--chunk", "32"),
    ]
    return max(codes)


if __name__ == "__main__":
    sys.exit(main())
