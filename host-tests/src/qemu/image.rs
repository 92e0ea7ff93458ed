//! Building firmware images, and looking at what was built.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

use object::elf::FileHeader32;
use object::read::elf::{FileHeader, SectionHeader};
use object::{Endianness, elf};

/// The chip of every image.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Left out of the nested call of cargo. `RUSTUP_TOOLCHAIN` beats the directory's own choice of a
/// toolchain; an inherited `RUSTFLAGS` drops `target-cpu=cortex-m7`; the rest redirects builds.
const DROPPED: [&str; 9] = [
    "RUSTUP_TOOLCHAIN",
    "RUSTUP_TOOLCHAIN_SOURCE",
    "RUSTFLAGS",
    "CARGO_ENCODED_RUSTFLAGS",
    "CARGO_BUILD_RUSTFLAGS",
    "CARGO_BUILD_TARGET",
    "CARGO",
    "RUSTC",
    "LD_LIBRARY_PATH",
];

/// Why there is no image.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// cargo or its output.
    #[error("cannot build the firmware image: {0}")]
    Cargo(String),
    /// The compiler or the linker refused.
    #[error("the firmware image {image} does not build; the end of what cargo said:\n{said}")]
    NotBuilt {
        /// The image.
        image: String,
        /// Standard error of cargo.
        said: String,
    },
    /// Another floating-point unit than the chip's.
    #[error(
        "{} does not use the double-precision FPU ({found}): build without RUSTFLAGS of your own, \
         so that .cargo/config.toml's target-cpu=cortex-m7 holds",
        .elf.display()
    )]
    WrongFpu {
        /// The image.
        elf: PathBuf,
        /// What it says of itself.
        found: String,
    },
}

/// The workspace this program was built from.
pub fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// What this machine lacks to build and run images, if anything.
pub fn missing() -> Option<String> {
    let mut rustc = Command::new("rustc");
    rustc
        .current_dir(workspace())
        .args(["--print", "target-libdir", "--target", TARGET]);
    let mut qemu = Command::new("qemu-system-arm");
    qemu.arg("--version");
    let says = |command: &mut Command| {
        for name in DROPPED {
            command.env_remove(name);
        }
        let output = command.output().ok()?;
        let text = String::from_utf8_lossy(&output.stdout).trim().to_owned();
        output.status.success().then_some(text)
    };
    if !says(&mut rustc).is_some_and(|folder| Path::new(&folder).is_dir()) {
        return Some(format!(
            "{TARGET} is not installed: run `cargo xtask setup`"
        ));
    }
    if says(&mut qemu).is_none() {
        return Some("qemu-system-arm does not run: run `cargo xtask setup`".to_owned());
    }
    None
}

/// Builds an image of the emulated board, if it is missing or older than its sources, and returns a
/// copy that no later build overwrites.
///
/// # Errors
/// [`ImageError`]; also when the image does not use the chip's double-precision FPU.
pub fn build(image: &str, features: &[&str]) -> Result<PathBuf, ImageError> {
    // Two builds with other features write the same file.
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _guard = ONE_AT_A_TIME
        .lock()
        .unwrap_or_else(|lock| lock.into_inner());

    let mut command = Command::new("cargo");
    command
        .current_dir(workspace())
        .args(["build", "--release", "--package", "surefix-firmware"])
        .args(["--target", TARGET, "--bin", image])
        .args(["--message-format", "json-render-diagnostics"]);
    if !features.is_empty() {
        command.args(["--features", &features.join(",")]);
    }
    for name in DROPPED {
        command.env_remove(name);
    }
    let output = command
        .output()
        .map_err(|error| ImageError::Cargo(format!("cargo does not run ({error})")))?;
    if !output.status.success() {
        return Err(ImageError::NotBuilt {
            image: image.to_owned(),
            said: tail(&String::from_utf8_lossy(&output.stderr)),
        });
    }
    let built = String::from_utf8_lossy(&output.stdout)
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .filter(|message| message["target"]["name"] == image)
        .find_map(|message| Some(PathBuf::from(message["executable"].as_str()?)))
        .ok_or_else(|| ImageError::Cargo("cargo names no executable".to_owned()))?;

    let folder = built.parent().unwrap_or(Path::new(".")).join("images");
    let copy = folder.join([&[image], features].concat().join("-"));
    let bytes = std::fs::read(&built)
        .and_then(|bytes| {
            std::fs::create_dir_all(&folder)?;
            // Written beside and renamed: another process may be booting the old copy.
            let fresh = copy.with_extension(std::process::id().to_string());
            std::fs::write(&fresh, &bytes)?;
            std::fs::rename(&fresh, &copy)?;
            Ok(bytes)
        })
        .map_err(|error| ImageError::Cargo(format!("{}: {error}", copy.display())))?;
    match floating_point(&bytes) {
        Some(fpu) if fpu.has_hardware_f64() => Ok(copy),
        found => Err(ImageError::WrongFpu {
            elf: copy,
            found: format!("{found:?}"),
        }),
    }
}

fn tail(text: &str) -> String {
    let lines: Vec<_> = text.lines().collect();
    lines[lines.len().saturating_sub(40)..].join("\n")
}

/// What an image says of its floating point. [Addenda to, and Errata in, the ABI for the Arm
/// Architecture, IHI 0045], "Build Attributes".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FloatingPoint {
    /// `Tag_FP_arch`: 8 is FPv5 with 16 double registers, the unit of a Cortex-M7.
    pub architecture: u64,
    /// `Tag_ABI_HardFP_use`: 1 when only single precision is done in hardware.
    pub hardware_use: u64,
    /// `Tag_ABI_VFP_args`: 1 when arguments travel in floating-point registers.
    pub arguments_in_registers: u64,
}

impl FloatingPoint {
    /// Whether f64 arithmetic is the hardware's. Any other build gives the same bits 45 times slower.
    pub fn has_hardware_f64(&self) -> bool {
        self.architecture == 8 && self.hardware_use != 1 && self.arguments_in_registers == 1
    }
}

/// Reads the attributes of an image; `None` when it has none that can be read.
pub fn floating_point(image: &[u8]) -> Option<FloatingPoint> {
    let header = FileHeader32::<Endianness>::parse(image).ok()?;
    let endian = header.endian().ok()?;
    let sections = header.sections(endian, image).ok()?;
    let section = sections
        .iter()
        .find(|section| section.sh_type(endian) == elf::SHT_ARM_ATTRIBUTES)?;
    let attributes = section.attributes(endian, image).ok()?;
    let mut found = FloatingPoint::default();
    let mut subsections = attributes.subsections().ok()?;
    while let Some(subsection) = subsections.next().ok()? {
        let mut files = subsection.subsubsections();
        while let Some(file) = files.next().ok()? {
            let mut reader = file.attributes();
            while let Some(tag) = reader.read_tag().ok()? {
                match tag {
                    // Strings: CPU raw name, CPU name, conformance and the odd tags above 32.
                    4 | 5 => drop(reader.read_string().ok()?),
                    32 => {
                        reader.read_integer().ok()?;
                        reader.read_string().ok()?;
                    }
                    tag if tag > 32 && tag % 2 == 1 => drop(reader.read_string().ok()?),
                    10 => found.architecture = reader.read_integer().ok()?,
                    27 => found.hardware_use = reader.read_integer().ok()?,
                    28 => found.arguments_in_registers = reader.read_integer().ok()?,
                    _ => drop(reader.read_integer().ok()?),
                }
            }
        }
    }
    Some(found)
}
