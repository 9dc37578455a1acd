//! Linker arguments of the board.

fn main() {
    println!("cargo::rerun-if-changed=memory.x");
    println!("cargo::rustc-link-arg-bins=-Tlink.x");
    println!("cargo::rustc-link-arg-bins=--nmagic");
    for image in ["unit", "overflow", "logging"] {
        println!("cargo::rustc-link-arg-bin={image}=-Tdefmt.x");
    }
}
