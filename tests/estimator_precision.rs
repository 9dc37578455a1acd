//! Single precision at the fastest motion that is legal on the line.

use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::frame::{Vector, facing_north};

#[test]
fn a_step_at_the_fastest_motion_differs_by_less_than_sensors_resolve() {
    let body = Person::new(1.75, 75.0, Sex::Male).body().unwrap();
    let dynamics = Dynamics::paper(body, 1.0);
    let posture = pattern::neutral();
    for (axis, sign) in [(0, 1.0), (1, 1.0), (2, 1.0), (0, -1.0), (1, -1.0), (2, -1.0)] {
        let mut spin = [0.0; 3];
        spin[axis] = 35.0 * sign;
        let [x, y, z] = spin;
        let motion = Motion {
            inertial_from_body: facing_north(1.3),
            position: Vector::zero(),
            velocity: Vector::new(30.0, -80.0, 52.0),
            angular_velocity: Vector::new(x, y, z),
        };
        let exact = dynamics.hold(&posture);
        let single = dynamics.cast::<f32>().hold(&posture.cast());
        let inputs = Inputs::belly_turn();
        let state = State::from_motion(&motion, &exact);
        let step = 1.0 / 240.0;
        let found = dynamics.step(&state, &exact, &inputs, step).motion(&exact);
        let rounded = dynamics.cast::<f32>().step(
            &State::from_motion(&motion.cast(), &single),
            &single,
            &inputs.cast(),
            step as f32,
        );
        let rounded: Motion<f64> = rounded.motion(&single).cast();
        let turn = (found.angular_velocity - rounded.angular_velocity).norm();
        let speed = (found.velocity - rounded.velocity).norm();
        println!("{spin:?}: {turn:.1e} rad/s, {speed:.1e} m/s");
        assert!(turn < 2e-4 && speed < 2e-4, "{spin:?}: {turn} {speed}");
    }
}
