//! What the picture of the bank draws: each filter's statistic over its threshold, by time.
//!
//! A run of many epochs goes in bins of as many as it takes for at most [`BINS`]; a bin holds the largest
//! ratio of its epochs, as an alert needs one test that fails. Ratios go as thousandths in base64 of
//! little-endian u16, so that no ratio above 1 is rounded to it.

use serde_json::{Value, json};

use super::data::base64;
use super::table::Table;

/// Most bins of a run.
pub const BINS: usize = 8192;

/// Nothing to test.
const NOTHING: u16 = u16::MAX;
/// Ratios of 65 and more, and tests whose numbers are not finite.
const LARGEST: u16 = 65_000;

/// A ratio in thousandths.
fn thousandths(ratio: f32) -> u16 {
    let exact = f64::from(ratio) * 1000.0;
    let rounded = if ratio > 1.0 {
        exact.round().max(1001.0)
    } else {
        exact.round()
    };
    // NaN was left out before; casting saturates.
    (rounded as u16).min(LARGEST)
}

/// For each satellite that was ever in the bank, the bins in which it was and its ratios there; `null`
/// without a bank.
pub fn pack(table: &Table) -> Value {
    let rows = &table.rows;
    if table.tested.is_empty() {
        return Value::Null;
    }
    let epochs_per_bin = rows.len().div_ceil(BINS).max(1);
    let bins = rows.len().div_ceil(epochs_per_bin);
    // [satellite][bin]: whether it is in the bank, and its ratios.
    let mut found = vec![vec![(false, [NOTHING; 2]); bins]; table.tested.len()];
    for (k, row) in rows.iter().enumerate() {
        for test in &row.tests {
            let (is_there, largest) = &mut found[usize::from(test.satellite)][k / epochs_per_bin];
            *is_there = true;
            for (largest, ratio) in largest.iter_mut().zip(test.ratio) {
                if !ratio.is_nan() {
                    let ratio = thousandths(ratio);
                    *largest = if *largest == NOTHING {
                        ratio
                    } else {
                        ratio.max(*largest)
                    };
                }
            }
        }
    }
    let satellites: Vec<Value> = table
        .tested
        .iter()
        .zip(&found)
        .map(|(name, bins)| {
            let mut ranges: Vec<[usize; 2]> = Vec::new();
            let mut bytes = [Vec::new(), Vec::new()];
            for (k, (is_there, ratio)) in bins.iter().enumerate() {
                if !is_there {
                    continue;
                }
                match ranges.last_mut() {
                    Some([_, end]) if *end == k => *end += 1,
                    _ => ranges.push([k, k + 1]),
                }
                for (bytes, ratio) in bytes.iter_mut().zip(ratio) {
                    bytes.extend(ratio.to_le_bytes());
                }
            }
            let [h, v] = bytes.map(|bytes| base64(&bytes));
            json!({ "id": name, "in": ranges, "h": h, "v": v })
        })
        .collect();
    json!({ "bins": bins, "each": epochs_per_bin, "sats": satellites })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_test_is_never_rounded_to_the_threshold() {
        assert_eq!(thousandths(1.0), 1000);
        assert_eq!(thousandths(1.000_001), 1001);
        assert_eq!(thousandths(0.999_999), 1000);
        assert_eq!(thousandths(0.5), 500);
        assert_eq!(thousandths(1e9), LARGEST);
        assert_eq!(thousandths(f32::INFINITY), LARGEST);
    }
}
