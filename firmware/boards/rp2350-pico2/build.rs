//! Linker arguments of the board.

fn main() {
    println!("cargo::rerun-if-changed=memory.x");
    for argument in ["-Tlink.x", "--nmagic", "-Tdefmt.x"] {
        println!("cargo::rustc-link-arg-bins={argument}");
    }
}
