"""Three ways to turn, and what each does: a skilled, a less skilled and an elite skydiver.

    python three_skydivers.py [--seconds 30] [--error-deg 1] [--seed 1] [--out FOLDER]

A. Clarke and P.-O. Gutman (arXiv 2201.05917) compare three skydivers by the movement patterns with which they turn, and by the
response of the turn rate to each pattern. Their recordings are not published, so these three are simulated: all turn to the same
headings by the same feedback, but move different joints. The skilled one tilts the arms against each other. The less skilled one
also bends trunk and thighs towards the turn, which takes away what the arms do when the movement is quick. The elite one bends them
the other way, and gets more of a quick movement.

Joints are recorded wrong by a degree that wanders, as a suit does. The patterns are found in the recordings by
``bodyflight.technique``; what was really moved is known, so the script prints how near the found gains are.
"""

import argparse
import tempfile
from pathlib import Path

import bodyflight
import numpy as np

#: Share of the patterns ``turn`` and ``side-slide`` of ``Skydivers.controls`` in the movement of each person.
PEOPLE = {"skilled": (1.0, 0.0), "less skilled": (1.0, 0.5), "elite": (1.0, -0.5)}
#: Changes of joints (rad) by the whole range of the two patterns.
TURN = {"l_upperarm.phi": 0.125, "r_upperarm.phi": -0.125}
BEND = {
    "abdomen.theta": 0.2,
    "thorax.theta": 0.2,
    **dict.fromkeys(["l_upperarm.theta", "r_upperarm.theta", "l_thigh.theta", "r_thigh.theta"], -0.25),
}
#: Time between two headings (s), and the headings (full circles to the left).
HOLD, HEADINGS = 6.0, [0.0, 1.0, 0.0, 0.5, -0.5]
#: Feedback of the heading (1/rad) and of the turn rate (s/rad).
STIFFNESS, DAMPING = 0.9, 0.7
#: Most change of the movement in an action, in which joints can follow both patterns in step.
QUICKEST = 0.05
#: Frequencies of the wandering errors of the suit (Hz).
WANDER_HZ = np.linspace(0.08, 0.5, 8)
#: Frequency up to which gains are compared (Hz).
HIGHEST_HZ = 2.0


def fly(shares, seconds, path):
    """Turns to the headings by feedback, and writes the recording."""
    flight = bodyflight.Skydivers(1)
    place = [flight.observed.index(f"heading_{part}") for part in ("sin", "cos")]
    controls = [flight.controls.index(name) for name in ("turn", "side-slide")]
    actions = np.zeros((round(seconds / flight.time_step), len(flight.controls)), dtype=np.float32)
    heading, rate, moved_by = 0.0, 0.0, 0.0
    for step, action in enumerate(actions):
        aim = 2.0 * np.pi * HEADINGS[int(step * flight.time_step / HOLD) % len(HEADINGS)]
        wanted = np.clip(STIFFNESS * (aim - heading) - DAMPING * rate, -1.0, 1.0)
        moved_by += np.clip(wanted - moved_by, -QUICKEST, QUICKEST)
        action[controls] = moved_by * np.array(shares)
        sine, cosine = flight.step(action[None])[0, place]
        turned = np.remainder(np.arctan2(sine, cosine) - heading + np.pi, 2.0 * np.pi) - np.pi
        heading, rate = heading + turned, turned / flight.time_step
    bodyflight.record(actions, path)


def by_a_suit(path, out, error_rad, seed):
    """Writes the flight again, its joints wrong by an error that wanders. Returns it."""
    read = bodyflight.Flight(path).read()
    random = np.random.default_rng(seed)
    joints = read.parent_from_segment.shape[1] - 1
    phases = random.uniform(0.0, 2.0 * np.pi, (len(WANDER_HZ), joints, 3))
    size = error_rad / np.sqrt(len(WANDER_HZ))
    waves = np.sin(2.0 * np.pi * WANDER_HZ[:, None] * read.time)
    others = np.cos(2.0 * np.pi * WANDER_HZ[:, None] * read.time)
    error = size * (np.einsum("ft,fjc->tjc", waves, np.cos(phases)) + np.einsum("ft,fjc->tjc", others, np.sin(phases)))
    wrong = read.parent_from_segment.copy()
    w, v = wrong[:, 1:, :1], wrong[:, 1:, 1:]
    half = 0.5 * error
    wrong[:, 1:, 1:] = v + w * half + np.cross(half, v)
    wrong[:, 1:, :1] = w - np.sum(half * v, axis=2, keepdims=True)
    wrong /= np.linalg.norm(wrong, axis=2, keepdims=True)
    return bodyflight.Flight.from_arrays(
        out,
        time=read.time,
        parent_from_segment=wrong,
        inertial_from_body=read.motion.inertial_from_body,
        position=read.motion.position,
        velocity=read.motion.velocity,
        angular_velocity=read.motion.angular_velocity,
    )


def moved(shares, joints):
    """The movement that was flown, of length 1, in the order of ``joints``."""
    weights = np.zeros(len(joints))
    for pattern, share in zip([TURN, BEND], shares, strict=True):
        for joint, change in pattern.items():
            weights[joints.index(joint)] += share * change
    return weights / np.linalg.norm(weights)


def gain(linear, weights, frequency):
    """Size of the response of the turn rate (rad/s per rad) to a movement, at frequencies (Hz)."""

    def at(s):
        states = np.linalg.solve(s * np.eye(len(linear.A)) - linear.A, (linear.B + s * linear.B_rate) @ weights)
        return linear.C[0] @ states + (linear.D[0] + s * linear.D_rate[0]) @ weights

    return np.array([abs(at(2j * np.pi * hertz)) for hertz in frequency])


def analysed(folder, seconds=30.0, error_deg=1.0, seed=1, report=print):
    """Flies and analyses the three.

    Returns their flights, and for each the cosine between the found and the flown movement, the largest error of its gains as a
    share, and the same in standard deviations.
    """
    linear = bodyflight.linearize()
    flights, found = {}, {}
    report(f"{'':12} {'cosine':>7} {'gain at 0.02 Hz':>16} {'at 2 Hz':>14} {'truly':>6} {'error to 2 Hz':>14}")
    for number, (name, shares) in enumerate(PEOPLE.items()):
        path = folder / f"{name.replace(' ', '-')}.mvnx"
        fly(shares, seconds, path)
        flights[name] = by_a_suit(path, path.with_suffix(""), np.radians(error_deg), seed + number)
        technique = bodyflight.technique(flights[name])
        place = technique.report["turning"] - 1
        truth = moved(shares, technique.joints)
        cosine = abs(technique.told[place] @ truth)
        used = technique.frequency <= HIGHEST_HZ
        ours, deviation = technique.gain[place, 0, used], technique.gain_deviation[place, 0, used]
        exact = gain(linear, truth, technique.frequency[used])
        error, errors = np.max(np.abs(ours / exact - 1.0)), np.max(np.abs(ours - exact) / deviation)
        found[name] = (cosine, error, errors)
        slow, quick = (f"{ours[k]:.2f} +- {deviation[k]:.2f}" for k in (0, -1))
        report(f"{name:12} {cosine:7.3f} {slow:>16} {quick:>14} {exact[-1]:6.2f} {100.0 * error:12.1f} %")
    return flights, found


def advised(flights, report=print):
    """Compares the less skilled person with the others. Returns the comparison."""
    technique = bodyflight.technique(flights["less skilled"], against=[flights["skilled"], flights["elite"]])
    against = technique.report["against"]
    turned = {key: np.degrees(against[f"{key}_turn"]["turned_rad"]) for key in ("own", "other")}
    report(f"\nThe best technique for this body is that of {against['best']}: by the full simulation, {turned['other']:.0f}")
    report(f"degrees in 2 s for a movement of {np.degrees(against['step_rad']):.1f} degrees, and {turned['own']:.0f} with the own one.")
    return against


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--error-deg", type=float, default=1.0, help="error of the recorded joints; it wanders")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="keep the flights")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        out = arguments.out or Path(folder)
        out.mkdir(parents=True, exist_ok=True)
        flights, _ = analysed(out, arguments.seconds, arguments.error_deg, arguments.seed)
        advised(flights)


if __name__ == "__main__":
    main()
