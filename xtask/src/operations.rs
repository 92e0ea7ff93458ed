//! Counts f64 operations and bytes of code on the emulated board, with a QEMU plugin that is compiled when used.
//!
//! The instruction clock counts instructions, not their kind and not where they lie. A C compiler is needed and not
//! everywhere there; without one, or with a QEMU that does not take the plugin, nothing is counted.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

use crate::process::{command, run_quietly};
use crate::workspace::Workspace;
use crate::{images, setup};

const SOURCE: &str = include_str!("../plugin/count.c");

/// The functions that the benchmark calls before and after each measured piece of work.
const MARKERS: [&str; 2] = ["bench_begin", "bench_end"];

/// A plugin ready for one run of QEMU.
pub struct Counter {
    argument: String,
    counts: PathBuf,
}

impl Counter {
    /// Compiles the plugin for an image, or says why there is none.
    pub fn prepare(workspace: &Workspace, image: &Path) -> Result<Self, String> {
        let compiler = setup::c_compiler(workspace).ok_or("there is no C compiler")?;
        let bytes = images::read(image).map_err(|failure| failure.what)?;
        let elf = images::parse(image, &bytes).map_err(|failure| failure.what)?;
        let symbols = elf.symbols();
        let address = |wanted: &str| {
            symbols
                .iter()
                .find(|(name, _)| *name == wanted)
                .map(|(_, address)| *address)
        };
        let [Some(begin), Some(end)] = MARKERS.map(address) else {
            return Err(format!(
                "the image has no {} and {}",
                MARKERS[0], MARKERS[1]
            ));
        };
        let (source, plugin) = (
            workspace.scratch().join("count.c"),
            workspace.scratch().join("count.so"),
        );
        let counts = workspace.scratch().join("f64-operations.txt");
        fs::create_dir_all(workspace.scratch())
            .and_then(|()| fs::write(&source, SOURCE))
            .map_err(|error| format!("cannot write {}: {error}", source.display()))?;
        let mut call = command(workspace, compiler);
        call.args(["-O2", "-shared", "-fPIC", "-o"])
            .arg(&plugin)
            .arg(&source);
        if cfg!(target_os = "macos") {
            call.args(["-undefined", "dynamic_lookup"]); // QEMU itself brings the symbols
        }
        run_quietly(workspace, &mut call, Duration::from_secs(60))
            .map_err(|trouble| format!("{compiler} {trouble}"))?;
        let argument = format!(
            "{},begin={begin:#x},end={end:#x},out={}",
            plugin.display(),
            counts.display()
        );
        Ok(Self { argument, counts })
    }

    /// Adds the plugin to a run of QEMU.
    pub fn attach(&self, qemu: &mut Command) {
        qemu.args(["-plugin", &self.argument]);
    }

    /// What was counted of every pass, in order.
    pub fn passes(&self) -> Vec<Counts> {
        let text = fs::read_to_string(&self.counts).unwrap_or_default();
        text.lines().map_while(Counts::read).collect()
    }
}

/// What the plugin counts of one pass.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Counts {
    /// f64 operations.
    pub f64_ops: u64,
    /// Bytes of code executed at least 1, 2, 4, … times.
    code_b: Vec<u64>,
}

impl Counts {
    fn read(line: &str) -> Option<Self> {
        let mut numbers = line.split_whitespace().map(|word| word.parse().ok());
        Some(Self {
            f64_ops: numbers.next()??,
            code_b: numbers.collect::<Option<_>>()?,
        })
    }

    /// Bytes of code executed `times` times or more often, `times` taken down to a power of two.
    pub fn code_b(&self, times: u64) -> Option<u64> {
        let power = times.checked_ilog2()?;
        self.code_b.get(usize::try_from(power).ok()?).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_is_that_executed_so_often() {
        let counts = Counts::read("12 100 80 8 4").unwrap();
        assert_eq!(counts.f64_ops, 12);
        assert_eq!(counts.code_b(1), Some(100));
        assert_eq!(counts.code_b(7), Some(8));
        assert_eq!(counts.code_b(8), Some(4));
        assert_eq!(counts.code_b(16), None);
        assert_eq!(counts.code_b(0), None);
        assert_eq!(Counts::read("12 x"), None);
        assert_eq!(Counts::read(""), None);
    }
}
