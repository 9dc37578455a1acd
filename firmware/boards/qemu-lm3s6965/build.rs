//! Linker arguments of the board; the root's `memory.x` is this board's.

fn main() {
    println!("cargo::rerun-if-changed=../../../memory.x");
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("none") {
        println!("cargo::rustc-link-arg-bins=-Tlink.x");
        println!("cargo::rustc-link-arg-bins=--nmagic");
        println!("cargo::rustc-link-arg-bin=unit=-Tdefmt.x");
    }
}
