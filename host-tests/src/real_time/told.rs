//! What the board tells of its times on its fourth UART (firmware: worker.rs).
//!
//! Lines of a letter, a count, and that many 32-bit numbers, little endian:
//!
//! | letter | numbers |
//! |---|---|
//! | `E`, per report | bytes taken; ticks when the last one came, when work began, when the report was sent |
//! | `W`, at the end | most instructions of each stage |
//! | `S`, at the end, with sensors | edges and samples that found no room; most samples waiting; 1 if the recording is whole; pulses believed, missing, refused, begun anew; epochs that contradicted, named the second; samples timed without a pulse, without a time |
//! | `U`, at the end, per unit | its number; 1 if it runs; readings given, invalid, missed; times silent, started |
//! | `T`, at the end | deadlines missed; stack; most bytes waiting; ticks at work, low word first |

use anyhow::{Context, Result, bail};

/// Ticks of one report since the board started.
#[derive(Clone, Copy, Debug)]
pub struct Epoch {
    /// Its last byte came, or was not yet there.
    pub came: u64,
    /// Work on it began.
    pub begun: u64,
    /// Its report was sent.
    pub sent: u64,
}

/// What became of the lines and the time of samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ToldSensors {
    /// Edges that found the queue to the sampler full.
    pub edges_lost: u32,
    /// Samples and pulses that found the queue to the worker full.
    pub samples_lost: u32,
    /// Most samples that waited for the worker.
    pub most_waiting: u32,
    /// Whether all that the monitor was given was recorded.
    pub is_recorded: bool,
    /// Pulses believed.
    pub pulses: u32,
    /// Pulses that never came between two that did.
    pub pulses_missing: u32,
    /// Pulses where none can be.
    pub pulses_refused: u32,
    /// Times that pulses went on elsewhere.
    pub pulses_restarted: u32,
    /// Epochs that name another second.
    pub contradicted: u32,
    /// Times that the second was named.
    pub numbered: u32,
    /// Samples timed while pulses were missing.
    pub held_over: u32,
    /// Samples without a time: not used.
    pub without_time: u32,
}

/// What became of a unit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ToldUnit {
    /// Its number.
    pub number: u32,
    /// Whether it gives readings at the end.
    pub is_running: bool,
    /// Readings given.
    pub readings: u32,
    /// Of these, those that the part does not hold for sound.
    pub invalid: u32,
    /// Readings that nobody read.
    pub missed: u32,
    /// Times without a reading for too long.
    pub silent: u32,
    /// Starts that succeeded.
    pub starts: u32,
}

/// Everything.
#[derive(Clone, Debug, Default)]
pub struct Told {
    pub epochs: Vec<Epoch>,
    pub worst_work: Vec<u32>,
    pub deadline_misses: u32,
    pub stack_bytes: u32,
    pub most_waiting: u32,
    pub busy: u64,
    pub sensors: Option<ToldSensors>,
    pub units: Vec<ToldUnit>,
}

impl Told {
    /// Reads what a whole run left; reports come more often than the board's ticks wrap.
    pub fn read(bytes: &[u8], ticks_per_second: u64) -> Result<Self> {
        let mut told = Self::default();
        let mut is_whole = false;
        let mut now = 0;
        let mut rest = bytes;
        while let [letter, count, behind @ ..] = rest {
            let length = 4 * usize::from(*count);
            let (numbers, behind) = behind
                .split_at_checked(length)
                .context("the last line is cut off")?;
            rest = behind;
            let (numbers, _) = numbers.as_chunks::<4>();
            let numbers: Vec<u32> = numbers.iter().map(|n| u32::from_le_bytes(*n)).collect();
            match (letter, &numbers[..]) {
                (b'E', [_, came, begun, sent]) => {
                    now += u64::from(sent.wrapping_sub(now as u32));
                    let before = |ticks: u32| now - u64::from(sent.wrapping_sub(ticks));
                    told.epochs.push(Epoch {
                        came: before(*came),
                        begun: before(*begun),
                        sent: now,
                    });
                }
                (b'S', numbers) => {
                    let numbers = <[u32; 12]>::try_from(numbers);
                    let n = numbers.ok().context("a line of the sensors is cut off")?;
                    told.sensors = Some(ToldSensors {
                        edges_lost: n[0],
                        samples_lost: n[1],
                        most_waiting: n[2],
                        is_recorded: n[3] == 1,
                        pulses: n[4],
                        pulses_missing: n[5],
                        pulses_refused: n[6],
                        pulses_restarted: n[7],
                        contradicted: n[8],
                        numbered: n[9],
                        held_over: n[10],
                        without_time: n[11],
                    });
                }
                (b'U', [number, runs, readings, invalid, missed, silent, starts]) => {
                    told.units.push(ToldUnit {
                        number: *number,
                        is_running: *runs == 1,
                        readings: *readings,
                        invalid: *invalid,
                        missed: *missed,
                        silent: *silent,
                        starts: *starts,
                    });
                }
                (b'W', worst) => told.worst_work = worst.to_vec(),
                (b'T', [misses, stack, waiting, low, high]) => {
                    told.deadline_misses = *misses;
                    told.stack_bytes = *stack;
                    told.most_waiting = *waiting;
                    told.busy = u64::from(*low) | u64::from(*high) << 32;
                    is_whole = true;
                }
                _ => bail!("a line that nobody knows: {letter} {numbers:?}"),
            }
        }
        if !is_whole {
            bail!(
                "nothing was told of the end, {:.1} s after the start",
                now as f64 / ticks_per_second as f64
            );
        }
        Ok(told)
    }
}
