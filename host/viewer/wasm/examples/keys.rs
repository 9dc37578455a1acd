//! Flies a script of keys natively and prints the frames' bits, to be compared with those of the page.
//!
//! Standard input: the bits of the model's numbers on one line, then one order a line, as the page's functions.
#![expect(clippy::expect_used, clippy::panic, reason = "used by tests only")]

use std::io::Read;

use bodyflight_viewer::cockpit::Cockpit;
use bodyflight_viewer::setup::Setup;

fn main() {
    let mut text = String::new();
    std::io::stdin()
        .read_to_string(&mut text)
        .expect("there is input");
    let mut lines = text.lines();
    let numbers: Vec<f32> = lines
        .next()
        .expect("the model")
        .split(' ')
        .map(|bits| f32::from_bits(u32::from_str_radix(bits, 16).expect("bits")))
        .collect();
    let setup = Setup::from_numbers(&numbers.try_into().expect("all numbers of a model"));
    let mut cockpit = Cockpit::new(&setup, 0);
    for line in lines {
        let words: Vec<&str> = line.split(' ').collect();
        let number = |k: usize| words[k].parse::<f32>().expect("a number");
        let index = |k: usize| words[k].parse::<usize>().expect("an index");
        match words[0] {
            "begin" => cockpit = Cockpit::new(&setup, index(1)),
            "command" => cockpit.command(index(1), number(2)),
            "hold" => cockpit.hold(index(1) != 0),
            "joint" => cockpit.joint(index(1), index(2), number(3)),
            "muscle" => cockpit.muscle([number(1), number(2), number(3)].into()),
            "tension" => cockpit.tension(number(1)),
            "damping" => cockpit.damping([number(1), number(2), number(3)].into()),
            "step" => (0..index(1)).for_each(|_| cockpit.step()),
            "see" => {
                let bits = cockpit.frame().map(|n| format!("{:08x}", n.to_bits()));
                println!("{}", bits.join(" "));
            }
            other => panic!("no order {other}"),
        }
    }
}
