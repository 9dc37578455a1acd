//! The greeting and configuration that a host sends, for tests of the unit.

use bodyflight_core::link::{
    ArchSource, Configure, Hello, PackedQuaternion, SCHEMA_HASH, SegmentTable, SensorKind,
};

/// The greeting of a host that accepts only short frames.
pub fn hello() -> Hello {
    Hello {
        schema_hash: SCHEMA_HASH,
        max_frame_length: 200,
    }
}

/// A configuration with 240 samples and 60 updates a second, a person of 1.75 m in still air, and the preset of this
/// number.
pub fn configure(preset: u16, table: &SegmentTable) -> Configure {
    Configure {
        preset,
        sample_rate: 240.0,
        update_rate: 60.0,
        height: 1.75,
        air_density: 1.0,
        air_velocity: [0.0; 3],
        arch_source: ArchSource::Posture,
        arch: 1.0,
        body_from_sensor: PackedQuaternion::default(),
        receiver_latency: 0.1,
        sensor: SensorKind::Xbus,
        table_digest: table.digest(),
    }
}
