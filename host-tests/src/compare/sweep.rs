//! Faults of rising size, on satellites in turn or drawn at random.

use std::str::FromStr;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

use super::subject::Epoch;
use crate::simulate::noise::uniform;

/// Most sizes of a sweep.
const MAX_SIZES: usize = 1000;

/// `FROM:STEP:TO`, m.
#[derive(Clone, Debug, PartialEq)]
pub struct Sizes(pub Vec<f64>);

/// Why it is refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("\"{text}\": {cause}; the form is FROM:STEP:TO in metres, for example 0:5:100")]
pub struct SizesError {
    text: String,
    cause: String,
}

impl FromStr for Sizes {
    type Err = SizesError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let refuse = |cause: &str| SizesError {
            text: text.to_owned(),
            cause: cause.to_owned(),
        };
        let numbers: Option<Vec<f64>> = text.split(':').map(|part| part.parse().ok()).collect();
        let Some([from, step, to]) = numbers.as_deref() else {
            return Err(refuse("not three numbers"));
        };
        // Written so that NaN is refused.
        if !(*from >= 0.0 && *step > 0.0 && to >= from && to.is_finite()) {
            return Err(refuse("a sweep goes upwards from 0 or more"));
        }
        let steps = ((to - from) / step + 1e-9).floor() as usize;
        if steps >= MAX_SIZES {
            return Err(refuse("more than 1000 sizes"));
        }
        Ok(Self((0..=steps).map(|k| from + step * k as f64).collect()))
    }
}

/// One trial: an epoch, and the rows that get a fault, with its sign.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Number of the epoch.
    pub epoch: usize,
    /// Rows and signs.
    pub rows: Vec<(usize, f64)>,
}

/// The trials of a sweep, the same for every size and monitor: `faults` satellites and their signs drawn at random
/// at an epoch drawn at random. Epochs with fewer satellites are not taken.
pub fn drawn(epochs: &[Epoch], faults: usize, trials: u64, seed: u64) -> Vec<Trial> {
    let enough: Vec<usize> = (0..epochs.len())
        .filter(|k| epochs[*k].linearised.rows.len() >= faults)
        .collect();
    if enough.is_empty() {
        return Vec::new();
    }
    (0..trials)
        .map(|trial| {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            random.set_stream(trial);
            let epoch = enough[(random.next_u64() % enough.len() as u64) as usize];
            let mut left: Vec<usize> = (0..epochs[epoch].linearised.rows.len()).collect();
            let rows = (0..faults)
                .map(|_| {
                    let row = left.swap_remove((random.next_u64() % left.len() as u64) as usize);
                    let sign = if uniform(&mut random) < 0.5 {
                        -1.0
                    } else {
                        1.0
                    };
                    (row, sign)
                })
                .collect();
            Trial { epoch, rows }
        })
        .collect()
}

/// One fault on every satellite in turn, at so many epochs evenly over the recording; of alternating sign.
pub fn in_turn(epochs: &[Epoch], at: u64) -> Vec<Trial> {
    let count = (at as usize).clamp(1, epochs.len().max(1));
    (0..count)
        .map(|k| k * epochs.len() / count)
        .flat_map(|epoch| {
            let rows = epochs.get(epoch).map_or(0, |e| e.linearised.rows.len());
            (0..rows).map(move |row| Trial {
                epoch,
                rows: vec![(row, if row.is_multiple_of(2) { 1.0 } else { -1.0 })],
            })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sweep_is_read_with_its_last_size() {
        let sizes = |text: &str| text.parse::<Sizes>().map(|sizes| sizes.0);
        assert_eq!(sizes("0:5:20"), Ok(vec![0.0, 5.0, 10.0, 15.0, 20.0]));
        assert_eq!(sizes("0:0.1:0.3").unwrap().len(), 4);
        assert_eq!(sizes("60:1:60"), Ok(vec![60.0]));
        for text in [
            "", "0:5", "0:0:9", "5:1:0", "-5:1:5", "0:1:nan", "0:1:inf", "0:1e-9:1", "a:b:c",
        ] {
            let message = sizes(text).unwrap_err().to_string();
            assert!(message.contains("0:5:100"), "{message}");
        }
    }
}
