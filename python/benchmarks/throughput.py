"""Steps per second of bodyflight and other programs on one core, in one run, and actions per second of 1,024 environments.

    pip install mujoco pin biorbd jsbsim
    python benchmarks/throughput.py [--seconds 3]
    RAYON_NUM_THREADS=2 python benchmarks/throughput.py --only environments

All but JSBSim move 16 segments with the same masses, lengths and joints in steps of 1/240 s, but they do not compute the same. In bodyflight
the joint angles are given, by a recording or a policy, and the air acts on every segment. The others solve for 45 joint accelerations:
MuJoCo with ellipsoids in a fluid, pinocchio and biorbd without air. JSBSim moves a single rigid body, a falling ball with drag. The table compares the cost of a flight, not the quality of the programs.
"""

import argparse
import contextlib
import os
import tempfile
import time

# The package reads this once, when it starts its threads.
os.environ.setdefault("RAYON_NUM_THREADS", "1")

import bodyflight
import numpy as np

STEP = 1.0 / 240.0
PARENTS = {
    "abdomen": "pelvis",
    "thorax": "abdomen",
    "head": "thorax",
    "upperarm": "thorax",
    "forearm": "upperarm",
    "hand": "forearm",
    "thigh": "pelvis",
    "shank": "thigh",
    "foot": "shank",
}


def parent(segment):
    side, _, limb = segment.partition("_")
    if side not in ("l", "r"):
        return PARENTS[segment]
    above = PARENTS[limb]
    return f"{side}_{above}" if above in PARENTS and above != "thorax" else above


def rate(work, seconds, clock=time.perf_counter):
    """Returns the steps per second of `work`, which returns its number of steps: a high quantile, since other programs may run too."""
    work()
    rates, end = [], time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = clock()
        steps = work()
        rates.append(steps / (clock() - begin))
    return float(np.quantile(rates, 0.83))


def of_bodyflight(count, seconds):
    """Returns the steps per second of `count` skydivers together."""
    flights = bodyflight.Skydivers(count)
    flights.reset()
    random = np.random.default_rng(0)
    actions = random.uniform(-1.0, 1.0, (64, count, len(flights.controls))).astype(np.float32)
    substeps = round(flights.time_step / STEP)

    def work():
        # Random actions make a body tumble after a while.
        flights.reset()
        calls = 64 if count > 1 else 240
        for call in range(calls):
            flights.step(actions[call % 64])
        return calls * count * substeps

    return rate(work, seconds)


def mujoco_model():
    """Returns the body as a model of MuJoCo."""
    import mujoco

    table = dict(zip(bodyflight.Subject.segments, bodyflight.Subject().segment_table()))
    children = {segment: [] for segment in table}
    for segment in table:
        if segment != "pelvis":
            children[parent(segment)].append(segment)

    def body(segment):
        mass, length = table[segment]
        half = max(0.02, 0.5 * length)
        joint = "<freejoint/>" if segment == "pelvis" else '<joint type="ball" damping="5" stiffness="50"/>'
        geom = f'<geom type="ellipsoid" size="0.06 0.06 {half}" pos="0 0 {-half}" mass="{mass}" contype="0" conaffinity="0"/>'
        inner = "".join(body(child) for child in children[segment])
        return f'<body name="{segment}" pos="0 0 {-2 * half}">{joint}{geom}{inner}</body>'

    text = f'<mujoco><option timestep="{STEP}" density="1.0" integrator="Euler"/><worldbody>{body("pelvis")}</worldbody></mujoco>'
    model = mujoco.MjModel.from_xml_string(text)
    assert model.nv == 6 + 45
    return model


def of_mujoco(seconds):
    import mujoco

    model = mujoco_model()
    data = mujoco.MjData(model)

    def single():
        mujoco.mj_resetData(model, data)
        for _ in range(2000):
            mujoco.mj_step(model, data)
        return 2000

    from mujoco import rollout

    states = np.zeros((64, mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)))
    mujoco.mj_resetData(model, data)
    mujoco.mj_getState(model, data, states[0], mujoco.mjtState.mjSTATE_FULLPHYSICS)
    states[:] = states[0]

    def batched():
        rollout.rollout([model] * 64, [data], states, nstep=100)
        return 64 * 100

    return rate(single, seconds), rate(batched, seconds)


def of_pinocchio(seconds):
    import pinocchio as pin

    table = dict(zip(bodyflight.Subject.segments, bodyflight.Subject().segment_table()))
    model, ids = pin.Model(), {}
    for segment, (mass, length) in table.items():
        if segment == "pelvis":
            above, joint, place = 0, pin.JointModelFreeFlyer(), pin.SE3.Identity()
        else:
            above, joint = ids[parent(segment)], pin.JointModelSpherical()
            place = pin.SE3(np.eye(3), np.array([0.0, 0.0, -table[parent(segment)][1]]))
        ids[segment] = model.addJoint(above, joint, place, segment)
        inertia = pin.Inertia.FromEllipsoid(mass, 0.06, 0.06, max(0.02, 0.5 * length))
        model.appendBodyToJoint(ids[segment], inertia, pin.SE3(np.eye(3), np.array([0.0, 0.0, -0.5 * length])))
    data = model.createData()
    assert model.nv == 6 + 45
    torque = np.zeros(model.nv)

    def single():
        q, v = pin.neutral(model), np.zeros(model.nv)
        for _ in range(2000):
            v = v + STEP * pin.aba(model, data, q, v, torque)
            q = pin.integrate(model, q, STEP * v)
        return 2000

    return rate(single, seconds)


def biorbd_model():
    """Returns the body as the text of a model of biorbd; its joints are three Euler angles each."""
    table = dict(zip(bodyflight.Subject.segments, bodyflight.Subject().segment_table()))
    lines = ["version 4"]
    for segment, (mass, length) in table.items():
        half = max(0.02, 0.5 * length)
        across, along = 0.2 * mass * (0.06**2 + half**2), 0.4 * mass * 0.06**2
        lines.append(f"segment {segment}")
        if segment == "pelvis":
            lines.append("translations xyz")
        else:
            above = parent(segment)
            lines += [f"parent {above}", "RTinMatrix 0", f"RT 0 0 0 xyz 0 0 {-table[above][1]}"]
        inertia = f"{across} 0 0 0 {across} 0 0 0 {along}"
        lines += ["rotations xyz", f"mass {mass}", f"inertia {inertia}", f"com 0 0 {-0.5 * length}", "endsegment"]
    return "\n".join(lines)


def of_biorbd(seconds):
    import biorbd

    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "skydiver.bioMod")
        with open(path, "w") as file:
            file.write(biorbd_model())
        model = biorbd.Model(path)
    assert model.nbQ() == 6 + 45
    torque = np.zeros(model.nbQ())

    def single():
        q, v = np.zeros(model.nbQ()), np.zeros(model.nbQ())
        for _ in range(500):
            v = v + STEP * model.ForwardDynamics(q, v, torque).to_array()
            q = q + STEP * v
        return 500

    return rate(single, seconds)


@contextlib.contextmanager
def silenced():
    """Discards what a library prints to standard output and error, and the files that it writes where it runs."""
    kept = [os.dup(stream) for stream in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            for stream in (1, 2):
                os.dup2(nowhere, stream)
            yield
        finally:
            os.chdir(here)
            for stream, before in zip((1, 2), kept):
                os.dup2(before, stream)
            for one in (*kept, nowhere):
                os.close(one)


def of_jsbsim(seconds):
    """Returns the steps per second of a falling ball in JSBSim."""
    import jsbsim

    with silenced():
        flight = jsbsim.FGFDMExec(None)
        flight.load_model("ball")
        flight.set_dt(STEP)

        def single():
            flight["ic/h-sl-ft"] = 13000.0
            flight.run_ic()
            for _ in range(2000):
                flight.run()
            return 2000

        return rate(single, seconds)


def print_peer(name, work, ours):
    """Prints the row of another program, with how many times as fast bodyflight is, or that it is not installed."""
    try:
        found = np.atleast_1d(work())
    except ImportError:
        print(f"| {name} | not installed | | |")
        return
    cells = [f"{steps:,.0f}" for steps in found] + [""] * (2 - np.size(found))
    times = ", ".join(f"{our / steps:.1f}" for our, steps in zip(ours, found))
    print(f"| {name} | {' | '.join(cells)} | {times} |", flush=True)


def of_environments(seconds):
    """Returns the actions per second of 1,024 environments, with observation, reward and autoreset; and per second of processor time,
    which depends less on what else runs."""
    from bodyflight.gym import SkydiverVectorEnv

    env = SkydiverVectorEnv(1024, task="turn")
    env.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (16, *env.action_space.shape)).astype(np.float32)

    def work():
        for action in actions:
            env.step(action)
        return len(actions) * env.num_envs

    return rate(work, seconds), rate(work, seconds, time.process_time)


def print_environments(seconds):
    actions, of_core = of_environments(seconds)
    print("| 1,024 environments | actions per second | per second of a core |\n|---|---|---|")
    print(f"| {os.environ['RAYON_NUM_THREADS']} thread(s) | {actions:,.0f} | {of_core:,.0f} |")


def print_programs(seconds):
    ours = of_bodyflight(1, seconds), of_bodyflight(1024, seconds)
    print("| program | steps per second, one body | many bodies | bodyflight's as a multiple |\n|---|---|---|---|")
    print(f"| bodyflight; 1,024 bodies | {ours[0]:,.0f} | {ours[1]:,.0f} | |", flush=True)
    print_peer("MuJoCo, Euler; `rollout` of 64", lambda: of_mujoco(seconds), ours)
    print_peer("pinocchio, `aba` and `integrate`", lambda: of_pinocchio(seconds), ours)
    print_peer("biorbd, `ForwardDynamics`", lambda: of_biorbd(seconds), ours)
    print_peer("JSBSim, a ball", lambda: of_jsbsim(seconds), ours)


def main():
    tables = {"environments": print_environments, "programs": print_programs}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3.0, help="duration of each measurement")
    parser.add_argument("--only", choices=tables, help="make this table alone")
    arguments = parser.parse_args()
    chosen = [arguments.only] if arguments.only else tables
    for name in chosen:
        tables[name](arguments.seconds)
        print()


if __name__ == "__main__":
    main()
