//! Derivatives agree with differences of finely integrated simulations.

use super::*;
use crate::jacobian::effect_parameters::parameters_of;
use crate::jacobian::finite_difference::effects_alone;

/// Effects whose slope has kinks, because drag depends on the face with the largest projection.
const SHAPES: [Effect; 3] = [Effect::TrunkShape, Effect::ArmShape, Effect::LegShape];

#[test]
fn every_parameter_has_a_column_and_every_stretch_its_numbers() {
    let track = track(&[], 1.0);
    let plain = plain(&track);
    let all = all_parameters();
    let mut felt = vec![0.0; all.len()];
    let mut subject = vec![0.0; SUBJECT];
    for stretch in stretches(&track) {
        let files = LinearizationPoint::files();
        let found = residual(&track, &stretch, &plain, &files);
        let columns = linearized(&track, &stretch, &plain, &files, &found).unwrap();
        let effects = effects_alone(&track, &stretch, &plain, &files, &all);
        assert_eq!(effects.shape(), (stretch.grid.residuals(), all.len()));
        assert_eq!(
            columns.joints.each_ref().map(nalgebra::DMatrix::ncols),
            [JOINTS; 3]
        );
        for (felt, column) in felt.iter_mut().zip(effects.column_iter()) {
            *felt += column.norm_squared();
        }
        for (felt, column) in subject.iter_mut().zip(columns.subject.column_iter()) {
            *felt += column.norm_squared();
        }
    }
    // All but a tunnel's profile act in still air; a shape acts only through the face with the largest projection.
    let unfelt = [&[Effect::TunnelProfile], &SHAPES[..]].concat();
    for (id, felt) in all.iter().zip(felt) {
        let name = id.effect.description().name;
        assert!(
            felt > 1e-6 || unfelt.contains(&id.effect),
            "{name} {}",
            id.index
        );
    }
    for (k, felt) in subject.into_iter().enumerate() {
        assert_eq!(felt > 1e-9, described(k).is_some(), "{k}: {felt}");
    }
}

/// Some effects add to a value, some multiply it, some replace it. The columns must be right for all of them, even if
/// the effect already acts.
#[test]
fn columns_are_slopes_wherever_an_effect_stands() {
    let track = track(&[], 0.0);
    let plain = plain(&track);
    let stretch = &stretches(&track)[2];
    let smooth = all_parameters()
        .into_iter()
        .filter(|id| !SHAPES.contains(&id.effect));
    for id in smooth {
        let parameter = &id.effect.description().parameters[id.index];
        let mut values = id.effect.neutral();
        values[id.index] += 0.5 * (parameter.high - parameter.neutral);
        let at = |step: f64| {
            let mut values = values;
            values[id.index] += step;
            -residual(&track, stretch, &plain, &believed(&[(id.effect, values)]))
        };
        let small = 0.02 * (parameter.high - parameter.low);
        let central = (at(small) - at(-small)) / (2.0 * small);
        let effects = vec![(id.effect, values)];
        let (model, size) = changed(&plain, &effects, id);
        let prepared = |model: &Model<f64>| {
            let flight = Simulator::new(&track, stretch, model, &JointErrors::none(), Steps::Long);
            flight.residual(&Channels::zeros(), None)
        };
        let column = (prepared(&extended(&plain, &effects)) - prepared(&model)) / size;
        let name = id.effect.description().name;
        let apart = (&column - &central).norm();
        assert!(
            apart < 0.25 * central.norm() + 1e-6,
            "{name} {}: {apart} of {}",
            id.index,
            central.norm()
        );
    }
}

/// A body that hardly damps its rotation spins fast. Slopes from steps in which it turns far are wrong many times over.
#[test]
fn slopes_of_a_fast_spin_do_not_depend_on_the_step() {
    let hidden = Hidden::Effect(Effect::LocalFlow, [1.28, 0.0, 0.0]);
    let track = lasting(40.0, &[hidden], 0.0);
    let plain = plain(&track);
    let mut fastest = 0.0_f64;
    for stretch in stretches(&track) {
        let slopes = |stride: usize| {
            let mut stretch = stretch.clone();
            stretch.grid.stride = stride;
            let none = JointErrors::none();
            let flight = Simulator::new(&track, &stretch, &plain, &none, Steps::Long);
            let mut by = Channels::zeros();
            by.fixed_rows_mut::<3>(3).fill(0.01);
            flight.residual(&Channels::zeros(), None) - flight.residual(&by, None)
        };
        let (found, fine) = (slopes(stretch.grid.stride), slopes(1));
        let frames = &track.samples[stretch.first..stretch.first + stretch.grid.frames()];
        let spin = frames
            .iter()
            .map(|sample| sample.motion.angular_velocity.components.norm());
        fastest = spin.fold(fastest, f64::max);
        let apart = (&found - &fine).norm() / fine.norm();
        assert!(apart < 0.05, "frame {}: {apart}", stretch.first);
    }
    assert!(fastest > 12.0, "{fastest}");
}

/// Joints as wrong as a suit's leave residuals of some degrees, at which rotations no longer add up.
#[test]
fn slopes_are_those_of_the_residual_where_it_is_large() {
    let track = track(&[], 1.0);
    let plain = plain(&track);
    for effect in [Effect::FootDrag, Effect::Drag, Effect::Muscle] {
        let mut values = effect.neutral();
        let ids = parameters_of([effect]);
        let step = 0.05;
        values[0] += step;
        let changed = believed(&[(effect, values)]);
        let (mut apart, mut norm) = (0.0, 0.0);
        for stretch in stretches(&track) {
            let at = |point: &LinearizationPoint| residual(&track, &stretch, &plain, point);
            let actual = (at(&LinearizationPoint::files()) - at(&changed)) / step;
            let slopes =
                effects_alone(&track, &stretch, &plain, &LinearizationPoint::files(), &ids);
            for row in (0..stretch.grid.residuals()).step_by(CHANNELS) {
                let attitude = actual.rows(row, 3);
                apart += (attitude - slopes.view((row, 0), (3, 1))).norm_squared();
                norm += attitude.norm_squared();
            }
        }
        let share = f64::sqrt(apart / norm);
        assert!(share < 0.02, "{effect:?}: {share}");
    }
}

/// Of a simulation with another joint, another subject or an effect, only what differs is computed.
#[test]
fn what_is_kept_of_a_simulation_has_the_bits_of_a_new_one() {
    let track = track(&[], 1.0);
    let plain = plain(&track);
    let stretch = &stretches(&track)[2];
    let mut wrong = JointErrors::none();
    for k in 0..JOINTS {
        wrong.course[k % 3][k] = 0.001 * k as f64;
        wrong.bend[k] = 0.002 * k as f64;
    }
    let new = |model: &Model<f64>, joints: &JointErrors| {
        Simulator::new(&track, stretch, model, joints, Steps::Long)
    };
    let seen = |flight: Simulator<'_>| flight.residual(&Channels::zeros(), None);
    let base = new(&plain, &wrong);
    for k in 0..JOINTS {
        let mut joints = wrong.clone();
        joints.course[k % 3][k] += 0.02;
        let kept = base.with_joint(&joints, k / 3);
        assert_eq!(seen(kept), seen(new(&plain, &joints)), "joint angle {k}");
    }
    for k in 0..SUBJECT {
        let mut subject = Subject::as_in_file();
        subject.0[k] += 0.01;
        let model = subject.possible().of(&plain);
        let kept = base.changed_to(&model);
        assert_eq!(seen(kept), seen(new(&model, &wrong)), "subject {k}");
    }
    for id in all_parameters() {
        let (model, _) = changed(&plain, &Vec::new(), id);
        let kept = base.changed_to(&model);
        assert_eq!(seen(kept), seen(new(&model, &wrong)), "{id:?}");
    }
}
