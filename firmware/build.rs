//! Gives the linker the memory map and the interrupt names of the board that was chosen, and each
//! image its own link arguments.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-env-changed=DEFMT_LOG");
    if env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("none") {
        return;
    }
    let chosen = |feature: &str| env::var_os(format!("CARGO_FEATURE_{feature}")).is_some();
    let board = match (chosen("BOARD_MPS2"), chosen("BOARD_H743")) {
        (true, false) => "mps2",
        (false, true) => "h743",
        _ => panic!(
            "choose one board: --features board-mps2 (the default), or --no-default-features --features board-h743"
        ),
    };

    let manifest = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    let folder = manifest.join("src/board").join(board);
    for script in ["board-memory.x", "device.x"] {
        let source = folder.join(script);
        println!("cargo:rerun-if-changed={}", source.display());
        fs::copy(&source, out.join(script)).expect("the board's linker scripts are in its folder");
    }
    println!("cargo:rustc-link-search={}", out.display());
    // Where memory.x lies, for builds started outside the workspace root.
    println!(
        "cargo:rustc-link-search={}",
        manifest.parent().expect("the workspace").display()
    );

    for argument in ["-Tlink.x", "-Tdefmt.x", "--nmagic"] {
        println!("cargo:rustc-link-arg-bins={argument}");
    }

    // What is logged unless the builder says otherwise.
    if env::var_os("DEFMT_LOG").is_none() {
        println!("cargo:rustc-env=DEFMT_LOG=info");
    }
}
