//! `cargo doc` without warnings, and every citation among the references.
//!
//! A citation such as `[P0] (29)` reads as a link to rustdoc. The workspace therefore switches the
//! lint on broken links off; here it is on, and passes only the keys of `docs/references.md`.

use std::fs;

use crate::checks::not_run;
use crate::process::command;
use crate::workspace::{TARGET, Workspace};
use crate::{Failure, Result};

const REFERENCES: &str = "docs/references.md";

/// Builds the documentation of the whole workspace: the firmware's for its own target, where all
/// of it exists, and its library only, for its images may bear the names of programs of the PC.
pub fn check(workspace: &Workspace) -> Result {
    let references = fs::read_to_string(workspace.root.join(REFERENCES)).unwrap_or_default();
    let keys = keys(&references);
    build(
        workspace,
        &keys,
        &["--workspace", "--exclude", "surefix-firmware"],
    )?;
    build(
        workspace,
        &keys,
        &["--package", "surefix-firmware", "--lib", "--target", TARGET],
    )
}

fn build(workspace: &Workspace, keys: &[&str], packages: &[&str]) -> Result {
    let mut call = command(workspace, "cargo");
    call.args(["doc", "--locked", "--no-deps", "--message-format", "short"])
        .args(packages)
        .env(
            "RUSTDOCFLAGS",
            "-D warnings --force-warn rustdoc::broken_intra_doc_links",
        );
    let output = call
        .output()
        .map_err(|error| not_run(&call, &error.to_string()))?;
    let printed = String::from_utf8_lossy(&output.stderr);
    let remarks = remarks(&printed, keys);
    for line in &remarks {
        println!("{line}");
    }
    if !output.status.success() {
        return Err(not_run(&call, &output.status.to_string()));
    }
    if remarks.is_empty() {
        return Ok(());
    }
    Err(Failure::new(
        "the documentation has broken links or citations without a source",
        format!("correct the link, or add the key to {REFERENCES}"),
    ))
}

/// The keys of the table of references: `| [KEY] | source |`.
fn keys(references: &str) -> Vec<&str> {
    references
        .lines()
        .filter_map(|line| line.strip_prefix("| [")?.split(']').next())
        .collect()
}

/// What rustdoc has to say, citations of known sources apart.
fn remarks<'a>(printed: &'a str, keys: &[&str]) -> Vec<&'a str> {
    printed
        .lines()
        // Those with a place are rustdoc's, `warning: … generated 2 warnings` is cargo's.
        .filter(|line| {
            line.contains(": warning: ") || line.contains(": error: ") || line.starts_with("error")
        })
        .filter(|line| {
            let target = line
                .split_once("unresolved link to `")
                .and_then(|(_, rest)| rest.split('`').next());
            !target.is_some_and(|target| keys.contains(&target))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRINTED: &str = " Documenting surefix-core v0.1.0
core/src/config.rs:36:42: warning: unresolved link to `P3`: no item named `P3` in scope
core/src/config.rs:40:2: warning: unresolved link to `Monitr`: no item named `Monitr` in scope
warning: `surefix-core` (lib doc) generated 2 warnings
";

    #[test]
    fn a_citation_passes_and_a_broken_link_does_not() {
        let keys = keys("| key | source |\n|---|---|\n| [P0] | one |\n| [P3] | two |\n");
        assert_eq!(keys, ["P0", "P3"]);
        let remarks = remarks(PRINTED, &keys);
        assert_eq!(remarks.len(), 1);
        assert!(remarks[0].contains("Monitr"));
    }

    #[test]
    fn a_citation_without_a_source_does_not_pass() {
        assert_eq!(remarks(PRINTED, &keys("| [P0] | one |\n")).len(), 2);
    }
}
