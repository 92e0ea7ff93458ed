//! `cargo xtask bench`: executed instructions and bytes, per stage and number of satellites, on the
//! emulated Cortex-M7, with the bars they must stay under.
//!
//! The image measures itself with a timer under QEMU's instruction clock (`-icount`), so a figure
//! is a count of instructions, the same in every run, and not a time. It prints one line per row,
//! `row stage n_sats n_states filters instr_median instr_worst stack_b ram_b pass`, `-` where there is
//! nothing; `pass` is the number of one measured pass of that row, counted from 0 over all rows. Its last line
//! is `end`: an image that was reset, as by a full stack, prints none.

use std::fmt::{self, Write};
use std::fs;
use std::path::Path;
use std::time::Duration;

use crate::checks::checked;
use crate::elf::Elf;
use crate::operations::Counter;
use crate::process::{Trouble, command, output, run_quietly};
use crate::workspace::Workspace;
use crate::{Failure, Result, images, setup};

const RUN_LIMIT: Duration = Duration::from_secs(240);

/// The least-squares residual test as P1 computes it, the parity test alone, and that with levels.
const LEAST_SQUARES: &str = "raim/ls";
const PARITY_TEST: &str = "raim/parity_test";
const PARITY: &str = "raim/parity";

/// The suspicions of all subsets, and of those of good geometry, which must be cheaper from so many satellites on: of
/// fifteen subsets of six the pre-check takes more than it saves.
const LEAST_SATELLITES_OF_FOIM: u64 = 8;
const S_RANCO: &str = "consensus/s_ranco";
const FOIM: &str = "consensus/foim";

/// All filters of an epoch, and the bound for correlated errors on top.
const BANK: &str = "bank/total";
const CORRELATED: &str = "bank/correlated";

/// Executed instructions that a stage may take. The test with one constellation (three unknowns of
/// position and one clock): what plain C takes for the same work. A sample at 100 Hz and an epoch of one
/// filter at 1 Hz: what leaves a microcontroller room for the bank. The whole bank, also where all
/// satellites are new and one is excluded: what leaves room for ten epochs a second; with a clock state more
/// 12 % more; the bound 2,000 per filter. ARAIM's modes without the roots of the levels: 3,000 per mode where they are
/// many; of few the solution of all satellites and the list of events are the larger part.
const BARS: [Bar; 17] = [
    Bar::new(PARITY, Some(8), ONE_CLOCK, 7_300),
    Bar::new(PARITY, Some(12), ONE_CLOCK, 15_000),
    Bar::new(PARITY, Some(24), ONE_CLOCK, 54_000),
    Bar::new("ins/mechanisation", None, None, 6_000),
    Bar::new("ins/intake+mechanisation", None, None, 6_000),
    Bar::new("ekf/process", None, None, 100_000),
    Bar::new("ekf/predict+update", Some(12), ONE_FILTER, 13_000),
    Bar::new(BANK, Some(12), ONE_FILTER, 950_000),
    Bar::new(BANK, Some(16), ONE_FILTER, 1_650_000),
    Bar::new(BANK, Some(24), ONE_FILTER, 3_600_000),
    Bar::new(BANK, Some(12), WITH_OFFSET, 1_064_000),
    Bar::new(BANK, Some(16), WITH_OFFSET, 1_848_000),
    Bar::new(BANK, Some(24), WITH_OFFSET, 4_032_000),
    Bar::new(CORRELATED, Some(12), ONE_FILTER, 79 * 2_000),
    Bar::new(CORRELATED, Some(24), ONE_FILTER, 301 * 2_000),
    Bar::new("araim26/solve", Some(24), TWO_CLOCKS, 160_000),
    Bar::new("araim301/solve", Some(24), TWO_CLOCKS, 301 * 3_000),
];

const ONE_CLOCK: Option<u64> = Some(4);
const TWO_CLOCKS: Option<u64> = Some(5);
const ONE_FILTER: Option<u64> = Some(17);
const WITH_OFFSET: Option<u64> = Some(18);

/// The stages that walk over all filters. Each goes through its own code once per filter, and has to find it in the
/// instruction cache again at the next filter.
const WALKS: [&str; 2] = ["bank/predict", "bank/update"];

/// Stack of an epoch of the bank; code of a walk: the instruction cache of a Cortex-M7.
const MAX_BANK_STACK_B: u64 = 16 * 1024;
const MAX_BANK_CODE_B: u64 = 16 * 1024;

/// What [P1] claims the least-squares residual method costs more than the parity method.
const CLAIMED_RATIO: f64 = 2.7;

struct Bar {
    stage: &'static str,
    n_sats: Option<u64>,
    n_states: Option<u64>,
    max_instructions: u64,
}

impl Bar {
    const fn new(
        stage: &'static str,
        n_sats: Option<u64>,
        n_states: Option<u64>,
        max_instructions: u64,
    ) -> Self {
        Self {
            stage,
            n_sats,
            n_states,
            max_instructions,
        }
    }

    fn is_of(&self, row: &Row) -> bool {
        (row.stage.as_str(), row.n_sats, row.n_states) == (self.stage, self.n_sats, self.n_states)
    }
}

impl fmt::Display for Bar {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.stage)?;
        if let Some(n_states) = self.n_states.filter(|_| self.n_states != ONE_CLOCK) {
            write!(f, " of {n_states} states")?;
        }
        if let Some(n_sats) = self.n_sats {
            write!(f, " with {n_sats} satellites")?;
        }
        Ok(())
    }
}

/// One line of the benchmark; `None` is a figure that does not apply.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
struct Row {
    stage: String,
    n_sats: Option<u64>,
    n_states: Option<u64>,
    filters: Option<u64>,
    instr_median: Option<u64>,
    instr_worst: Option<u64>,
    f64_ops: Option<u64>,
    stack_b: Option<u64>,
    ram_b: Option<u64>,
    text_b: Option<u64>,
    /// One of the passes it was measured in.
    pass: Option<u64>,
}

/// What the command line asks for.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Options<'a> {
    json: Option<&'a str>,
    check: bool,
}

impl<'a> Options<'a> {
    /// Reads `[--json FILE] [--check]`, nothing when there is anything else.
    pub fn parse(words: &[&'a str]) -> Option<Self> {
        let mut options = Self::default();
        let mut words = words.iter();
        while let Some(&word) = words.next() {
            match word {
                "--check" => options.check = true,
                "--json" => options.json = Some(*words.next()?),
                _ => return None,
            }
        }
        Some(options)
    }
}

/// Measures, prints the table, and with the options writes it and judges it.
pub fn run(workspace: &Workspace, options: &Options) -> Result {
    setup::run(workspace)?;
    let rows = measure(workspace)?;
    let rustc = output(command(workspace, "rustc").arg("-V")).unwrap_or_default();
    print!("{}", table(&rows));
    println!("{rustc}");
    if let Some(file) = options.json {
        fs::write(file, json(&rustc, &rows)).map_err(|error| {
            Failure::new(
                format!("cannot write {file}: {error}"),
                "give --json a file in a folder that exists",
            )
        })?;
        println!("written: {file}");
    }
    if options.check { judge(&rows) } else { Ok(()) }
}

/// The bars alone, as a stage of `cargo xtask test`.
pub fn check(workspace: &Workspace) -> Result {
    let rows = measure(workspace)?;
    print!("{}", table(&rows));
    judge(&rows)
}

/// Builds and runs the benchmark and weighs the application's images.
fn measure(workspace: &Workspace) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for board in &images::BOARDS {
        rows.push(weigh(board.name, &images::build(workspace, board)?)?);
    }
    checked(images::build_command(workspace).args(["--bin", "bench"]))?;
    let image = images::built(workspace, "bench");
    let mut measured = match Counter::prepare(workspace, &image) {
        Ok(counter) => counted(workspace, &image, &counter)?,
        Err(reason) => {
            println!("f64 operations are not counted: {reason}");
            parse(&emulate(workspace, &image, None).map_err(not_emulated)?)?
        }
    };
    measured.append(&mut rows);
    Ok(measured)
}

/// The rows with their f64 operations; without those where QEMU does not take the plugin.
fn counted(workspace: &Workspace, image: &Path, counter: &Counter) -> Result<Vec<Row>> {
    let printed = match emulate(workspace, image, Some(counter)) {
        Ok(printed) => printed,
        Err(trouble) => {
            println!("f64 operations are not counted: QEMU with the plugin {trouble}");
            emulate(workspace, image, None).map_err(not_emulated)?
        }
    };
    let mut rows = parse(&printed)?;
    let passes = counter.passes();
    for row in &mut rows {
        let counts = row
            .pass
            .and_then(|pass| passes.get(usize::try_from(pass).ok()?));
        row.f64_ops = counts.map(|counts| counts.f64_ops);
        if row.stage == BANK || WALKS.contains(&row.stage.as_str()) {
            row.text_b = counts
                .zip(row.filters)
                .and_then(|(counts, filters)| counts.code_b(filters));
        }
    }
    Ok(rows)
}

/// What the image prints on the emulated board.
fn emulate(
    workspace: &Workspace,
    image: &Path,
    counter: Option<&Counter>,
) -> std::result::Result<String, Trouble> {
    let mut qemu = command(workspace, "qemu-system-arm");
    qemu.args(["-M", setup::BOARD, "-display", "none", "-monitor", "none"])
        .args(["-serial", "null", "-no-reboot"])
        .args(["-semihosting-config", "enable=on,target=native"])
        .args(["-icount", "shift=6,sleep=off", "-kernel"])
        .arg(image);
    if let Some(counter) = counter {
        counter.attach(&mut qemu);
    }
    run_quietly(workspace, &mut qemu, RUN_LIMIT)
}

fn not_emulated(trouble: Trouble) -> Failure {
    Failure::new(
        format!("the benchmark on the emulated board {trouble}"),
        "read firmware/src/bin/bench.rs",
    )
}

/// Static memory and flash of an application image.
fn weigh(board: &str, image: &Path) -> Result<Row> {
    let bytes = images::read(image)?;
    let elf: Elf = images::parse(image, &bytes)?;
    let sum = |wanted: fn(&crate::elf::Section) -> bool| {
        elf.sections()
            .iter()
            .filter(|section| section.is_loaded() && wanted(section))
            .map(|section| u64::from(section.size_bytes))
            .sum()
    };
    Ok(Row {
        stage: format!("image/{board}"),
        ram_b: Some(sum(|section| section.is_writable())),
        text_b: Some(sum(|section| section.is_stored())),
        ..Row::default()
    })
}

/// The rows among the lines of the benchmark.
fn parse(printed: &str) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    if !printed.lines().any(|line| line == "end") {
        return Err(Failure::new(
            format!("the benchmark did not come to its end: {}", ending(printed)),
            "the board was reset by a panic, a fault or a full stack: build nothing large on the stack",
        ));
    }
    for line in printed.lines() {
        let Some(fields) = line.strip_prefix("row ") else {
            continue;
        };
        rows.push(row(fields).ok_or_else(|| {
            Failure::new(
                format!("the benchmark printed `{line}`"),
                "make firmware/src/bin/bench.rs and xtask/src/bench.rs agree on the form of a row",
            )
        })?);
    }
    if rows.is_empty() {
        return Err(Failure::new(
            format!("the benchmark printed no row, only\n{printed}"),
            "read firmware/src/bin/bench.rs",
        ));
    }
    Ok(rows)
}

/// The last line printed.
fn ending(printed: &str) -> &str {
    printed.lines().last().unwrap_or("it printed nothing")
}

fn row(fields: &str) -> Option<Row> {
    let mut words = fields.split_whitespace();
    let stage = words.next()?.to_owned();
    let mut number = || match words.next()? {
        "-" => Some(None),
        digits => Some(Some(digits.parse().ok()?)),
    };
    let row = Row {
        stage,
        n_sats: number()?,
        n_states: number()?,
        filters: number()?,
        instr_median: number()?,
        instr_worst: number()?,
        stack_b: number()?,
        ram_b: number()?,
        pass: number()?,
        ..Row::default()
    };
    words.next().is_none().then_some(row)
}

/// The row of a stage for a sky with one constellation.
fn find<'a>(rows: &'a [Row], stage: &str, n_sats: u64) -> Option<&'a Row> {
    rows.iter()
        .find(|row| row.stage == stage && row.n_sats == Some(n_sats) && row.n_states == ONE_CLOCK)
}

/// The rows, then the ratio of the two tests.
fn table(rows: &[Row]) -> String {
    let mut text = String::new();
    let cell = |value: Option<u64>| value.map_or_else(|| "-".to_owned(), |value| value.to_string());
    let heads = [
        "sats", "states", "filters", "median", "worst", "f64 ops", "stack B", "RAM B", "flash B",
    ];
    let _ = write!(text, "{:<25}", "stage");
    for head in heads {
        let _ = write!(text, "{head:>10}");
    }
    text.push('\n');
    for row in rows {
        let _ = write!(text, "{:<25}", row.stage);
        let values = [
            row.n_sats,
            row.n_states,
            row.filters,
            row.instr_median,
            row.instr_worst,
            row.f64_ops,
            row.stack_b,
            row.ram_b,
            row.text_b,
        ];
        for value in values {
            let _ = write!(text, "{:>10}", cell(value));
        }
        text.push('\n');
    }
    text.push_str("median and worst: executed instructions on the emulated Cortex-M7\n\n");
    for row in rows {
        if row.stage != LEAST_SQUARES || row.n_states != ONE_CLOCK {
            continue;
        }
        let (Some(n_sats), Some(least_squares)) = (row.n_sats, row.instr_median) else {
            continue;
        };
        let ratio = |stage| {
            find(rows, stage, n_sats)
                .and_then(|row| row.instr_median)
                .map_or_else(
                    || "-".to_owned(),
                    |parity| format!("{:.2}", least_squares as f64 / parity as f64),
                )
        };
        let _ = writeln!(
            text,
            "N = {n_sats:>2}: least squares / parity = {} for the test alone ([P1] claims {CLAIMED_RATIO}), \
             {} when parity also computes its levels",
            ratio(PARITY_TEST),
            ratio(PARITY)
        );
    }
    for (foim, share) in shares_of_foim(rows) {
        let _ = writeln!(
            text,
            "N = {:>2}, {} unknowns: FOIM / S-RANCO = {share:.2}",
            foim.n_sats.unwrap_or(0),
            foim.n_states.unwrap_or(0)
        );
    }
    text.push_str(&growth(rows));
    text
}

/// Every row of FOIM, and its instructions over those of S-RANCO under the same skies.
fn shares_of_foim(rows: &[Row]) -> Vec<(&Row, f64)> {
    let share = |foim: &Row| {
        let of_same = |row: &&Row| {
            row.stage == S_RANCO && (row.n_sats, row.n_states) == (foim.n_sats, foim.n_states)
        };
        let s_ranco = rows.iter().find(of_same)?.instr_median?;
        Some(foim.instr_median? as f64 / s_ranco as f64)
    };
    let foim = rows.iter().filter(|row| row.stage == FOIM);
    foim.filter_map(|row| Some((row, share(row)?))).collect()
}

/// How the bank grows with the number of satellites: N, filters, instructions per filter, and the exponent of
/// a power of N fitted to them; then what a clock state more costs.
fn growth(rows: &[Row]) -> String {
    let of = |n_states: Option<u64>| {
        let rows = rows.iter().filter(move |row| row.stage == BANK);
        rows.filter(move |row| row.n_states == n_states)
            .filter_map(|row| Some((row.n_sats?, row.filters?, row.instr_median?)))
    };
    let mut text = String::new();
    let points: Vec<(f64, f64)> = of(ONE_FILTER)
        .map(|(n_sats, _, median)| (n_sats as f64, median as f64))
        .collect();
    let Some(exponent) = exponent(&points) else {
        return text;
    };
    text.push('\n');
    for (n_sats, filters, median) in of(ONE_FILTER) {
        let _ = write!(
            text,
            "bank of 17 states, N = {n_sats:>2}: {filters:>3} filters, {median:>7} instructions, {:>5} per filter",
            median / filters.max(1)
        );
        let more = of(WITH_OFFSET).find(|(n, ..)| *n == n_sats);
        if let Some((.., with_offset)) = more {
            let _ = write!(
                text,
                "; of 18 states {:+.1} %",
                100.0 * (with_offset as f64 / median as f64 - 1.0)
            );
        }
        text.push('\n');
    }
    let _ = writeln!(text, "bank of 17 states: grows as N^{exponent:.2}");
    text
}

/// The exponent of the power of x that fits y best, by least squares of the logarithms.
fn exponent(points: &[(f64, f64)]) -> Option<f64> {
    let n = points.len() as f64;
    let logs = || points.iter().map(|(x, y)| (x.ln(), y.ln()));
    let (x_mean, y_mean) = (
        logs().map(|(x, _)| x).sum::<f64>() / n,
        logs().map(|(_, y)| y).sum::<f64>() / n,
    );
    let xx: f64 = logs().map(|(x, _)| (x - x_mean) * (x - x_mean)).sum();
    let xy: f64 = logs().map(|(x, y)| (x - x_mean) * (y - y_mean)).sum();
    (xx > 0.0).then(|| xy / xx)
}

/// Every bar, met or not; a figure that is missing is not met.
fn judge(rows: &[Row]) -> Result {
    let mut missed = Vec::new();
    for bar in &BARS {
        let found = rows.iter().find(|row| bar.is_of(row));
        let limit = bar.max_instructions;
        match found.and_then(|row| row.instr_worst) {
            Some(worst) if worst <= limit => println!("{bar}: {worst} of {limit} instructions"),
            Some(worst) => missed.push(format!(
                "{bar} takes {worst} instructions, the bar is {limit}"
            )),
            None => missed.push(format!("{bar} was not measured")),
        }
    }
    for row in rows {
        if row.stage == BANK {
            missed.extend(over_bytes(row));
        } else if WALKS.contains(&row.stage.as_str()) {
            missed.extend(over_code(row));
        }
    }
    for (foim, share) in shares_of_foim(rows) {
        let n_sats = foim.n_sats.unwrap_or(0);
        if n_sats >= LEAST_SATELLITES_OF_FOIM && share >= 1.0 {
            missed.push(format!(
                "FOIM with {n_sats} satellites takes {share:.2} times what S-RANCO takes"
            ));
        }
    }
    if missed.is_empty() {
        return Ok(());
    }
    Err(Failure::new(
        missed.join("; "),
        "make it cheaper; `cargo xtask bench` shows every figure",
    ))
}

/// Which bytes of a row of the bank are above their bars. RAM: state and packed covariance of every filter, and
/// 3 %.
fn over_bytes(row: &Row) -> Vec<String> {
    let n_states = row.n_states.unwrap_or(0);
    let per_filter_b = 8 * (n_states * (n_states + 1) / 2 + n_states);
    let max_ram_b = row.filters.unwrap_or(0) * per_filter_b * 103 / 100;
    let ram = over(row, "RAM", row.ram_b, max_ram_b);
    let stack = over(row, "stack", row.stack_b, MAX_BANK_STACK_B);
    ram.into_iter().chain(stack).collect()
}

/// The code of a walk over filters of 17 states, where something counts it.
fn over_code(row: &Row) -> Option<String> {
    row.text_b
        .filter(|_| row.n_states == ONE_FILTER)
        .and_then(|code_b| over(row, "code", Some(code_b), MAX_BANK_CODE_B))
}

fn over(row: &Row, what: &str, bytes: Option<u64>, limit: u64) -> Option<String> {
    let is_within = bytes.is_some_and(|bytes| bytes <= limit);
    let bytes = bytes.map_or_else(|| "unknown".to_owned(), |bytes| bytes.to_string());
    (!is_within).then(|| {
        format!(
            "{} of {} states with {} satellites: {what} {bytes} bytes, the bar is {limit}",
            row.stage,
            row.n_states.unwrap_or(0),
            row.n_sats.unwrap_or(0),
        )
    })
}

/// The form of DESIGN section 5.
fn json(rustc: &str, rows: &[Row]) -> String {
    let number =
        |value: Option<u64>| value.map_or_else(|| "null".to_owned(), |value| value.to_string());
    let rows: Vec<String> = rows
        .iter()
        .map(|row| {
            format!(
                "{{\"stage\":{},\"n_sats\":{},\"n_states\":{},\"filters\":{},\"instr_median\":{},\
                 \"instr_worst\":{},\"f64_ops\":{},\"stack_b\":{},\"ram_b\":{},\"text_b\":{}}}",
                quoted(&row.stage),
                number(row.n_sats),
                number(row.n_states),
                number(row.filters),
                number(row.instr_median),
                number(row.instr_worst),
                number(row.f64_ops),
                number(row.stack_b),
                number(row.ram_b),
                number(row.text_b),
            )
        })
        .collect();
    format!(
        "{{\"rustc\":{},\"rows\":[\n{}\n]}}\n",
        quoted(rustc),
        rows.join(",\n")
    )
}

/// A JSON string.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for character in text.chars() {
        match character {
            '"' | '\\' => quoted.extend(['\\', character]),
            control if control.is_control() => {
                let _ = write!(quoted, "\\u{:04x}", u32::from(control));
            }
            other => quoted.push(other),
        }
    }
    quoted.push('"');
    quoted
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRINTED: &str = "surefix benchmark\nrow raim/ls 8 4 - 14000 14100 900 - 0\n\
        row raim/parity 8 4 - 7000 7200 800 - 1\nrow raim/parity 12 4 - 14000 14500 - - 2\n\
        row raim/parity 24 4 - 50000 54001 - - 3\nrow raim/parity 24 6 - 60000 60001 - - 4\n\
        row decode 8 - - 5 5 - - 5\nrow ins/mechanisation - - - 700 700 - - 6\n\
        row ins/intake+mechanisation - - - 1200 1200 - - 7\n\
        row ekf/process - - - 99999 100000 - - 8\n\
        row ekf/predict+update 12 17 - 11000 11000 - - 9\n\
        row bank/total 12 17 79 910000 940000 1152 108072 10\n\
        row bank/total 16 17 137 1600000 1640000 1152 187416 11\n\
        row bank/total 24 17 301 3500000 3590000 1152 411768 12\n\
        row bank/total 12 18 79 1020000 1060000 1264 121344 13\n\
        row bank/total 16 18 137 1800000 1840000 1264 210432 14\n\
        row bank/total 24 18 301 3920000 4030000 1264 462336 15\n\
        row bank/correlated 12 17 79 33000 33001 1032 - 16\n\
        row bank/correlated 24 17 301 82000 82001 1032 - 17\n\
        row araim26/solve 24 5 - 147000 148000 1988 - 18\n\
        row araim301/solve 24 5 - 815000 816000 1988 - 19\nend\n";

    #[test]
    fn rows_are_read_and_other_lines_ignored() {
        let rows = parse(PRINTED).unwrap();
        assert_eq!(rows.len(), 20);
        assert_eq!(rows[0].instr_worst, Some(14_100));
        assert_eq!(rows[5].n_states, None);
        assert_eq!((rows[10].ram_b, rows[10].pass), (Some(108_072), Some(10)));
        assert!(parse("row raim/ls 8 x - 1 1 1 - 0\nend").is_err());
        assert!(parse("row raim/ls 8\nend").is_err());
        assert!(parse("panicked\nend").is_err());
        let cut = parse("row raim/ls 8 4 - 1 1 1 - 0\n").unwrap_err();
        assert!(cut.what.contains("did not come to its end"), "{cut}");
    }

    #[test]
    fn the_bank_is_held_to_its_worst_epoch_and_its_bytes() {
        let mut rows = parse(PRINTED).unwrap();
        rows[3].instr_worst = Some(54_000);
        assert!(judge(&rows).is_ok());
        for (change, said) in [
            (
                (|row| row.instr_worst = Some(950_001)) as fn(&mut Row),
                "takes 950001",
            ),
            (|row| row.stack_b = Some(16_385), "stack 16385 bytes"),
            (|row| row.ram_b = None, "RAM unknown"),
            (|row| row.ram_b = Some(79 * 1360 * 104 / 100), "RAM 111737"),
            (
                |row| {
                    row.stage = "bank/update".to_owned();
                    row.text_b = Some(16_385);
                },
                "code 16385",
            ),
        ] {
            let mut changed = rows.clone();
            change(&mut changed[10]);
            let failure = judge(&changed).unwrap_err();
            assert!(failure.what.contains(said), "{failure}");
        }
    }

    #[test]
    fn growth_is_the_power_of_the_number_of_satellites() {
        let square = [(6.0, 72.0), (12.0, 288.0), (24.0, 1152.0)];
        assert!((exponent(&square).unwrap() - 2.0).abs() < 1e-12);
        assert_eq!(exponent(&square[..1]), None);
        let text = table(&parse(PRINTED).unwrap());
        assert!(
            text.contains("N = 24: 301 filters, 3500000 instructions"),
            "{text}"
        );
        assert!(text.contains("of 18 states +12.1 %"), "{text}");
        assert!(text.contains("grows as N^1.94"), "{text}");
    }

    #[test]
    fn one_instruction_above_a_bar_fails_and_so_does_a_missing_figure() {
        let mut rows = parse(PRINTED).unwrap();
        let failure = judge(&rows).unwrap_err();
        assert!(
            failure.what.contains("24 satellites takes 54001"),
            "{failure}"
        );
        rows[3].instr_worst = Some(54_000);
        assert!(judge(&rows).is_ok());
        rows.remove(1);
        assert!(judge(&rows).unwrap_err().what.contains("not measured"));
        rows[8].n_states = Some(18);
        let failure = judge(&rows).unwrap_err();
        assert!(
            failure
                .what
                .contains("17 states with 12 satellites was not"),
            "{failure}"
        );
    }

    #[test]
    fn the_ratio_is_that_of_the_same_sky() {
        let text = table(&parse(PRINTED).unwrap());
        let line = text.lines().find(|line| line.starts_with("N = ")).unwrap();
        assert!(
            line.starts_with("N =  8: least squares / parity = - for"),
            "{line}"
        );
        assert!(line.contains("2.00 when"), "{line}");
        assert!(!text.contains("N = 12: least"));
    }

    #[test]
    fn json_has_null_for_what_does_not_apply_and_escapes_text() {
        let text = json("rustc \"x\"\\", &parse(PRINTED).unwrap());
        assert!(
            text.starts_with("{\"rustc\":\"rustc \\\"x\\\"\\\\\",\"rows\":["),
            "{text}"
        );
        assert!(
            text.contains("\"stage\":\"raim/ls\",\"n_sats\":8,\"n_states\":4,\"filters\":null")
        );
        assert!(text.contains("\"stack_b\":900,\"ram_b\":null"));
    }

    #[test]
    fn options_are_read_in_any_order() {
        let options = Options::parse(&["--check", "--json", "out.json"]).unwrap();
        assert_eq!((options.json, options.check), (Some("out.json"), true));
        assert_eq!(Options::parse(&["--json"]), None);
        assert_eq!(Options::parse(&["--fast"]), None);
    }
}
