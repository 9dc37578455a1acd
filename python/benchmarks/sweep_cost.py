"""Processor time of a sweep, per flight: one flight at a time, and many together.

    python benchmarks/sweep_cost.py [--flights 64]
"""

import argparse
import os
import tempfile
import time
from pathlib import Path

os.environ.setdefault("RAYON_NUM_THREADS", "1")

import bodyflight
import numpy as np


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=64)
    flights = parser.parse_args().flights
    with tempfile.TemporaryDirectory() as folder:
        bodyflight.synth("aggressive-turns", folder, seed=3)
        flight = bodyflight.Flight(Path(folder) / "flight.toml")
        factors = np.random.default_rng(1).normal(1.0, 0.1, (flights, 3))

        def seconds(rows):
            begin = time.process_time()
            found = bodyflight.sweep(flight, rows)
            return time.process_time() - begin, found

        # The first call does more than the others.
        _, wanted = seconds(factors)
        some = factors[: flights // 4]
        single = [seconds(row[None]) for row in some]
        # Reading the recording is the same for both.
        reading = np.median([seconds(factors[:0])[0] for _ in some])
        together = np.median([seconds(factors)[0] for _ in range(5)])
    alone = np.median([seconds for seconds, _ in single]) - reading
    together = (together - reading) / flights
    assert alone > 0.0 and together > 0.0, "the machine is too busy to tell"
    assert all(found.tobytes() == row.tobytes() for (_, found), row in zip(single, wanted))
    print("| flights of 30 s at 240 Hz | processor time of a flight (ms) | flights per second of a core |\n|---|---|---|")
    print(f"| one at a time | {1e3 * alone:.1f} | {1 / alone:.0f} |")
    print(f"| {flights} together | {1e3 * together:.1f} | {1 / together:.0f} |")


if __name__ == "__main__":
    main()
