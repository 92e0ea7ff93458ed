//! What the pictures of the satellites draw, read from `satellites.csv`: directions, residuals, C/N0.
//!
//! A run of many epochs goes in bins of as many as it takes for at most [`BINS`]: a bin holds the first
//! direction and the smallest and the largest residual and C/N0 of its epochs. Directions go as twentieths of a
//! degree, residuals in steps of their satellite's largest, C/N0 as quarters of a dB-Hz, in base64 of
//! little-endian integers.

use std::collections::{BTreeMap, HashMap};
use std::io::BufRead;

use anyhow::{Result, bail};
use serde_json::{Value, json};

use super::data::{base64, order};
use super::table::{Csv, Row, time_key};

/// Most bins of a run: a day at 30 s has every epoch in one of its own.
const BINS: usize = 3000;

/// Smallest and largest of a bin's values.
type Range = Option<[f64; 2]>;

/// One satellite in one bin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Bin {
    is_there: bool,
    /// Azimuth and elevation, degrees.
    direction_deg: Option<[f64; 2]>,
    residual_m: Range,
    cn0_dbhz: Range,
}

/// Every satellite of a run, in bins of its epochs.
#[derive(Clone, Debug, PartialEq)]
pub struct Satellites {
    epochs_per_bin: usize,
    bins: usize,
    by_name: BTreeMap<(usize, String), Vec<Bin>>,
}

fn widen(range: &mut Range, value: Option<f64>) {
    if let Some(value) = value {
        let [low, high] = range.unwrap_or([value; 2]);
        *range = Some([low.min(value), high.max(value)]);
    }
}

impl Satellites {
    /// Reads `satellites.csv` of a run with these epochs.
    ///
    /// # Errors
    /// When it is not of the form surefix writes, or has a row of an epoch that the run has not.
    pub fn read(from: impl BufRead, rows: &[Row]) -> Result<Self> {
        let epochs_per_bin = rows.len().div_ceil(BINS).max(1);
        let bins = rows.len().div_ceil(epochs_per_bin);
        let epochs: HashMap<i64, usize> =
            rows.iter().map(|row| time_key(row.t_s)).zip(0..).collect();
        let mut by_name: BTreeMap<(usize, String), Vec<Bin>> = BTreeMap::new();
        let required = [
            "t_s",
            "satellite",
            "azimuth_deg",
            "elevation_deg",
            "residual_m",
            "cn0_dbhz",
        ];
        Csv::read(from, &required, &mut |line| {
            let epoch = line
                .number("t_s")?
                .and_then(|t_s| epochs.get(&time_key(t_s)));
            let Some(epoch) = epoch else {
                bail!("line {}: epochs.csv has no epoch of this time", line.number);
            };
            let key = order(line.text("satellite"));
            let of_satellite = by_name
                .entry(key)
                .or_insert_with(|| vec![Bin::default(); bins]);
            let bin = &mut of_satellite[epoch / epochs_per_bin];
            bin.is_there = true;
            let direction = line
                .number("azimuth_deg")?
                .zip(line.number("elevation_deg")?);
            bin.direction_deg = bin.direction_deg.or(direction.map(|(az, el)| [az, el]));
            widen(&mut bin.residual_m, line.number("residual_m")?);
            widen(&mut bin.cn0_dbhz, line.number("cn0_dbhz")?);
            Ok(())
        })?;
        Ok(Self {
            epochs_per_bin,
            bins,
            by_name,
        })
    }

    /// The object the page's script reads.
    pub fn pack(&self) -> Value {
        let satellites: Vec<Value> = self
            .by_name
            .iter()
            .map(|((_, name), bins)| self.pack_one(name, bins))
            .collect();
        json!({ "bins": self.bins, "each": self.epochs_per_bin, "sats": satellites })
    }

    fn pack_one(&self, name: &str, bins: &[Bin]) -> Value {
        let mut ranges: Vec<[usize; 2]> = Vec::new();
        for (k, _) in bins.iter().enumerate().filter(|(_, bin)| bin.is_there) {
            match ranges.last_mut() {
                Some([_, end]) if *end == k => *end += 1,
                _ => ranges.push([k, k + 1]),
            }
        }
        let there = || bins.iter().filter(|bin| bin.is_there);
        let largest_m = there()
            .filter_map(|bin| bin.residual_m)
            .flatten()
            .fold(0.0, |largest: f64, residual_m| {
                largest.max(residual_m.abs())
            });
        // A step is a millimetre at least, which is what the file has.
        let step_m = (largest_m / f64::from(i16::MAX)).max(0.001);
        let steps = |residual_m: f64| (residual_m / step_m).round() as i16;
        let direction = |at: usize, scale: f64| {
            let halves = |bin: &Bin| {
                bin.direction_deg
                    .map_or(i16::MIN, |deg| (deg[at] * scale).round() as i16)
            };
            base64(
                &there()
                    .flat_map(|bin| halves(bin).to_le_bytes())
                    .collect::<Vec<u8>>(),
            )
        };
        let residual = |at: usize| {
            let packed = |bin: &Bin| bin.residual_m.map_or(i16::MIN, |range| steps(range[at]));
            base64(
                &there()
                    .flat_map(|bin| packed(bin).to_le_bytes())
                    .collect::<Vec<u8>>(),
            )
        };
        let cn0 = |at: usize| {
            let quarters = |range: [f64; 2]| ((range[at] * 4.0).round() as u8).min(u8::MAX - 1);
            let packed = |bin: &Bin| bin.cn0_dbhz.map_or(u8::MAX, quarters);
            base64(&there().map(packed).collect::<Vec<u8>>())
        };
        let mut object = json!({
            "id": name,
            "in": ranges,
            // A turn is 7200 of them.
            "az": direction(0, DIRECTION_SCALE),
            "el": direction(1, DIRECTION_SCALE),
            "step": step_m,
            "lo": residual(0),
            "c": cn0(0),
        });
        if self.epochs_per_bin > 1 {
            object["hi"] = json!(residual(1));
            object["d"] = json!(cn0(1));
        }
        object
    }
}

/// Steps of a direction per degree.
const DIRECTION_SCALE: f64 = 20.0;

#[cfg(test)]
mod tests {
    use super::super::table::tests::rows;
    use super::*;

    const HEADER: &str = "t_s,satellite,use,azimuth_deg,elevation_deg,residual_m,cn0_dbhz\n";

    #[test]
    fn satellites_are_packed_with_their_gaps() {
        let text = format!(
            "{HEADER}0,G05,used,359.95,45,-1.5,44.25\n0,C03,below_mask,10,5,,\n2,G05,no_ephemeris,,,,40\n"
        );
        let satellites = Satellites::read(text.as_bytes(), &rows(3)).unwrap();
        let packed = satellites.pack();
        assert_eq!((&packed["bins"], &packed["each"]), (&json!(3), &json!(1)));
        let [gps, bds] = &packed["sats"].as_array().unwrap()[..] else {
            panic!("{packed}");
        };
        assert_eq!((&gps["id"], &bds["id"]), (&json!("G05"), &json!("C03")));
        assert_eq!(gps["in"], json!([[0, 1], [2, 3]]));
        let i16s = |values: [i16; 2]| base64(&values.map(i16::to_le_bytes).concat());
        assert_eq!(gps["az"], json!(i16s([7199, i16::MIN])));
        assert_eq!(gps["el"], json!(i16s([900, i16::MIN])));
        assert_eq!(gps["lo"], json!(i16s([-1500, i16::MIN])));
        assert_eq!(gps["c"], json!(base64(&[177, 160])));
        assert_eq!(bds["c"], json!(base64(&[255])));
        assert!(gps.get("hi").is_none());
    }

    #[test]
    fn a_bin_holds_the_smallest_and_the_largest_of_its_epochs() {
        let mut text = HEADER.to_owned();
        for k in 0..=BINS {
            let residual_m = if k % 2 == 0 { 40.0 } else { -2.0 };
            text += &format!("{k},E11,used,{},80,{residual_m},{}\n", k % 2, 40 + k % 2);
        }
        let satellites = Satellites::read(text.as_bytes(), &rows(BINS + 1)).unwrap();
        let bins = &satellites.by_name[&order("E11")];
        assert_eq!(bins.len(), BINS / 2 + 1);
        assert_eq!(bins[0].residual_m, Some([-2.0, 40.0]));
        assert_eq!(bins[0].cn0_dbhz, Some([40.0, 41.0]));
        assert_eq!(bins[0].direction_deg, Some([0.0, 80.0]));
        assert!(satellites.pack()["sats"][0].get("hi").is_some());
    }

    #[test]
    fn a_row_of_no_epoch_is_refused_with_its_place() {
        let text = format!("{HEADER}7,G05,used,1,2,3,4\n");
        let message = Satellites::read(text.as_bytes(), &rows(3))
            .unwrap_err()
            .to_string();
        assert!(message.contains("line 2"), "{message}");
    }
}
