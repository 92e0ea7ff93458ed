//! Makes a machine ready that has only rustup, git, a C linker and a package manager.
//!
//! | need | found | else |
//! |---|---|---|
//! | Cortex-M7 target | the active compiler links a probe with fat LTO | `rustup target add`, else the distribution's compiler ([`distribution`]) |
//! | rustfmt, clippy | they run | `rustup component add`, else `xtask test` leaves them out and says so |
//! | QEMU with `mps2-an500` | it lists the board | apt, dnf, pacman or brew |
//! | Chromium, for the report's tests | it runs | apt, dnf or pacman, else the tests say that they are left out |
//!
//! Every step is safe to repeat and says what it did. Why three routes: docs/decisions/003-toolchain.md.

mod distribution;
mod packages;
mod target;
mod version;

use std::env;
use std::time::{Duration, Instant};

use crate::process::{command, output, run_quietly, runs};
use crate::workspace::Workspace;
use crate::{Failure, Result};

/// A download by rustup that takes longer is taken for one that does not come.
const RUSTUP_LIMIT: Duration = Duration::from_secs(300);

/// The board model every emulated test runs on.
pub const BOARD: &str = "mps2-an500";

/// What the report's tests look for.
const BROWSERS: [&str; 4] = [
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
];

/// Everything of the table above, in its order.
pub fn run_with_browser(workspace: &Workspace) -> Result {
    run(workspace)?;
    ensure_browser(workspace);
    Ok(())
}

/// The same without the browser, which is large and which only tests need.
pub fn run(workspace: &Workspace) -> Result {
    let started = Instant::now();
    target::ensure(workspace)?;
    for component in ["rustfmt", "clippy"] {
        ensure_component(workspace, component);
    }
    ensure_qemu(workspace)?;
    if c_compiler(workspace).is_none() {
        say("no C compiler: `cargo xtask bench` leaves out the count of f64 operations");
    }
    say(&format!("ready ({:.1} s)", started.elapsed().as_secs_f64()));
    Ok(())
}

/// One line of progress.
fn say(line: &str) {
    println!("setup: {line}");
}

/// True when rustup is there and downloads are not switched off.
fn rustup_may_download(workspace: &Workspace) -> bool {
    env::var_os("SUREFIX_SETUP_NO_RUSTUP").is_none() && runs(workspace, "rustup", "--version")
}

/// True when `cargo fmt` or `cargo clippy` runs in the workspace.
pub fn has_component(workspace: &Workspace, component: &str) -> bool {
    let subcommand = if component == "rustfmt" {
        "fmt"
    } else {
        component
    };
    output(command(workspace, "cargo").args([subcommand, "--version"])).is_some()
}

/// The compiler for the counting plugin of `cargo xtask bench`, if there is one.
pub fn c_compiler(workspace: &Workspace) -> Option<&'static str> {
    ["cc", "gcc", "clang"]
        .into_iter()
        .find(|name| runs(workspace, name, "--version"))
}

fn ensure_component(workspace: &Workspace, component: &str) {
    if has_component(workspace, component) {
        return;
    }
    if rustup_may_download(workspace) {
        let mut rustup = command(workspace, "rustup");
        rustup.args(["component", "add", component]);
        match run_quietly(workspace, &mut rustup, RUSTUP_LIMIT) {
            Ok(_) => say(&format!("{component}: added with rustup")),
            Err(trouble) => say(&format!("rustup component add {component} {trouble}")),
        }
    }
    if !has_component(workspace, component) {
        say(&format!(
            "WARNING: no {component} for this toolchain: its check is left out of `cargo xtask test`"
        ));
    }
}

fn has_browser(workspace: &Workspace) -> bool {
    BROWSERS
        .iter()
        .any(|name| runs(workspace, name, "--version"))
}

/// Never a failure: without a browser everything else can still be tested.
fn ensure_browser(workspace: &Workspace) {
    if has_browser(workspace) {
        return;
    }
    let package = packages::Manager::find(workspace)
        .and_then(|manager| Some((manager, manager.browser_package()?)));
    if let Some((manager, package)) = package {
        say(&format!(
            "no Chromium: installing {package} with {} (100 MB and more)",
            manager.name()
        ));
        if let Err(failure) = manager.install(workspace, &[package]) {
            say(&failure.to_string());
        }
    }
    if !has_browser(workspace) {
        say("WARNING: no Chromium: `cargo xtask test` does not open the report in a browser");
    }
}

fn has_board(workspace: &Workspace) -> bool {
    output(command(workspace, "qemu-system-arm").args(["-M", "help"]))
        .is_some_and(|boards| boards.contains(BOARD))
}

fn ensure_qemu(workspace: &Workspace) -> Result {
    if !has_board(workspace) {
        let manager = packages::Manager::find(workspace).ok_or_else(|| {
            Failure::new(
                "qemu-system-arm is missing and none of apt-get, dnf, pacman and brew is here to install it",
                "install QEMU's system emulator for Arm (6.2 or newer) and run `cargo xtask setup` again",
            )
        })?;
        say(&format!(
            "qemu-system-arm: installing {} with {}",
            manager.qemu_package(),
            manager.name()
        ));
        manager.install(workspace, &[manager.qemu_package()])?;
    }
    if !has_board(workspace) {
        return Err(Failure::new(
            format!("qemu-system-arm does not know the board {BOARD}"),
            "put QEMU 6.2 or newer first in PATH and run `cargo xtask setup` again",
        ));
    }
    let version = output(command(workspace, "qemu-system-arm").arg("--version"));
    say(version
        .as_deref()
        .and_then(|text| text.lines().next())
        .unwrap_or("qemu-system-arm: there"));
    Ok(())
}
