//! Nested commands: a clean environment, no standard input, time limits, output kept for errors.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::workspace::Workspace;

/// Left out of every nested call. `RUSTUP_TOOLCHAIN`, set by the cargo proxy that started us,
/// beats the directory override a set-up may just have written; an inherited `RUSTFLAGS` drops
/// `target-cpu=cortex-m7` (soft float: the same bits, 45 times slower); the rest redirects builds.
const DROPPED: [&str; 8] = [
    "RUSTUP_TOOLCHAIN",
    "RUSTUP_TOOLCHAIN_SOURCE",
    "RUSTFLAGS",
    "CARGO_ENCODED_RUSTFLAGS",
    "CARGO_BUILD_RUSTFLAGS",
    "CARGO_BUILD_TARGET",
    "CARGO",
    "RUSTC",
];

/// `program` in the workspace's root, with the environment of a plain shell.
pub fn command(workspace: &Workspace, program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(&workspace.root).stdin(Stdio::null());
    for name in DROPPED {
        command.env_remove(name);
    }
    // The libraries of the toolchain that started us are not those of the one called.
    command.env_remove("LD_LIBRARY_PATH");
    command.env("CARGO_TARGET_DIR", &workspace.target_dir);
    command
}

/// True when `program --version` (or the argument given) runs.
pub fn runs(workspace: &Workspace, program: &str, argument: &str) -> bool {
    command(workspace, program)
        .arg(argument)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|status| status.success())
}

/// Standard output of a command that succeeded, trimmed.
pub fn output(command: &mut Command) -> Option<String> {
    let output = command.stderr(Stdio::null()).output().ok()?;
    output
        .status
        .success()
        .then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// How a bounded command failed, with the end of what it printed.
pub enum Trouble {
    /// The program could not be started.
    NotStarted(io::Error),
    /// It ended with an error.
    Failed {
        /// Exit status.
        status: ExitStatus,
        /// Last lines printed.
        tail: String,
    },
    /// It was still running at the limit and was stopped.
    TimedOut {
        /// The limit.
        limit: Duration,
        /// Last lines printed.
        tail: String,
    },
}

impl std::fmt::Display for Trouble {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::NotStarted(error) => write!(f, "could not be started ({error})"),
            Self::Failed { status, tail } => write!(f, "ended with {status}{tail}"),
            Self::TimedOut { limit, tail } => {
                write!(f, "was stopped after {} s{tail}", limit.as_secs())
            }
        }
    }
}

/// Runs a command quietly, for at most `limit`; what it prints is returned, or ends the error.
pub fn run_quietly(
    workspace: &Workspace,
    command: &mut Command,
    limit: Duration,
) -> Result<String, Trouble> {
    let log = workspace
        .scratch()
        .join(format!("command-{}.log", std::process::id()));
    let child = fs::create_dir_all(workspace.scratch())
        .and_then(|()| File::create(&log))
        .and_then(|file| Ok((file.try_clone()?, file)))
        .and_then(|(out, err)| command.stdout(out).stderr(err).spawn())
        .map_err(Trouble::NotStarted)?;
    let waited = wait(child, limit).map_err(Trouble::NotStarted)?;
    let text = fs::read(&log).unwrap_or_default();
    let _ = fs::remove_file(&log); // a leftover log does no harm
    let text = String::from_utf8_lossy(&text);
    let tail = tail(&text, 12);
    match waited {
        Some(status) if status.success() => Ok(text.into_owned()),
        Some(status) => Err(Trouble::Failed { status, tail }),
        None => Err(Trouble::TimedOut { limit, tail }),
    }
}

/// The exit status, or nothing when the child had to be stopped at the limit.
fn wait(mut child: Child, limit: Duration) -> io::Result<Option<ExitStatus>> {
    let deadline = Instant::now() + limit;
    loop {
        if let Some(status) = child.try_wait()? {
            return Ok(Some(status));
        }
        if Instant::now() >= deadline {
            child.kill()?;
            child.wait()?;
            return Ok(None);
        }
        thread::sleep(Duration::from_millis(20));
    }
}

/// The last `count` lines, each on a line of its own and indented.
fn tail(text: &str, count: usize) -> String {
    let lines: Vec<&str> = text.lines().collect();
    lines
        .iter()
        .skip(lines.len().saturating_sub(count))
        .map(|line| format!("\n    {line}"))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tail_keeps_the_last_lines() {
        assert_eq!(tail("a\nb\nc\n", 2), "\n    b\n    c");
        assert_eq!(tail("a", 2), "\n    a");
        assert_eq!(tail("", 2), "");
    }

    #[cfg(unix)]
    #[test]
    fn a_command_is_stopped_at_its_limit() {
        let child = Command::new("sleep").arg("30").spawn().unwrap();
        let started = Instant::now();
        assert!(wait(child, Duration::from_millis(50)).unwrap().is_none());
        assert!(started.elapsed() < Duration::from_secs(10));
    }
}
