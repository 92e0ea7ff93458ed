//! `surefix mutate`: damaged streams through core's decoders, counted; nothing may be invented.
//!
//! ```text
//! recording ─► a window of it ─► damage ─► core's Ingest, in one piece and in chunks
//!      └─► what it holds undamaged ──────────┴─► every observation and ephemeris is one of these
//! ```
//!
//! | damage | what it stands for |
//! |---|---|
//! | flipped bits, overwritten, lost, inserted bytes | the line |
//! | parts twice, in another order, cut off | buffers, a cable pulled out |
//! | heads of frames inserted, lengths changed | what looks like a frame and is none |
//! | content changed and the checksum made right again | a sender that errs: the decoders' own checks |
//!
//! What is expected comes from the undamaged file. A sum of 16 bits lets one damage in 65,536 pass, and a
//! repaired one always; so RXM-RAWX of the damaged bytes whose sum is right is also read by the `ublox`
//! crate, found by trying every byte, and what it reads counts as sent. Streams with repaired checksums
//! of other messages are held to less: legal numbers, and the same whatever the chunks.

mod damage;
mod expected;

use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use indicatif::{ProgressBar, ProgressStyle};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use surefix_core::ingest::{Event, Ingest};
use surefix_core::wire::Counters;

pub use damage::{Damage, below};
pub use expected::{Known, Sent};

/// Longest part of a recording that is damaged at a time, bytes.
const WINDOW_BYTES: usize = 60_000;

/// Damaged streams through the decoders of core: nothing may be invented, and nothing may panic
#[derive(Clone, Debug, clap::Args)]
pub struct Args {
    /// Recordings of UBX, RTCM 3 or both, also .gz
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    /// How long to go on, s
    #[arg(long, default_value_t = 600.0, conflicts_with = "cases")]
    pub seconds: f64,
    /// How many damaged streams instead
    #[arg(long)]
    pub cases: Option<u64>,
    /// Seed of the damage
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// What a run of damaged streams came to.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Damaged streams.
    pub cases: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Observations that came out.
    pub observations: u64,
    /// Ephemerides that came out.
    pub ephemerides: u64,
    /// Frames refused, messages refused and lost, by counter.
    pub lost: std::collections::BTreeMap<String, u64>,
}

/// A recording to damage.
pub struct Subject {
    /// Its name.
    pub name: String,
    bytes: Vec<u8>,
    known: Known,
    /// Its sender gives GPST where BDT belongs. Beside other messages of an epoch that is noticed and its BDS
    /// is dropped; where damage has taken these away it cannot be, and BDS comes out 14 s off.
    bds_time_is_wrong: bool,
}

impl Subject {
    /// Reads what the undamaged bytes hold.
    pub fn new(name: impl Into<String>, bytes: Vec<u8>) -> Self {
        let mut known = Known::of(&bytes);
        // MSM beside RXM-RAWX gives no epochs; where damage has taken every RXM-RAWX away it does.
        let mut without_rawx = bytes.clone();
        for start in 0..bytes.len() {
            if bytes[start..].starts_with(&[0xB5, 0x62, 0x02, 0x15]) {
                without_rawx[start] = 0;
            }
        }
        known.extend(Known::of(&without_rawx));
        let bds_time_is_wrong = decode(&bytes, &[bytes.len()])
            .is_ok_and(|decoded| decoded.counters.bds_time_contradicted > 0);
        Self {
            name: name.into(),
            bytes,
            known,
            bds_time_is_wrong,
        }
    }

    /// What it holds.
    pub const fn known(&self) -> &Known {
        &self.known
    }
}

/// Everything the decoders make of a stream.
#[derive(Clone, Debug, PartialEq)]
pub struct Decoded {
    /// In the order they came.
    pub sent: Vec<Sent>,
    /// Of the whole stream.
    pub counters: Counters,
}

/// Runs a stream through core in chunks of the sizes given, the last one over and over.
///
/// # Errors
/// When core does not use all bytes or does not come to an end.
pub fn decode(stream: &[u8], chunks: &[usize]) -> Result<Decoded> {
    let mut ingest = Box::new(Ingest::EMPTY);
    let mut sent = Vec::new();
    let mut sizes = chunks.iter().copied().cycle();
    let mut rest = stream;
    while !rest.is_empty() {
        let size = sizes.next().unwrap_or(rest.len()).clamp(1, rest.len());
        let (mut chunk, later) = rest.split_at(size);
        rest = later;
        loop {
            let (used, event) = ingest.push(chunk);
            chunk = chunk
                .get(used..)
                .context("core used more bytes than it got")?;
            if event == Event::Nothing {
                if !chunk.is_empty() {
                    bail!("core left {} bytes unused", chunk.len());
                }
                break;
            }
            expected::note(&event, &ingest, &mut sent);
        }
    }
    // An epoch that waits, and no more.
    for _ in 0..100 {
        let event = ingest.finish();
        if event == Event::EndOfStream {
            return Ok(Decoded {
                sent,
                counters: *ingest.counters(),
            });
        }
        expected::note(&event, &ingest, &mut sent);
    }
    bail!("core did not come to an end")
}

/// Damages a window of the subject once and holds what comes out against what was sent.
///
/// # Errors
/// Whatever was invented, in words.
pub fn case(subject: &Subject, random: &mut ChaCha8Rng, tally: &mut Tally) -> Result<()> {
    let longest = WINDOW_BYTES.min(subject.bytes.len());
    let length = 1 + below(random, longest);
    let start = below(random, subject.bytes.len() - length + 1);
    let mut stream = subject.bytes[start..start + length].to_vec();
    let mut repaired = false;
    for _ in 0..=below(random, 8) {
        let damage = Damage::draw(random);
        repaired |= damage.repairs_checksums();
        damage.apply(&mut stream, random);
    }
    let whole = decode(&stream, &[stream.len()])?;
    let chunks: Vec<usize> = (0..7).map(|_| 1 + below(random, 2500)).collect();
    if decode(&stream, &chunks)? != whole {
        bail!("chunks of {chunks:?} bytes give something else than the whole");
    }
    let in_damaged = Known::of_frames_with_a_right_sum(&stream);
    for sent in &whole.sent {
        sent.check_legal()?;
        let is_known = subject.known.contains(sent) || in_damaged.contains(sent);
        let is_undecidable = subject.bds_time_is_wrong && sent.is_of_bds();
        if !is_known && !repaired && !is_undecidable {
            bail!("invented: {sent:?}");
        }
        if !is_known && sent.is_of_rawx(&whole.counters) {
            bail!("read from RXM-RAWX otherwise than the ublox crate reads it: {sent:?}");
        }
        match sent {
            Sent::Observation { .. } => tally.observations += 1,
            Sent::Ephemeris { .. } => tally.ephemerides += 1,
        }
    }
    for (name, count) in crate::source::losses(&whole.counters) {
        *tally.lost.entry(name).or_default() += count;
    }
    tally.cases += 1;
    tally.bytes += stream.len() as u64;
    Ok(())
}

/// Runs `surefix mutate`.
///
/// # Errors
/// When a file is unusable, or something was invented: the message gives the seed of the case.
pub fn run(args: &Args) -> Result<()> {
    let mut subjects = Vec::new();
    for path in &args.files {
        let bytes = crate::rinex::read_unzipped(path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        if bytes.is_empty() {
            bail!("{} is empty: give a recording", path.display());
        }
        subjects.push(Subject::new(path.display().to_string(), bytes));
    }
    let bar = ProgressBar::new(args.cases.unwrap_or(args.seconds as u64));
    bar.set_style(ProgressStyle::with_template("{bar:40} {msg}, {eta} left")?);
    let started = Instant::now();
    let length = Duration::try_from_secs_f64(args.seconds).context("--seconds")?;
    let mut tally = Tally::default();
    loop {
        let done = match args.cases {
            Some(cases) => tally.cases >= cases,
            None => started.elapsed() >= length,
        };
        if done {
            break;
        }
        let seed = args.seed.wrapping_add(tally.cases);
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let subject = &subjects[below(&mut random, subjects.len())];
        case(subject, &mut random, &mut tally).with_context(|| {
            format!(
                "{}: run again with --seed {seed} --cases 1 and the same files",
                subject.name
            )
        })?;
        bar.set_position(
            args.cases
                .map_or(started.elapsed().as_secs(), |_| tally.cases),
        );
        bar.set_message(format!("{} streams", tally.cases));
    }
    bar.finish_and_clear();
    println!(
        "{} damaged streams, {:.1} MB: {} observations and {} ephemerides came out, none invented; no panic",
        tally.cases,
        tally.bytes as f64 / 1e6,
        tally.observations,
        tally.ephemerides
    );
    for (name, count) in &tally.lost {
        println!("  {name} {count}");
    }
    Ok(())
}
