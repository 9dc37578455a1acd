//! Motion of other systems.

use std::path::Path;
use std::sync::OnceLock;

use bodyflight_mocap::mapping::Mapping;
use bodyflight_mocap::source::Source;

use super::choices::Choices;
use super::files::NOWHERE;

/// Most frames of an input that are turned into postures, which is slower than reading.
const MOST_FRAMES: usize = 64;

/// A mapping of each kind; the names are those of the corpus.
const MAPPINGS: [&str; 3] = [
    crate::text_inputs::MAPPING,
    include_str!("mappings/quaternions.toml"),
    include_str!("mappings/angles.toml"),
];

fn mapping(choice: u8) -> Option<&'static Mapping> {
    static READ: OnceLock<[Mapping; 3]> = OnceLock::new();
    let read = READ.get_or_init(|| {
        MAPPINGS.map(|text| {
            let path = Path::new(NOWHERE).join("mapping.toml");
            Mapping::parse(text, &path).expect("a mapping")
        })
    });
    read.get(usize::from(choice))
}

/// The first byte of an input chooses a mapping, or none; the rest is the file. What is accepted has a rate, and frames
/// of rotations.
pub(super) fn capture(input: &[u8]) {
    let mut choices = Choices(input);
    let mapping = mapping(choices.byte());
    let bytes = choices.bytes(usize::MAX).to_vec();
    let Ok(mut source) = Source::parse(bytes, &Path::new(NOWHERE).join("motion"), mapping) else {
        return;
    };
    let rate = source.timing.rate;
    assert!(rate.is_finite() && rate > 0.0, "{rate} Hz");
    assert!(source.timing.indices.is_sorted_by(|a, b| a < b));
    for place in 0..source.frames().min(MOST_FRAMES) {
        // Refusing a frame is correct too.
        let Ok(frame) = source.frame(place) else {
            continue;
        };
        assert!(
            frame
                .position
                .is_none_or(|at| at.iter().all(|x| x.is_finite()))
        );
        let (attitude, posture) = source.skeleton.posture(&frame.world_from_segment);
        assert!((attitude.quaternion().norm() - 1.0).abs() < 1e-6);
        for segment in bodyflight_core::Segment::ALL {
            let turned = posture.parent_from_segment(segment).quaternion().norm();
            assert!((turned - 1.0).abs() < 1e-6, "{}: {turned}", segment.name());
        }
    }
}
