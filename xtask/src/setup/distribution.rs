//! The last route to the target: the distribution's compiler, with `core` and `alloc` built once.
//!
//! Distributions ship no library for `thumbv7em-none-eabihf`, but they ship the library's source.
//! Built with `-Zbuild-std` and installed where the compiler looks for a target, it serves plain
//! `cargo build --target`, so nothing else in the workspace has to know of it.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::packages::{self, Manager};
use super::version::{Version, field, minimum};
use super::{say, target};
use crate::process::{command, output, run_quietly, runs};
use crate::workspace::{TARGET, Workspace};
use crate::{Failure, Result};

const RUSTC: &str = "/usr/bin/rustc";
const CARGO: &str = "/usr/bin/cargo";

/// rustup's name for the linked toolchain.
const LINK: &str = "distribution";

/// What other machines without rustup's target have to do by hand.
const BY_HAND: &str = "let rustup reach its server (`rustup target add thumbv7em-none-eabihf`), then run `cargo xtask setup` again";

/// The library that is the whole of the target, and nothing that needs an operating system.
const LIBRARIES: [&str; 3] = ["core", "alloc", "compiler_builtins"];

const BUILD_LIMIT: Duration = Duration::from_secs(900);

/// A distribution compiler that was found to run.
struct Compiler {
    /// All of `rustc -vV`: what the built libraries are good for.
    identity: String,
    sysroot: PathBuf,
}

impl Compiler {
    fn find(workspace: &Workspace) -> Option<Self> {
        let identity = output(command(workspace, RUSTC).arg("-vV"))?;
        let sysroot = output(command(workspace, RUSTC).args(["--print", "sysroot"]))?;
        runs(workspace, CARGO, "--version").then(|| Self {
            identity,
            sysroot: PathBuf::from(sysroot),
        })
    }

    fn field(&self, key: &str) -> &str {
        field(&self.identity, key).unwrap_or_default()
    }

    fn library_source(&self) -> PathBuf {
        self.sysroot.join("lib/rustlib/src/rust/library")
    }

    fn target_libraries(&self) -> PathBuf {
        self.sysroot.join("lib/rustlib").join(TARGET).join("lib")
    }
}

/// Installs the distribution's compiler, gives it the target, and selects it for the workspace.
pub fn ensure(workspace: &Workspace) -> Result {
    let compiler = install_compiler(workspace)?;
    ensure_new_enough(workspace, &compiler)?;
    ensure_linker(workspace, &compiler)?;
    ensure_libraries(workspace, &compiler)?;
    if runs(workspace, "rustup", "--version") {
        select(workspace, &compiler)?;
    }
    Ok(())
}

fn install_compiler(workspace: &Workspace) -> Result<Compiler> {
    let complete = || Compiler::find(workspace).filter(|found| found.library_source().is_dir());
    if let Some(compiler) = complete() {
        return Ok(compiler);
    }
    if Manager::find(workspace) != Some(Manager::Apt) {
        return Err(Failure::new(
            format!(
                "the target {TARGET} is missing and only Debian's and Ubuntu's compilers are known here"
            ),
            BY_HAND,
        ));
    }
    say("installing the distribution's rustc, cargo and library source");
    // Debian keeps a current compiler beside its stable one under names ending in -web.
    let current = ["rustc-web", "cargo-web", "rust-web-src"];
    let plain = ["rustc", "cargo", "rust-src"];
    Manager::Apt
        .install(workspace, &current)
        .or_else(|_| Manager::Apt.install(workspace, &plain))?;
    // Of the same release, nice to have only: without them their checks are left out, loudly.
    for (tool, package) in [
        ("rustfmt", "rustfmt-web"),
        ("cargo-clippy", "rust-web-clippy"),
    ] {
        if !Path::new("/usr/bin").join(tool).exists() {
            let _ = Manager::Apt.install(workspace, &[package]);
        }
    }
    complete().ok_or_else(|| {
        Failure::new(
            format!("the packages are installed, but {RUSTC}, {CARGO} or the library source is not there"),
            BY_HAND,
        )
    })
}

fn ensure_new_enough(workspace: &Workspace, compiler: &Compiler) -> Result {
    let manifest = fs::read_to_string(workspace.root.join("Cargo.toml")).unwrap_or_default();
    let (needed, found) = (
        minimum(&manifest),
        Version::parse(compiler.field("release")),
    );
    match (needed, found) {
        (Some(needed), Some(found)) if found < needed => Err(Failure::new(
            format!("the distribution's rustc is {found}, the workspace needs {needed}"),
            BY_HAND,
        )),
        _ => Ok(()),
    }
}

/// The target links with `rust-lld`, which Debian leaves out of its toolchain; it is LLVM's lld
/// under another name, looked for in the toolchain's own folder.
fn ensure_linker(workspace: &Workspace, compiler: &Compiler) -> Result {
    let tools = compiler
        .sysroot
        .join("lib/rustlib")
        .join(compiler.field("host"))
        .join("bin");
    let place = tools.join("rust-lld");
    if place.exists() {
        return Ok(());
    }
    let llvm = compiler.field("LLVM version").split('.').next();
    let names = [
        format!("lld-{}", llvm.unwrap_or_default()),
        "lld".to_owned(),
    ];
    let find = || {
        names
            .iter()
            .map(|name| Path::new("/usr/bin").join(name))
            .find(|path| path.exists())
    };
    if find().is_none() {
        say(&format!("installing the linker ({})", names[0]));
        Manager::Apt
            .install(workspace, &[&names[0]])
            .or_else(|_| Manager::Apt.install(workspace, &[&names[1]]))?;
    }
    let linker = find().ok_or_else(|| {
        Failure::new(
            format!(
                "no {} in /usr/bin after its package was installed",
                names[0]
            ),
            format!(
                "install LLVM's lld, link it to {}, and run `cargo xtask setup` again",
                place.display()
            ),
        )
    })?;
    make_folder(workspace, &tools)?;
    root_command(workspace, "ln", &["-sf".as_ref(), &linker, &place])?;
    say(&format!("rust-lld is {}", linker.display()));
    Ok(())
}

fn ensure_libraries(workspace: &Workspace, compiler: &Compiler) -> Result {
    let installed = compiler.target_libraries();
    let stamp = installed.join(".built-for");
    let current = fs::read_to_string(&stamp).is_ok_and(|text| text == compiler.identity);
    if current && target::works(workspace, RUSTC).is_ok() {
        return Ok(());
    }
    say(&format!(
        "building core and alloc of rustc {} for {TARGET} (once, about a minute)",
        compiler.field("release")
    ));
    let started = Instant::now();
    let build = workspace.scratch().join("target-libraries");
    let built = build_libraries(workspace, compiler, &build)?;
    make_folder(workspace, &installed)?;
    for old in libraries_in(&installed) {
        root_command(workspace, "rm", &["-f".as_ref(), &old])?;
    }
    for library in &built {
        root_command(
            workspace,
            "install",
            &["-m644".as_ref(), library, &installed],
        )?;
    }
    let own_stamp = build.join("stamp");
    fs::write(&own_stamp, &compiler.identity).map_err(|error| cannot_write(&own_stamp, &error))?;
    root_command(
        workspace,
        "install",
        &["-m644".as_ref(), &own_stamp, &stamp],
    )?;
    let _ = fs::remove_dir_all(&build); // only disk space
    target::works(workspace, RUSTC).map_err(|trouble| {
        Failure::new(
            format!("{RUSTC} with its new libraries does not link for {TARGET}: it {trouble}"),
            BY_HAND,
        )
    })?;
    say(&format!(
        "installed in {} ({:.0} s)",
        installed.display(),
        started.elapsed().as_secs_f64()
    ));
    Ok(())
}

/// Builds the libraries in a package of their own; the files to install.
fn build_libraries(
    workspace: &Workspace,
    compiler: &Compiler,
    folder: &Path,
) -> Result<Vec<PathBuf>> {
    const MANIFEST: &str = "[package]\nname = \"target-libraries\"\nversion = \"0.0.0\"\nedition = \"2021\"\n\
        [workspace]\n[profile.release]\nopt-level = 3\ncodegen-units = 1\ndebug = 0\n";
    let _ = fs::remove_dir_all(folder); // absent the first time
    fs::create_dir_all(folder.join("src"))
        .and_then(|()| fs::write(folder.join("Cargo.toml"), MANIFEST))
        .and_then(|()| fs::write(folder.join("src/lib.rs"), "#![no_std]\n"))
        .map_err(|error| cannot_write(folder, &error))?;
    let output_folder = folder.join("target");
    let mut cargo = command(workspace, CARGO);
    cargo
        .current_dir(folder)
        .env("RUSTC", RUSTC)
        .env_remove("RUSTC_WRAPPER")
        .env("RUSTC_BOOTSTRAP", "1") // lets a stable compiler take -Zbuild-std
        // Bitcode: cargo leaves it out without LTO, and then nobody could use LTO. Remapped
        // paths: those of the official builds, so that no image names this machine.
        .env(
            "RUSTFLAGS",
            format!(
                "-Cembed-bitcode=yes --remap-path-prefix={}=/rustc/{}/library",
                compiler.library_source().display(),
                compiler.field("release")
            ),
        )
        .args(["build", "--release", "--target", TARGET])
        .args([
            "-Zbuild-std=core,alloc",
            "-Zbuild-std-features=compiler-builtins-mem",
        ])
        .arg("--target-dir")
        .arg(&output_folder);
    run_quietly(workspace, &mut cargo, BUILD_LIMIT).map_err(|trouble| {
        Failure::new(
            format!("building core and alloc for {TARGET} {trouble}"),
            BY_HAND,
        )
    })?;
    let built = libraries_in(&output_folder.join(TARGET).join("release/deps"));
    if built.len() == LIBRARIES.len() {
        Ok(built)
    } else {
        Err(Failure::new(
            format!("of {LIBRARIES:?} the build has left {built:?}"),
            BY_HAND,
        ))
    }
}

/// The `.rlib` files of [`LIBRARIES`] in a folder.
fn libraries_in(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else {
        return Vec::new();
    };
    entries
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| {
            path.extension()
                .is_some_and(|extension| extension == "rlib")
                && path
                    .file_name()
                    .and_then(|name| name.to_str())
                    .is_some_and(|name| {
                        LIBRARIES
                            .iter()
                            .any(|library| name.starts_with(&format!("lib{library}-")))
                    })
        })
        .collect()
}

/// Tells rustup of the compiler and makes it the workspace's. A directory override beats the
/// workspace's rust-toolchain.toml.
fn select(workspace: &Workspace, compiler: &Compiler) -> Result {
    let linked = output(command(workspace, "rustup").args(["which", "--toolchain", LINK, "rustc"]));
    if !linked.is_some_and(|path| target::same_file(Path::new(&path), Path::new(RUSTC))) {
        let mut link = command(workspace, "rustup");
        link.args(["toolchain", "link", LINK])
            .arg(&compiler.sysroot);
        rustup(workspace, &mut link)?;
    }
    let mut set = command(workspace, "rustup");
    set.args(["override", "set", LINK, "--path"])
        .arg(&workspace.root);
    rustup(workspace, &mut set)?;
    let root = workspace.root.display();
    say(&format!(
        "this workspace now uses the toolchain `{LINK}` (undo: rustup override unset --path {root})"
    ));
    Ok(())
}

fn rustup(workspace: &Workspace, call: &mut std::process::Command) -> Result {
    run_quietly(workspace, call, Duration::from_secs(60))
        .map(drop)
        .map_err(|trouble| {
            Failure::new(
                format!("{call:?} {trouble}"),
                "run that command by hand, then `cargo xtask setup` again",
            )
        })
}

fn make_folder(workspace: &Workspace, folder: &Path) -> Result {
    root_command(workspace, "mkdir", &["-p".as_ref(), folder])
}

/// A file command in the compiler's folders, which belong to root.
fn root_command(workspace: &Workspace, program: &str, arguments: &[&Path]) -> Result {
    let mut call = packages::as_root(workspace, program);
    run_quietly(workspace, call.args(arguments), Duration::from_secs(60))
        .map(drop)
        .map_err(|trouble| {
            Failure::new(
                format!("{program} {arguments:?} {trouble}"),
                "run `cargo xtask setup` once as root (or with a password-less sudo)",
            )
        })
}

fn cannot_write(path: &Path, error: &std::io::Error) -> Failure {
    Failure::new(
        format!("cannot write {}: {error}", path.display()),
        "make the target directory writable and run `cargo xtask setup` again",
    )
}
