//! Counting, and the rows.

use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m_semihosting::{debug, hprintln};
use surefix_firmware::board::{bench_begin, bench_end, instructions, stack, ticks};

/// Skies per row.
pub const RUNS: usize = 15;

/// Executed instructions of `work`, without those of counting.
#[inline(never)]
pub fn count(work: impl FnOnce()) -> u32 {
    bench_begin();
    let begin = ticks();
    let empty = ticks();
    work();
    let end = ticks();
    bench_end();
    let overhead = empty.wrapping_sub(begin);
    instructions(u64::from(end.wrapping_sub(empty).wrapping_sub(overhead))) as u32
}

/// The figures of one row while they are gathered.
pub struct Row {
    /// Instructions, and the number of the pass over all rows.
    counts: [(u32, u32); RUNS],
    filled: usize,
    stack_b: usize,
}

impl Row {
    /// No figure yet.
    pub const fn new() -> Self {
        Self {
            counts: [(0, 0); RUNS],
            filled: 0,
            stack_b: 0,
        }
    }

    /// Measures one run of `work` in place of whatever it returns.
    pub fn run(&mut self, work: impl FnOnce()) {
        static PASSES: AtomicU32 = AtomicU32::new(0);
        let pass = PASSES.load(Ordering::Relaxed);
        PASSES.store(pass + 1, Ordering::Relaxed);
        let mut counted = 0;
        let stack_b = stack::bytes_used_by(|| counted = count(work));
        self.stack_b = self.stack_b.max(stack_b);
        if let Some(place) = self.counts.get_mut(self.filled) {
            *place = (counted, pass);
            self.filled += 1;
        }
    }

    /// Prints the row.
    pub fn print(mut self, stage: &str, n_sats: Option<usize>, n_unknowns: Option<usize>) {
        let counts = &mut self.counts[..self.filled];
        counts.sort_unstable();
        let (Some((median, pass)), Some((worst, _))) =
            (counts.get(counts.len() / 2), counts.last())
        else {
            return;
        };
        let stack_b = self.stack_b;
        hprintln!(
            "row {} {} {} - {} {} {} {}",
            stage,
            Dash(n_sats),
            Dash(n_unknowns),
            median,
            worst,
            stack_b,
            pass
        );
    }
}

/// A number, or a dash for none.
struct Dash(Option<usize>);

impl core::fmt::Display for Dash {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self.0 {
            Some(number) => number.fmt(f),
            None => f.write_str("-"),
        }
    }
}

/// Ends the run as failed when what is measured does not do its work.
pub fn require(holds: bool, otherwise: &str) {
    if !holds {
        hprintln!("error: {}", otherwise);
        debug::exit(debug::EXIT_FAILURE);
    }
}
