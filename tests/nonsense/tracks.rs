//! Kinds of nonsense in tracks, as changes of a good one in FlySight's format.

use std::fmt::Write;

/// Rows a second.
const RATE: f64 = 5.0;

/// Heights of the exit, the opening and the ground (m).
const EXIT: f64 = 4000.0;
const OPENING: f64 = 1200.0;
const GROUND: f64 = 300.0;

/// A row.
#[derive(Clone, Copy)]
pub(super) struct Row {
    /// Time (s).
    time: f64,
    /// Degrees.
    latitude: f64,
    longitude: f64,
    /// Height (m).
    height: f64,
    /// Velocity (m/s), north, east, down.
    velocity: [f64; 3],
    /// Accuracy of place and height (m), and of the velocity (m/s), as the receiver states it.
    accuracy: [f64; 3],
}

/// A kind of nonsense: its name and what becomes of the rows.
pub(super) struct Kind {
    pub(super) name: &'static str,
    change: fn(Vec<Row>) -> Vec<Row>,
}

const fn kind(name: &'static str, change: fn(Vec<Row>) -> Vec<Row>) -> Kind {
    Kind { name, change }
}

fn each(mut rows: Vec<Row>, change: impl Fn(usize, &mut Row)) -> Vec<Row> {
    rows.iter_mut()
        .enumerate()
        .for_each(|(index, row)| change(index, row));
    rows
}

fn scaled(rows: Vec<Row>, factor: f64) -> Vec<Row> {
    each(rows, |_, row| {
        row.velocity = row.velocity.map(|part| factor * part)
    })
}

/// The rows in which a condition of the height holds.
fn during(rows: &[Row], heights: core::ops::Range<f64>) -> core::ops::Range<usize> {
    let first = rows.iter().position(|row| heights.contains(&row.height));
    let last = rows.iter().rposition(|row| heights.contains(&row.height));
    first.unwrap_or(0)..last.map_or(0, |last| last + 1)
}

pub(super) const KINDS: [Kind; 34] = [
    kind("nothing", |rows| rows),
    kind("heights in feet", |rows| {
        each(rows, |_, row| row.height /= 0.3048)
    }),
    kind("velocities in knots", |rows| scaled(rows, 1.0 / 0.514_444)),
    kind("velocities in km/h", |rows| scaled(rows, 3.6)),
    kind("velocities in mph", |rows| scaled(rows, 1.0 / 0.447_04)),
    kind("velocities halved", |rows| scaled(rows, 0.5)),
    kind("velocities 15 % high", |rows| scaled(rows, 1.15)),
    kind("velocities empty", |rows| scaled(rows, 0.0)),
    kind("vertical velocities upwards", |rows| {
        each(rows, |_, row| row.velocity[2] = -row.velocity[2])
    }),
    kind("vertical velocities empty", |rows| {
        each(rows, |_, row| row.velocity[2] = 0.0)
    }),
    kind("north and east velocity exchanged", |rows| {
        each(rows, |_, row| row.velocity.swap(0, 1))
    }),
    kind("heights empty", |rows| {
        each(rows, |_, row| row.height = 0.0)
    }),
    kind("velocities 7 s late", |rows| {
        let sound = rows.clone();
        each(rows, |index, row| {
            row.velocity = sound[index.saturating_sub(35)].velocity;
        })
    }),
    kind("positions jump by 400 m", |rows| {
        let fall = during(&rows, 2000.0..2500.0);
        each(rows, |index, row| {
            row.latitude += if index > fall.start { 0.0036 } else { 0.0 }
        })
    }),
    kind("ten seconds of the fall twice", |rows| {
        let start = during(&rows, 2000.0..2500.0).start;
        let sound = rows.clone();
        each(rows, |index, row| {
            if (start..start + 50).contains(&index) {
                let time = row.time;
                *row = Row {
                    time,
                    ..sound[index - 50]
                };
            }
        })
    }),
    kind("heights jump by 300 m", |rows| {
        let fall = during(&rows, 2000.0..2500.0);
        each(rows, |index, row| {
            row.height += if index > fall.start { 300.0 } else { 0.0 }
        })
    }),
    kind("two jumpers by turns", |rows| {
        each(rows, |index, row| {
            if index % 2 == 1 {
                row.height -= 300.0;
                row.latitude += 0.007;
            }
        })
    }),
    kind("frozen for 10 s of the fall", |rows| {
        let start = during(&rows, 2500.0..3000.0).start;
        let kept = rows[start];
        each(rows, |index, row| {
            if (start..start + 50).contains(&index) {
                *row = Row {
                    time: row.time,
                    ..kept
                };
            }
        })
    }),
    kind("clock 5 % fast", |rows| {
        each(rows, |_, row| row.time *= 1.05)
    }),
    kind("clock twice as fast", |rows| {
        each(rows, |_, row| row.time *= 2.0)
    }),
    kind("time backwards", |rows| {
        let times: Vec<f64> = rows.iter().map(|row| row.time).collect();
        let mut rows = rows;
        rows.reverse();
        each(rows, |index, row| row.time = times[index])
    }),
    kind("every row twice", |rows| {
        rows.into_iter().flat_map(|row| [row, row]).collect()
    }),
    kind("heights counted from the exit", |rows| {
        each(rows, |_, row| row.height -= EXIT)
    }),
    kind("heights frozen from the opening on", |rows| {
        let kept = rows[during(&rows, OPENING - 300.0..OPENING).end].height;
        each(rows, |_, row| row.height = row.height.max(kept))
    }),
    kind("10 000 km above the ground", |rows| {
        each(rows, |_, row| row.height += 1e7)
    }),
    kind("places accurate to 1000 m by the receiver's word", |rows| {
        each(rows, |_, row| row.accuracy[0] = 1000.0)
    }),
    kind(
        "velocities accurate to 20 m/s by the receiver's word",
        |rows| each(rows, |_, row| row.accuracy[2] = 20.0),
    ),
    kind("places accurate to 1000 m for the first seconds", |rows| {
        each(rows, |index, row| {
            row.accuracy[0] = if index < 240 { 1000.0 } else { 1.0 }
        })
    }),
    kind("standing", |rows| {
        let [first, ..] = rows[..] else { return rows };
        each(rows, |index, row| {
            let sway = 0.05 * f64::from(u32::try_from(index % 7).unwrap_or(0));
            *row = Row {
                time: row.time,
                height: GROUND + sway,
                velocity: [sway, 0.0, -sway],
                ..first
            };
        })
    }),
    kind("walking", |rows| {
        let [first, ..] = rows[..] else { return rows };
        each(rows, |_, row| {
            let latitude = first.latitude + 1.4 * row.time / 111_000.0;
            *row = Row {
                time: row.time,
                latitude,
                height: GROUND,
                velocity: [1.4, 0.0, 0.0],
                ..first
            };
        })
    }),
    kind("in an aircraft that descends", |rows| {
        let [first, ..] = rows[..] else { return rows };
        each(rows, |_, row| {
            let latitude = first.latitude + 60.0 * row.time / 111_000.0;
            let height = EXIT - 8.0 * row.time;
            *row = Row {
                time: row.time,
                latitude,
                height,
                velocity: [60.0, 0.0, 8.0],
                ..first
            };
        })
    }),
    kind("an aircraft that flies loops", |rows| {
        let [first, ..] = rows[..] else { return rows };
        each(rows, |_, row| {
            let turned = 0.22 * row.time;
            *row = Row {
                time: row.time,
                latitude: first.latitude + 50.0 * row.time / 111_000.0,
                height: 1500.0 + 200.0 * turned.sin(),
                velocity: [50.0, 0.0, -44.0 * turned.cos()],
                ..first
            };
        })
    }),
    kind("a wind tunnel", |rows| {
        let [first, ..] = rows[..] else { return rows };
        each(rows, |_, row| {
            let height = 20.0 + 3.0 * (0.5 * row.time).sin();
            let down = -1.5 * (0.5 * row.time).cos();
            *row = Row {
                time: row.time,
                height,
                velocity: [0.0, 0.0, down],
                ..first
            };
        })
    }),
    kind("only the flight under canopy", |rows| {
        rows.into_iter()
            .filter(|row| row.height < OPENING - 200.0)
            .collect()
    }),
];

/// A jump: flight in the aircraft, fall, canopy, ground.
pub(super) fn jump() -> Vec<Row> {
    let (mut height, mut north, mut velocity) = (EXIT, 0.0, [40.0, 0.0, 0.0]);
    let mut noise = 1_u32;
    let mut rows = Vec::new();
    for index in 0..1500_u32 {
        let time = f64::from(index) / RATE;
        // In small steps, since the drag of the opening is large.
        for _ in 0..20 {
            let step = 1.0 / RATE / 20.0;
            let speed = velocity
                .iter()
                .map(|part: &f64| part * part)
                .sum::<f64>()
                .sqrt();
            let density = 1.225 * (1.0 - 2.255_77e-5 * height).powf(4.2559);
            let drag = if height > OPENING { 1.0 / 150.0 } else { 0.45 };
            let pull = 0.5 * density * speed * drag;
            if time < 40.0 {
                velocity = [40.0, 0.0, 0.0];
            } else if height > GROUND {
                velocity = velocity.map(|part| part * (1.0 - pull * step));
                velocity[2] += 9.807 * step;
                if height < OPENING {
                    velocity[0] += (8.0 - velocity[0]) * step;
                }
            } else {
                velocity = [0.0; 3];
            }
            height -= velocity[2] * step;
            north += velocity[0] * step;
        }
        let mut shake = || {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(noise >> 16) / 65_536.0 - 0.5
        };
        rows.push(Row {
            time,
            latitude: 50.0 + north / 111_200.0,
            longitude: 10.0,
            height: height + shake(),
            velocity: velocity.map(|part| part + 0.3 * shake()),
            accuracy: [1.0, 1.5, 0.3],
        });
    }
    rows
}

/// The text of a track of this kind.
pub(super) fn text(kind: &Kind) -> String {
    let mut text = "time,lat,lon,hMSL,velN,velE,velD,hAcc,vAcc,sAcc,heading,cAcc,gpsFix,numSV\n\
                    ,(deg),(deg),(m),(m/s),(m/s),(m/s),(m),(m),(m/s),(deg),(deg),,\n"
        .to_owned();
    for row in (kind.change)(jump()) {
        let (minutes, seconds) = ((row.time / 60.0).floor(), row.time % 60.0);
        let [north, east, down] = row.velocity;
        let [across, above, speed] = row.accuracy;
        let _ = writeln!(
            text,
            "2024-06-01T10:{minutes:02.0}:{seconds:05.2}Z,{:.7},{:.7},{:.3},{north:.2},{east:.2},{down:.2},{across},{above},{speed},0,1,3,12",
            row.latitude, row.longitude, row.height
        );
    }
    text
}
