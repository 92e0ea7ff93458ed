//! Compact RINEX (Hatanaka) version 3 back to plain RINEX.
//!
//! | symbol | code | meaning |
//! |---|---|---|
//! | m | `Arc::order` | order of the differences of one observable of one satellite |
//! | Δᵏ | `Arc::differences[k]` | its k-th difference at the last epoch, in units of the last printed digit |
//!
//! A field `m&value` starts an arc; a plain field is the next difference of the highest order reached,
//! and summing downwards gives the value. Texts (the epoch line, the flags) are repaired character by
//! character: a blank keeps what was there, `&` makes a blank. [HATANAKA-2008] sections 3 and 4.

use std::collections::HashMap;
use std::fmt::Write;

use super::RinexError;
use super::fields::{columns, label};

/// Highest order of differences the format allows.
const MAX_ORDER: usize = 9;

/// Column where the satellites of an epoch line start in Compact RINEX 3.
const SATELLITE_LIST: usize = 41;

#[derive(Clone)]
struct Arc {
    order: usize,
    reached: usize,
    differences: [i64; MAX_ORDER + 1],
}

impl Arc {
    /// The value after one more field, `None` when the field is no number or the sum overflows.
    fn step(slot: &mut Option<Self>, field: &str) -> Option<i64> {
        if let Some((order, value)) = field.split_once('&') {
            let order: usize = order.parse().ok()?;
            if order > MAX_ORDER {
                return None;
            }
            let mut differences = [0; MAX_ORDER + 1];
            differences[0] = value.parse().ok()?;
            *slot = Some(Self {
                order,
                reached: 0,
                differences,
            });
            return Some(differences[0]);
        }
        let arc = slot.as_mut()?;
        arc.reached = (arc.reached + 1).min(arc.order);
        let increment: i64 = field.parse().ok()?;
        if arc.order == 0 {
            // Order 0 prints values, not differences.
            arc.differences[0] = increment;
            return Some(increment);
        }
        arc.differences[arc.reached] = increment;
        for k in (0..arc.reached).rev() {
            arc.differences[k] = arc.differences[k].checked_add(arc.differences[k + 1])?;
        }
        Some(arc.differences[0])
    }
}

#[derive(Clone, Default)]
struct SatelliteState {
    arcs: Vec<Option<Arc>>,
    flags: Vec<u8>,
}

/// Repairs `text` by the difference line `change`.
fn repair(text: &mut Vec<u8>, change: &str) {
    for (k, byte) in change.bytes().enumerate() {
        if k >= text.len() {
            text.push(b' ');
        }
        match byte {
            b' ' => {}
            b'&' => text[k] = b' ',
            other => text[k] = other,
        }
    }
}

/// The plain RINEX text of a Compact RINEX 3 text.
pub fn expand(compact: &str) -> Result<String, RinexError> {
    let broken = |line: usize, cause: &str| RinexError::Broken {
        line,
        cause: format!("Compact RINEX: {cause}"),
    };
    let mut lines = compact.lines().enumerate().map(|(k, l)| (k + 1, l));
    let (_, version_line) = lines.next().ok_or_else(|| broken(1, "empty file"))?;
    if columns(version_line, 0, 20).trim() != "3.0" {
        return Err(RinexError::Unsupported(format!(
            "Compact RINEX version {}: version 3.0, which holds RINEX 3 and 4, is read; expand the file with CRX2RNX and convert it to RINEX 3",
            columns(version_line, 0, 20).trim()
        )));
    }
    lines.next();

    let mut plain = String::with_capacity(compact.len() * 4);
    let mut observables: HashMap<u8, usize> = HashMap::new();
    for (_, line) in lines.by_ref() {
        plain.push_str(line);
        plain.push('\n');
        if label(line) == "SYS / # / OBS TYPES"
            && let (Some(system), Ok(count)) =
                (line.bytes().next(), columns(line, 3, 6).trim().parse())
            && system != b' '
        {
            observables.insert(system, count);
        }
        if label(line) == "END OF HEADER" {
            break;
        }
    }

    let mut epoch_line: Vec<u8> = Vec::new();
    let mut clock: Option<Arc> = None;
    let mut known: HashMap<[u8; 3], SatelliteState> = HashMap::new();
    while let Some((number, line)) = lines.next() {
        if line.starts_with('>') {
            epoch_line = line.bytes().collect();
            known.clear();
            clock = None;
        } else {
            repair(&mut epoch_line, line);
        }
        let text = String::from_utf8_lossy(&epoch_line).trim_end().to_owned();
        let flag = text.as_bytes().get(31).copied().unwrap_or(b'0');
        let count: usize = columns(&text, 32, 35)
            .trim()
            .parse()
            .map_err(|_| broken(number, "no number of satellites in the epoch line"))?;

        if (b'2'..=b'5').contains(&flag) {
            // An event: its records stand there as they are.
            plain.push_str(columns(&text, 0, SATELLITE_LIST).trim_end());
            plain.push('\n');
            for _ in 0..count {
                let (number, record) = lines
                    .next()
                    .ok_or_else(|| broken(number, "the file ends in an event"))?;
                if label(record) == "SYS / # / OBS TYPES"
                    && let (Some(system), Ok(count)) =
                        (record.bytes().next(), columns(record, 3, 6).trim().parse())
                    && system != b' '
                {
                    observables.insert(system, count);
                }
                if record.starts_with('>') {
                    return Err(broken(number, "an epoch starts inside an event"));
                }
                plain.push_str(record);
                plain.push('\n');
            }
            continue;
        }

        let (number, clock_field) = lines
            .next()
            .ok_or_else(|| broken(number, "the file ends after an epoch line"))?;
        plain.push_str(columns(&text, 0, 35));
        if clock_field.trim().is_empty() {
            clock = None;
        } else {
            let offset = Arc::step(&mut clock, clock_field.trim())
                .ok_or_else(|| broken(number, "the receiver clock offset is no difference"))?;
            // Printed in units of 1e-12 s.
            let _ = write!(plain, "      {:15.12}", offset as f64 * 1e-12);
        }
        plain.push('\n');

        let mut current = HashMap::with_capacity(count);
        for k in 0..count {
            let (number, data) = lines
                .next()
                .ok_or_else(|| broken(number, "the file ends inside an epoch"))?;
            let at = SATELLITE_LIST + 3 * k;
            let name: [u8; 3] = text
                .as_bytes()
                .get(at..at + 3)
                .and_then(|n| n.try_into().ok())
                .ok_or_else(|| broken(number, "fewer satellites than the epoch line announces"))?;
            let count = *observables.get(&name[0]).ok_or_else(|| {
                broken(number, "a satellite of a system the header does not list")
            })?;
            let mut state = known.remove(&name).unwrap_or_default();
            state.arcs.resize(count, None);
            expand_satellite(&mut plain, name, &mut state, data)
                .ok_or_else(|| broken(number, "a field is no difference"))?;
            current.insert(name, state);
        }
        known = current;
    }
    Ok(plain)
}

/// Writes one satellite's plain line.
fn expand_satellite(
    plain: &mut String,
    name: [u8; 3],
    state: &mut SatelliteState,
    data: &str,
) -> Option<()> {
    let mut values = Vec::with_capacity(state.arcs.len());
    let mut rest = data;
    for arc in &mut state.arcs {
        let (field, after) = rest.split_once(' ').unwrap_or((rest, ""));
        rest = after;
        if field.is_empty() {
            *arc = None;
            values.push(None);
        } else {
            values.push(Some(Arc::step(arc, field)?));
        }
    }
    repair(&mut state.flags, rest);
    state.flags.resize(2 * values.len(), b' ');

    let start = plain.len();
    plain.push_str(core::str::from_utf8(&name).ok()?);
    for (value, flags) in values.iter().zip(state.flags.chunks(2)) {
        match value {
            Some(thousandths) => {
                let sign = if *thousandths < 0 { "-" } else { "" };
                let magnitude = thousandths.unsigned_abs();
                let digits = format!("{sign}{}.{:03}", magnitude / 1000, magnitude % 1000);
                let _ = write!(plain, "{digits:>14}");
            }
            None => plain.push_str("              "),
        }
        for flag in flags {
            plain.push(char::from(*flag));
        }
    }
    plain.truncate(start + plain[start..].trim_end().len());
    plain.push('\n');
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_of_third_order_sum_up_to_the_values() {
        // Values 1000, 1010, 1030, 1065, 1120: differences 10, 10, 5, and the third stays 5.
        let mut slot = None;
        let fields = ["3&1000", "10", "10", "5", "5"];
        let values: Vec<_> = fields.iter().map(|f| Arc::step(&mut slot, f)).collect();
        assert_eq!(values, [1000, 1010, 1030, 1065, 1120].map(Some));
    }

    #[test]
    fn text_keeps_changes_and_clears() {
        let mut text = b"abc".to_vec();
        repair(&mut text, " x& y");
        assert_eq!(text, b"ax  y");
    }
}
