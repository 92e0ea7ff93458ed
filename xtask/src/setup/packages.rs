//! The machine's package manager, as root or through sudo.

use std::env;
use std::process::Command;
use std::time::Duration;

use crate::process::{command, output, run_quietly, runs};
use crate::workspace::Workspace;
use crate::{Failure, Result};

const INSTALL_LIMIT: Duration = Duration::from_secs(1200);

/// A package manager this set-up knows how to call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Manager {
    /// Debian, Ubuntu.
    Apt,
    /// Fedora.
    Dnf,
    /// Arch.
    Pacman,
    /// Homebrew.
    Brew,
}

impl Manager {
    /// The first one found on this machine.
    pub fn find(workspace: &Workspace) -> Option<Self> {
        [Self::Apt, Self::Dnf, Self::Pacman, Self::Brew]
            .into_iter()
            .find(|manager| runs(workspace, manager.name(), "--version"))
    }

    /// The program.
    pub fn name(self) -> &'static str {
        match self {
            Self::Apt => "apt-get",
            Self::Dnf => "dnf",
            Self::Pacman => "pacman",
            Self::Brew => "brew",
        }
    }

    /// What holds `qemu-system-arm`.
    pub fn qemu_package(self) -> &'static str {
        match self {
            Self::Apt | Self::Pacman => "qemu-system-arm",
            Self::Dnf => "qemu-system-arm-core",
            Self::Brew => "qemu",
        }
    }

    /// What holds Chromium, where that runs without a desktop and needs no store.
    pub fn browser_package(self) -> Option<&'static str> {
        match self {
            Self::Apt | Self::Dnf | Self::Pacman => Some("chromium"),
            Self::Brew => None,
        }
    }

    /// Installs packages; with stale package lists refreshed once.
    pub fn install(self, workspace: &Workspace, packages: &[&str]) -> Result {
        let joined = packages.join(" ");
        if env::var_os("SUREFIX_SETUP_NO_PACKAGES").is_some() {
            return Err(Failure::new(
                format!("SUREFIX_SETUP_NO_PACKAGES forbids installing {joined}"),
                format!("install {joined} by hand and run `cargo xtask setup` again"),
            ));
        }
        let install = || {
            let mut call = self.as_root(workspace);
            call.args(match self {
                Self::Apt => &[
                    "-o",
                    "DPkg::Lock::Timeout=300",
                    "install",
                    "-y",
                    "-q",
                    "--no-install-recommends",
                ][..],
                Self::Dnf => &["install", "-y"],
                Self::Pacman => &["-S", "--needed", "--noconfirm"],
                Self::Brew => &["install"],
            });
            run_quietly(workspace, call.args(packages), INSTALL_LIMIT)
        };
        if install().is_ok() {
            return Ok(());
        }
        // A fresh machine has no package lists, or old ones; a failure here shows in the next call.
        let mut refresh = self.as_root(workspace);
        match self {
            Self::Apt | Self::Brew => refresh.args(["update"]),
            Self::Dnf => refresh.args(["makecache"]),
            Self::Pacman => refresh.args(["-Sy"]),
        };
        let refreshed = run_quietly(workspace, &mut refresh, INSTALL_LIMIT);
        install().map(drop).map_err(|trouble| {
            let lists = match refreshed {
                Ok(_) => String::new(),
                Err(trouble) => format!("\nrefreshing the package lists {trouble}"),
            };
            Failure::new(
                format!("installing {joined} with {} {trouble}{lists}", self.name()),
                format!("install {joined} by hand (as root) and run `cargo xtask setup` again"),
            )
        })
    }

    fn as_root(self, workspace: &Workspace) -> Command {
        if self == Self::Brew {
            return command(workspace, self.name()); // Homebrew refuses to run as root
        }
        let mut call = as_root(workspace, self.name());
        call.env("DEBIAN_FRONTEND", "noninteractive");
        call
    }
}

/// `program` with root's rights: directly when we have them, through sudo otherwise.
pub fn as_root(workspace: &Workspace, program: &str) -> Command {
    if output(command(workspace, "id").arg("-u")).as_deref() == Some("0") {
        return command(workspace, program);
    }
    let mut sudo = command(workspace, "sudo");
    // Without a terminal there is nobody to type a password: fail instead of waiting.
    sudo.args(["-n", "--preserve-env=DEBIAN_FRONTEND", program]);
    sudo
}
