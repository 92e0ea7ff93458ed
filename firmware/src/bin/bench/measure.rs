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

/// One measured piece of work.
#[derive(Clone, Copy)]
pub struct Pass {
    instructions: u32,
    /// Its number over all rows.
    number: u32,
    stack_b: usize,
}

/// Measures one run of `work` in place of whatever it returns.
pub fn pass(work: impl FnOnce()) -> Pass {
    static PASSES: AtomicU32 = AtomicU32::new(0);
    let number = PASSES.load(Ordering::Relaxed);
    PASSES.store(number + 1, Ordering::Relaxed);
    let mut instructions = 0;
    let stack_b = stack::bytes_used_by(|| instructions = count(work));
    Pass {
        instructions,
        number,
        stack_b,
    }
}

/// What a row is about besides its stage; `None` is printed as a dash.
#[derive(Clone, Copy, Default)]
pub struct Of {
    pub n_sats: Option<usize>,
    pub n_states: Option<usize>,
    pub filters: Option<usize>,
    pub ram_b: Option<usize>,
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

    /// Measures one run of `work` for this row.
    pub fn run(&mut self, work: impl FnOnce()) {
        self.add(pass(work));
    }

    /// Adds what was measured.
    pub fn add(&mut self, pass: Pass) {
        self.stack_b = self.stack_b.max(pass.stack_b);
        if let Some(place) = self.counts.get_mut(self.filled) {
            *place = (pass.instructions, pass.number);
            self.filled += 1;
        }
    }

    /// Prints the row.
    pub fn print(self, stage: &str, n_sats: Option<usize>, n_states: Option<usize>) {
        self.print_of(
            stage,
            &Of {
                n_sats,
                n_states,
                ..Of::default()
            },
        );
    }

    /// Prints the row of a number of filters.
    pub fn print_of(mut self, stage: &str, of: &Of) {
        let counts = &mut self.counts[..self.filled];
        counts.sort_unstable();
        let (Some((median, pass)), Some((worst, _))) =
            (counts.get(counts.len() / 2), counts.last())
        else {
            return;
        };
        hprintln!(
            "row {} {} {} {} {} {} {} {} {}",
            stage,
            Dash(of.n_sats),
            Dash(of.n_states),
            Dash(of.filters),
            median,
            worst,
            self.stack_b,
            Dash(of.ram_b),
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
