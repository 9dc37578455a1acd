//! How costs grow with the length of a flight, the rows of a track, the number of flights, effects and workers.

use bodyflight_tests::long_recording::repeated;
use bodyflight_tests::text_inputs::track;

use crate::cost::Program;

/// Lengths of flights (s) and rows of tracks: three decades each.
const LENGTHS: [u32; 4] = [1, 10, 100, 1000];
const ROWS: [u32; 4] = [1000, 10_000, 100_000, 1_000_000];

/// Numbers of flights (bodies) of two seconds, and effects that act in one flight of ten seconds.
const FLIGHTS: [u32; 4] = [1, 10, 100, 1000];
const EFFECTS: [&str; 3] = [
    "wind",
    "wind,rig,drag,lift,moment,arch,muscle,damping,mass,booties",
    "wind,wind-shear,updraft,density-gradient,rig,weight-belt,cg-offset,mass,booties,drag,upper-arm-drag,forearm-drag,\
     thigh-drag,shank-drag,foot-drag,rig-size,trunk-shape,arm-shape,leg-shape,lift,moment,arch,added-mass,reynolds,shelter,\
     local-flow,force-lag,muscle,damping,exit-speed",
];

/// Numbers of workers.
const WORKERS: [u32; 3] = [1, 2, 8];

pub(crate) fn print(program: &Program) {
    println!("| processor time (s) of | grows with | | | | |\n|---|---|---|---|---|---|");
    let row = |what: &str, by: &str, sizes: &[String], seconds: &[f64]| {
        let cells = sizes.iter().zip(seconds);
        let cells: Vec<String> = cells
            .map(|(size, seconds)| format!("{size}: {seconds:.2}"))
            .collect();
        println!("| `{what}` | {by} | {} |", cells.join(" | "));
    };
    let texts = |sizes: &[u32]| -> Vec<String> { sizes.iter().map(u32::to_string).collect() };

    crate::table::flights(program);
    let mut long = vec![Vec::new(); 4];
    for seconds in LENGTHS {
        repeated(&program.folder, "long", "flight-0", seconds, 240);
        for (verb, times) in [
            "inspect long/flight.mvnx",
            "simulate long/flight.toml",
            "estimate long/flight.toml",
            "view long/flight.toml --out g.html --force",
        ]
        .iter()
        .zip(&mut long)
        {
            times.push(program.seconds(verb, 1));
        }
    }
    for (name, times) in ["inspect", "simulate", "estimate", "view"]
        .iter()
        .zip(&long)
    {
        row(name, "length of the flight (s)", &texts(&LENGTHS), times);
    }

    let falls = ROWS.map(|rows| {
        std::fs::write(program.folder.join("track.csv"), track(rows)).expect("written");
        program.seconds("fall track.csv", 1)
    });
    row("fall", "rows of the track", &texts(&ROWS), &falls);

    let flights = FLIGHTS.map(|flights| {
        program.seconds(
            &format!("hide clean --flights {flights} --duration 2 --out many --force"),
            1,
        )
    });
    row("hide --duration 2", "flights", &texts(&FLIGHTS), &flights);

    let effects = EFFECTS.map(|effects| {
        program.seconds(
            &format!("hide {effects} --flights 1 --duration 10 --out acting --force"),
            1,
        )
    });
    let counts = EFFECTS.map(|effects| effects.split(',').count().to_string());
    row("hide --duration 10", "effects", &counts, &effects);

    program.seconds("hide wind --duration 10 --out pair --force", 1);
    let discover = "discover pair/flight-0/flight.toml --hold-out pair/flight-1/flight.toml";
    let workers = WORKERS.map(|workers| program.seconds(discover, workers));
    row("discover", "workers", &texts(&WORKERS), &workers);
}
