//! Rules of the workspace that no compiler checks.

use std::fs;

use crate::process::{command, output};
use crate::workspace::Workspace;
use crate::{Failure, Result};

/// Crates of the maths whose `std` would give the PC other code than the board has.
const SAME_BITS: [&str; 2] = ["nalgebra", "simba"];

/// No package of the workspace, on any target, turns on `std` for the maths: cargo would merge it
/// into core (docs/decisions/001-same-bits.md).
pub fn same_bits(workspace: &Workspace) -> Result {
    for package in SAME_BITS {
        let tree = output(command(workspace, "cargo").args([
            "tree", "--locked", "--workspace", "--target", "all", "--edges", "features,normal,build,dev",
            "--invert", package,
        ]))
        .ok_or_else(|| {
            Failure::new(
                format!("`cargo tree --invert {package}` does not run"),
                "run `cargo tree --workspace --target all --invert nalgebra` by hand and mend Cargo.toml or Cargo.lock",
            )
        })?;
        if let Some(culprits) = std_enabled(&tree, package) {
            return Err(Failure::new(
                format!("{package}'s `std` is on in this workspace, by\n{culprits}"),
                "give that dependency `default-features = false`",
            ));
        }
        println!("{package}: std is off in the whole workspace");
    }
    Ok(())
}

/// What turns on a package's `std`: the part of an inverted feature tree below that feature.
fn std_enabled(tree: &str, package: &str) -> Option<String> {
    let feature = format!("{package} feature \"std\"");
    let at = tree.find(&feature)?;
    let lines: Vec<&str> = tree.get(at..)?.lines().take(4).collect();
    Some(lines.join("\n"))
}

/// core forbids unsafe code and std, for every build of it.
pub fn core_is_closed(workspace: &Workspace) -> Result {
    let path = workspace.root.join("core/src/lib.rs");
    let text = fs::read_to_string(&path).unwrap_or_default();
    match missing_attribute(&text) {
        None => Ok(()),
        Some(attribute) => Err(Failure::new(
            format!("core/src/lib.rs has no line `{attribute}`"),
            "put it back, without conditions",
        )),
    }
}

/// The attribute that is not there on a line of its own.
fn missing_attribute(source: &str) -> Option<&'static str> {
    ["#![no_std]", "#![forbid(unsafe_code)]"]
        .into_iter()
        .find(|attribute| !source.lines().any(|line| line.trim_end() == *attribute))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn std_is_found_in_a_feature_tree() {
        let off =
            "nalgebra v0.35.0\n├── nalgebra feature \"libm-force\"\n│   └── surefix-core v0.1.0\n";
        assert_eq!(std_enabled(off, "nalgebra"), None);
        let on = "nalgebra v0.35.0\n├── nalgebra feature \"std\"\n│   └── nalgebra feature \"default\"\n";
        assert!(std_enabled(on, "nalgebra").unwrap().contains("default"));
        assert_eq!(std_enabled(on, "simba"), None);
    }

    #[test]
    fn a_conditional_attribute_does_not_count() {
        let good = "//! doc\n#![no_std]\n#![forbid(unsafe_code)]\n";
        assert_eq!(missing_attribute(good), None);
        let bad = "#![cfg_attr(not(test), no_std)]\n#![forbid(unsafe_code)]\n";
        assert_eq!(missing_attribute(bad), Some("#![no_std]"));
        let commented = "#![no_std]\n// #![forbid(unsafe_code)]\n";
        assert_eq!(
            missing_attribute(commented),
            Some("#![forbid(unsafe_code)]")
        );
    }
}
