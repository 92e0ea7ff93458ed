//! Set-up and checks of the surefix workspace: `cargo xtask setup|test|demo|images|real-time|bench|coverage`.
//!
//! | module | what it does |
//! |---|---|
//! | [`setup`] | brings a machine to the point where the rest runs: target, components, QEMU |
//! | [`checks`], [`stages`] | every check and test, timed, with one summary |
//! | [`demo`] | an approach with a fault through the emulated board; a flight in real time |
//! | [`mod@bench`], [`operations`] | instructions and bytes per stage on the emulated board, and their bars |
//! | [`coverage`] | what the tests of the drivers take of them |
//! | [`rules`], [`documentation`] | rules of the workspace that no compiler checks |
//! | [`images`], [`elf`], [`sizes`] | the firmware images and what is in them |
//! | [`process`] | nested commands: environment, time limits, captured output |
//! | [`workspace`] | where things are |
//!
//! Runs before set-up, with nothing but a host toolchain: standard library only.

mod bench;
mod checks;
mod coverage;
mod demo;
mod documentation;
mod elf;
mod images;
mod operations;
mod process;
mod rules;
mod setup;
mod sizes;
mod stages;
mod workspace;

use std::fmt;
use std::process::ExitCode;

use workspace::Workspace;

/// What went wrong, and the one thing to do next.
#[derive(Debug)]
pub struct Failure {
    what: String,
    next: String,
}

impl Failure {
    /// A failure whose message always names the next step.
    pub fn new(what: impl Into<String>, next: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            next: next.into(),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}\nnext step: {}", self.what, self.next)
    }
}

/// Result of a step that can say what to do next.
pub type Result<T = ()> = std::result::Result<T, Failure>;

const HELP: &str = "\
usage: cargo xtask COMMAND

  setup               make this machine ready: Cortex-M7 target, rustfmt, clippy, QEMU
  test                set-up if needed, then every check and test
  demo                set-up if needed, then a faulted approach through the emulated board
  images              build every firmware image; what it takes of each memory of its board
  real-time [--minutes M] [--slow] ...
                      set-up if needed, then a flight through the emulated board in its own time:
                      deadlines, work, latencies; arguments as of `cargo surefix real-time`
  bench [--json FILE] [--check]
                      executed instructions and bytes per stage on the emulated board;
                      --check fails when a figure is above its bar
  coverage            lines, regions and branches of the drivers that their tests take
                      (nightly toolchain with llvm-tools)

environment of setup (to try each route by hand)
  SUREFIX_SETUP_NO_RUSTUP=1     do not let rustup download anything
  SUREFIX_SETUP_NO_PACKAGES=1   do not install distribution packages
";

/// Wrong arguments: how to do it right.
fn usage() -> ExitCode {
    eprint!("{HELP}");
    ExitCode::from(2)
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let workspace = Workspace::locate();
    let outcome = match words.as_slice() {
        ["setup"] => setup::run_with_browser(&workspace),
        ["test"] => checks::run(&workspace),
        ["demo"] => demo::run(&workspace),
        ["images"] => images::run(&workspace),
        ["real-time", rest @ ..] => demo::real_time(&workspace, rest),
        ["bench", rest @ ..] => match bench::Options::parse(rest) {
            Some(options) => bench::run(&workspace, &options),
            None => return usage(),
        },
        ["coverage"] => coverage::run(&workspace),
        ["help" | "--help" | "-h"] => {
            print!("{HELP}");
            return ExitCode::SUCCESS;
        }
        _ => return usage(),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("xtask: error: {failure}");
            ExitCode::FAILURE
        }
    }
}
