//! The firmware images: built, and then judged by what is in the file.

use std::fs;
use std::path::{Path, PathBuf};

use crate::checks::checked;
use crate::elf::Elf;
use crate::process::command;
use crate::stages::Stages;
use crate::workspace::{TARGET, Workspace};
use crate::{Failure, Result, setup, sizes};

/// The image that every board runs.
pub const APPLICATION: &str = "monitor";

/// A board the application is linked for.
pub struct Board {
    /// Its name, also of `firmware/expected/NAME.size`.
    pub name: &'static str,
    /// Arguments of cargo that choose it.
    pub features: &'static [&'static str],
}

/// The board of CI last: its images are what cargo's folder then holds.
pub const BOARDS: [Board; 3] = [
    Board {
        name: "h743",
        features: &["--no-default-features", "--features", "board-h743"],
    },
    Board {
        name: "h743-sensors",
        features: &["--no-default-features", "--features", "board-h743,sensors"],
    },
    Board {
        name: "mps2",
        features: &[],
    },
];

/// `cargo xtask images`: what [`check`] does, alone.
pub fn run(workspace: &Workspace) -> Result {
    let mut stages = Stages::start();
    if stages.run("setup", || setup::run(workspace)) {
        check(workspace, &mut stages);
    }
    stages.verdict()
}

/// Builds every image and checks sections, sizes, memories, floating point and panics.
pub fn check(workspace: &Workspace, stages: &mut Stages) {
    for board in &BOARDS {
        let mut built = None;
        stages.run(&format!("image: {}", board.name), || {
            built = Some(build(workspace, board)?);
            Ok(())
        });
        if let Some(image) = built {
            stages.run(
                &format!("sections and floating point: {}", board.name),
                || {
                    check_sections(workspace, board, &image)?;
                    check_floating_point(&image)
                },
            );
        }
    }
    stages.run("no panic reachable from core", || check_no_panic(workspace));
}

/// Builds the application for a board; a copy of the image that the next board does not overwrite.
pub fn build(workspace: &Workspace, board: &Board) -> Result<PathBuf> {
    let mut call = build_command(workspace);
    call.args(["--bin", APPLICATION]).args(board.features);
    checked(&mut call)?;
    let copy = workspace.scratch().join(format!("{}.elf", board.name));
    fs::copy(built(workspace, APPLICATION), &copy)
        .map_err(|error| unreadable(&copy, &error.to_string()))?;
    Ok(copy)
}

/// `cargo build` of the firmware in its only profile.
pub fn build_command(workspace: &Workspace) -> std::process::Command {
    let mut call = command(workspace, "cargo");
    call.args([
        "build",
        "--locked",
        "--release",
        "--package",
        "surefix-firmware",
    ])
    .args(["--target", TARGET]);
    call
}

/// Where cargo leaves an image.
pub fn built(workspace: &Workspace, image: &str) -> PathBuf {
    workspace
        .target_dir
        .join(TARGET)
        .join("release")
        .join(image)
}

fn check_sections(workspace: &Workspace, board: &Board, image: &Path) -> Result {
    let bytes = read(image)?;
    let elf = parse(image, &bytes)?;
    for section in elf.sections().iter().filter(|section| section.is_loaded()) {
        println!("  {:<18} {:>8} bytes", section.name, section.size_bytes);
    }
    let list = format!("firmware/expected/{}.size", board.name);
    let text = fs::read_to_string(workspace.root.join(&list)).map_err(|error| {
        Failure::new(
            format!("cannot read {list}: {error}"),
            "write it from the sizes above, one `section max_bytes` per line",
        )
    })?;
    let limits = sizes::parse(&text)
        .map_err(|line| Failure::new(format!("{list}: {line}"), "correct that line"))?;
    let stack = stack(&elf);
    for region in sizes::uses(&limits, elf.sections(), &stack) {
        println!(
            "  {:<18} {:>8} of {} bytes",
            region.region, region.used_bytes, region.length
        );
    }
    let departures = sizes::departures(&limits, elf.sections(), &stack);
    if departures.is_empty() {
        return Ok(());
    }
    Err(Failure::new(
        format!("{list}: {}", departures.join("; ")),
        "make the image smaller, or change the list by hand and say why in the commit",
    ))
}

/// Where the stack lies, by the symbols of the linker script.
fn stack(elf: &Elf) -> sizes::Stack {
    let symbols = elf.symbols();
    let address = |wanted: &str| {
        let mut found = symbols.iter().filter(|(name, _)| *name == wanted);
        found.next().map_or(0, |(_, address)| *address)
    };
    address("_stack_end")..address("_stack_start")
}

fn check_floating_point(image: &Path) -> Result {
    let bytes = read(image)?;
    let elf = parse(image, &bytes)?;
    let attributes = elf.float_attributes().unwrap_or_default();
    if attributes.has_hardware_f64() {
        return Ok(());
    }
    Err(Failure::new(
        format!(
            "{} does not use the double-precision FPU ({attributes:?})",
            image.display()
        ),
        "build without RUSTFLAGS of your own, so that .cargo/config.toml's target-cpu=cortex-m7 holds",
    ))
}

/// The image that calls every public entry of core links only when no panic is reachable; here the
/// file itself is looked at. That a deliberate panic does not link is a test of host-tests.
fn check_no_panic(workspace: &Workspace) -> Result {
    let mut call = build_command(workspace);
    checked(call.args(["--bin", "no_panic", "--features", "no-panic"]))?;
    let image = built(workspace, "no_panic");
    let bytes = read(&image)?;
    let elf = parse(&image, &bytes)?;
    let names = elf.symbols();
    if let Some((name, _)) = names.iter().find(|(name, _)| name.contains("panicking")) {
        return Err(Failure::new(
            format!("{} contains {name}", image.display()),
            "find what calls it and make that return an error",
        ));
    }
    println!("{} symbols, none of them core::panicking", names.len());
    Ok(())
}

/// The bytes of an image.
pub fn read(image: &Path) -> Result<Vec<u8>> {
    fs::read(image).map_err(|error| unreadable(image, &error.to_string()))
}

/// The sections of an image.
pub fn parse<'a>(image: &Path, bytes: &'a [u8]) -> Result<Elf<'a>> {
    Elf::parse(bytes).ok_or_else(|| unreadable(image, "not a 32-bit little-endian ELF file"))
}

fn unreadable(image: &Path, why: &str) -> Failure {
    Failure::new(
        format!("{}: {why}", image.display()),
        "run `cargo xtask test` again from a clean target directory",
    )
}
