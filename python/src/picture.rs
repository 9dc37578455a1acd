//! Pictures of a skydiver: the solids of the segments, seen by a camera that follows the body and does not turn with it.

use bodyflight_core::body::posture::pose;
use bodyflight_core::dynamics::Motion;
use bodyflight_core::{Body, Posture, Segment};
use bodyflight_viewer::frame::half_extents;
use nalgebra::{Matrix3, Vector3};

/// Direction in which the camera looks, over ground from north towards west and below the horizon (rad).
const LOOKS: (f64, f64) = (0.9, 0.45);
/// Height of what a picture shows (m).
const SHOWN: f64 = 2.6;
/// Direction to the light: north, west, up.
const LIGHT: [f64; 3] = [-0.4, -0.3, 0.866];
/// Share of the light that reaches every side.
const AMBIENT: f64 = 0.35;
/// Colours (red, green, blue; 0 to 1): the front and the back of the body, the mark of the goal, the sky below and above.
const FRONT: [f64; 3] = [0.92, 0.55, 0.25];
const BACK: [f64; 3] = [0.33, 0.38, 0.48];
const MARK: [f64; 3] = [0.15, 0.65, 0.30];
const SKY: [[f64; 3]; 2] = [[0.93, 0.95, 0.97], [0.62, 0.77, 0.93]];
/// Distance of the goal's mark from the pelvis, and its half extents along and across its direction (m).
const MARK_DISTANCE: f64 = 1.05;
const MARK_EXTENTS: [f64; 2] = [0.2, 0.03];

/// An ellipsoid, as the camera sees it: right, up, towards the viewer.
struct Ellipsoid {
    /// From the unit sphere.
    from_sphere: Matrix3<f64>,
    to_sphere: Matrix3<f64>,
    centre: Vector3<f64>,
    /// Colours of the sides with positive and negative second component on the sphere.
    colors: [[f64; 3]; 2],
}

impl Ellipsoid {
    fn new(
        axes: &Matrix3<f64>,
        half: Vector3<f64>,
        centre: Vector3<f64>,
        colors: [[f64; 3]; 2],
    ) -> Option<Self> {
        let from_sphere = axes * Matrix3::from_diagonal(&half);
        Some(Self {
            from_sphere,
            to_sphere: from_sphere.try_inverse()?,
            centre,
            colors,
        })
    }

    /// Where the line of sight through a place (right, up) first meets the surface: how near to the viewer, and the point on
    /// the sphere.
    fn met(&self, right: f64, up: f64) -> Option<(f64, Vector3<f64>)> {
        let begin = Vector3::new(right - self.centre.x, up - self.centre.y, 0.0);
        let reach = |row: usize| self.from_sphere.row(row).norm();
        if begin.x.abs() > reach(0) || begin.y.abs() > reach(1) {
            return None;
        }
        let (begin, along) = (self.to_sphere * begin, self.to_sphere.column(2));
        let (middle, square) = (begin.dot(&along), along.norm_squared());
        let root = middle * middle - square * (begin.norm_squared() - 1.0);
        if root < 0.0 {
            return None;
        }
        let depth = (root.sqrt() - middle) / square;
        Some((depth + self.centre.z, begin + along * depth))
    }
}

/// What a picture shows.
pub(crate) struct Scene {
    solids: Vec<Ellipsoid>,
    light: Vector3<f64>,
}

impl Scene {
    /// A body in a posture and a motion; `toward` is the horizontal direction of the goal (north, west; length 1), if there is
    /// one.
    pub(crate) fn new(
        body: &Body<f64>,
        posture: &Posture<f64>,
        motion: &Motion<f64>,
        toward: Option<[f64; 2]>,
    ) -> Self {
        let (turn, down) = LOOKS;
        let looks = Vector3::new(
            down.cos() * turn.cos(),
            down.cos() * turn.sin(),
            -down.sin(),
        );
        let right = looks.cross(&Vector3::z()).normalize();
        let camera = Matrix3::from_columns(&[right, right.cross(&looks), -looks]).transpose();
        let camera_from_body = camera
            * motion
                .inertial_from_body
                .quaternion()
                .to_rotation_matrix()
                .into_inner();
        let posed = pose(body, posture);
        let mut solids: Vec<Ellipsoid> = Segment::ALL
            .into_iter()
            .filter_map(|segment| {
                let posed = &posed[segment];
                Ellipsoid::new(
                    &(camera_from_body * posed.body_from_segment),
                    half_extents(&body.segments[segment].area),
                    camera_from_body * posed.cg,
                    [BACK, FRONT],
                )
            })
            .collect();
        if let Some([north, west]) = toward {
            let along = Vector3::new(north, west, 0.0);
            let axes = Matrix3::from_columns(&[along, Vector3::z().cross(&along), Vector3::z()]);
            let [long, thin] = MARK_EXTENTS;
            solids.extend(Ellipsoid::new(
                &(camera * axes),
                Vector3::new(long, thin, thin),
                camera * along * MARK_DISTANCE,
                [MARK, MARK],
            ));
        }
        Self {
            solids,
            light: camera * Vector3::from(LIGHT),
        }
    }

    /// Draws the picture: rows from the top, red, green and blue.
    pub(crate) fn draw(&self, width: usize, height: usize) -> Vec<u8> {
        #[expect(clippy::cast_precision_loss, reason = "sizes of pictures")]
        let [columns, rows] = [width as f64, height as f64];
        let metres = SHOWN / rows;
        let mut pixels = Vec::with_capacity(3 * width * height);
        let mut y = 0.5;
        for _ in 0..height {
            let up = (0.5 * rows - y) * metres;
            let mut x = 0.5;
            for _ in 0..width {
                let color = self
                    .color((x - 0.5 * columns) * metres, up)
                    .unwrap_or_else(|| mixed(SKY, 1.0 - y / rows));
                pixels.extend(color.map(byte));
                x += 1.0;
            }
            y += 1.0;
        }
        pixels
    }

    fn color(&self, right: f64, up: f64) -> Option<[f64; 3]> {
        let seen = self
            .solids
            .iter()
            .filter_map(|solid| solid.met(right, up).map(|(near, at)| (near, at, solid)));
        let (_, at, solid) = seen.max_by(|(a, ..), (b, ..)| a.total_cmp(b))?;
        let normal = (solid.to_sphere.transpose() * at).normalize();
        let light = AMBIENT + (1.0 - AMBIENT) * normal.dot(&self.light).max(0.0);
        let [back, front] = solid.colors;
        let color = if at.y > 0.0 { back } else { front };
        Some(color.map(|part| part * light))
    }
}

fn mixed([from, to]: [[f64; 3]; 2], share: f64) -> [f64; 3] {
    core::array::from_fn(|k| from[k] + (to[k] - from[k]) * share)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "a colour between 0 and 255"
)]
fn byte(part: f64) -> u8 {
    (part.clamp(0.0, 1.0) * 255.0).round() as u8
}
