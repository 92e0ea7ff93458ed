//! The Cortex-M7 target: found, added by rustup, or built for the distribution's compiler.

use std::fs;
use std::path::Path;
use std::time::Duration;

use super::{RUSTUP_LIMIT, distribution, rustup_may_download, say};
use crate::process::{Trouble, command, output, run_quietly};
use crate::workspace::{TARGET, Workspace};
use crate::{Failure, Result};

/// Compiles against core and alloc and cannot be folded away.
const PROBE: &str = r#"
#![no_std]
#![no_main]
extern crate alloc;
use alloc::alloc::{GlobalAlloc, Layout};
struct Nothing;
unsafe impl GlobalAlloc for Nothing {
    unsafe fn alloc(&self, _: Layout) -> *mut u8 { core::ptr::null_mut() }
    unsafe fn dealloc(&self, _: *mut u8, _: Layout) {}
}
#[global_allocator] static ALLOCATOR: Nothing = Nothing;
#[panic_handler] fn panic(_: &core::panic::PanicInfo) -> ! { loop {} }
#[unsafe(no_mangle)] pub extern "C" fn _start(to: *mut u8, from: *const u8, n: usize, x: f64) -> f64 {
    unsafe { core::ptr::copy_nonoverlapping(from, to, n); }
    x * (n as u64 / (n as u64 | 1)) as f64
}
"#;

/// The proof that counts: this `rustc`, called in the workspace, compiles and links for the
/// target, with fat LTO (which needs libraries that carry bitcode, as the official ones do).
pub fn works(workspace: &Workspace, rustc: &str) -> std::result::Result<(), Trouble> {
    let folder = workspace
        .scratch()
        .join(format!("probe-{}", std::process::id()));
    fs::create_dir_all(&folder)
        .and_then(|()| fs::write(folder.join("probe.rs"), PROBE))
        .map_err(Trouble::NotStarted)?;
    let mut call = command(workspace, rustc);
    // The question is what is installed, not what rustup would fetch.
    call.env("RUSTUP_AUTO_INSTALL", "0")
        .args(["--edition", "2021", "--target", TARGET])
        .args(["-C", "panic=abort", "-C", "opt-level=2", "-C", "lto=fat"])
        .arg("-o")
        .arg(folder.join("probe.elf"))
        .arg(folder.join("probe.rs"));
    let outcome = run_quietly(workspace, &mut call, Duration::from_secs(120));
    let _ = fs::remove_dir_all(&folder); // a leftover probe does no harm
    outcome.map(drop)
}

/// Leaves the workspace with a compiler for the target, or says what to do.
pub fn ensure(workspace: &Workspace) -> Result {
    if works(workspace, "rustc").is_ok() {
        say(&format!("{TARGET}: already there, {}", active(workspace)));
        return Ok(());
    }
    if rustup_may_download(workspace) {
        say(&format!("{TARGET}: asking rustup for it"));
        let mut rustup = command(workspace, "rustup");
        rustup.args(["target", "add", TARGET]);
        match run_quietly(workspace, &mut rustup, RUSTUP_LIMIT) {
            Ok(_) if works(workspace, "rustc").is_ok() => {
                say(&format!(
                    "{TARGET}: added with rustup, {}",
                    active(workspace)
                ));
                return Ok(());
            }
            Ok(_) => say("rustup has added it, but a probe does not link"),
            Err(trouble) => say(&format!("rustup target add {trouble}")),
        }
    }
    say(&format!(
        "{TARGET}: not to be had from rustup, taking the distribution's compiler"
    ));
    distribution::ensure(workspace)?;
    works(workspace, "rustc").map_err(|trouble| {
        Failure::new(
            format!(
                "plain `rustc` in {} still does not link for {TARGET}: it {trouble}",
                workspace.root.display()
            ),
            "put the distribution's rustc first in PATH, or install rustup, and run `cargo xtask setup` again",
        )
    })?;
    say(&format!("{TARGET}: ready, {}", active(workspace)));
    Ok(())
}

/// The compiler that plain `cargo` uses in the workspace, in its own words.
fn active(workspace: &Workspace) -> String {
    output(command(workspace, "rustc").arg("-V")).unwrap_or_else(|| "rustc".to_owned())
}

/// True when both paths lead to the same file.
pub fn same_file(a: &Path, b: &Path) -> bool {
    matches!((fs::canonicalize(a), fs::canonicalize(b)), (Ok(a), Ok(b)) if a == b)
}
