#![no_main]

use bodyflight_tests::fuzz_targets::run;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| run("slimevr", bytes));
