//! The data the pictures draw: every epoch, packed small enough for a day at 1 Hz in one file.
//!
//! A column goes as runs `{"r":[[count,value],…]}` when it seldom changes, otherwise as base64 of
//! little-endian f32 `{"f":"…"}`; no value is NaN in either. Times go as `{"u":[first,step]}` when
//! they are evenly spaced, otherwise as base64 of f64 `{"d":"…"}`. Satellites go as index ranges.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde_json::{Value, json};
use surefix_core::frames::geodesy;

use super::bank;
use super::satellites::Satellites;
use super::stanford::Diagram;
use super::table::{Row, Table};

/// Standard base64 with padding. [RFC-4648] section 4.
pub fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let at = |k: usize| u32::from(chunk.get(k).copied().unwrap_or(0));
        let word = at(0) << 16 | at(1) << 8 | at(2);
        for k in 0..4 {
            let sextet = (word >> (18 - 6 * k)) as usize & 63;
            text.push(if k <= chunk.len() {
                char::from(ALPHABET[sextet])
            } else {
                '='
            });
        }
    }
    text
}

/// Runs of equal values.
fn runs<T: PartialEq + Clone>(values: impl Iterator<Item = T>) -> Vec<(usize, T)> {
    let mut runs: Vec<(usize, T)> = Vec::new();
    for value in values {
        match runs.last_mut() {
            Some((count, last)) if *last == value => *count += 1,
            _ => runs.push((1, value)),
        }
    }
    runs
}

fn column(values: impl Iterator<Item = Option<f64>> + Clone) -> Value {
    let runs = runs(values.clone());
    let count: usize = runs.iter().map(|(count, _)| count).sum();
    // A run takes about twelve characters, a packed value a little over five.
    if runs.len() * 12 < count * 5 {
        json!({ "r": runs })
    } else {
        let bytes: Vec<u8> = values
            .flat_map(|value| (value.unwrap_or(f64::NAN) as f32).to_le_bytes())
            .collect();
        json!({ "f": base64(&bytes) })
    }
}

fn times(rows: &[Row]) -> Value {
    let first = rows[0].t_s;
    let step = match rows {
        [a, b, ..] => b.t_s - a.t_s,
        _ => 1.0,
    };
    let even = rows
        .iter()
        .enumerate()
        .all(|(k, row)| (row.t_s - (first + step * k as f64)).abs() < 1e-6);
    if even {
        json!({ "u": [first, step] })
    } else {
        let bytes: Vec<u8> = rows.iter().flat_map(|row| row.t_s.to_le_bytes()).collect();
        json!({ "d": base64(&bytes) })
    }
}

/// Names in the order of their first appearance, and each row's index among them.
fn names(rows: &[Row], name: impl Fn(&Row) -> &str) -> (Vec<String>, Vec<Option<f64>>) {
    let mut known: Vec<String> = Vec::new();
    let indices = rows
        .iter()
        .map(|row| {
            let name = name(row);
            let index = known.iter().position(|k| k == name).unwrap_or_else(|| {
                known.push(name.to_owned());
                known.len() - 1
            });
            Some(index as f64)
        })
        .collect();
    (known, indices)
}

/// Sorts satellites as the pictures list them: G, E, C, then others, each by number.
pub fn order(name: &str) -> (usize, String) {
    let letter = name.chars().next().unwrap_or('-');
    ("GEC".find(letter).unwrap_or(3), name.to_owned())
}

/// Index ranges `[first, end)` in which a satellite is in a set.
pub type Ranges = Vec<[usize; 2]>;

/// Per satellite, in the order G, E, C and number: ranges used and ranges excluded.
pub fn satellite_ranges(rows: &[Row]) -> Vec<(String, Ranges, Ranges)> {
    fn extend(ranges: &mut Ranges, index: usize) {
        match ranges.last_mut() {
            Some([_, end]) if *end == index => *end += 1,
            _ => ranges.push([index, index + 1]),
        }
    }
    let mut by_name: BTreeMap<(usize, String), (Ranges, Ranges)> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate() {
        for name in &row.used {
            extend(&mut by_name.entry(order(name)).or_default().0, index);
        }
        for name in &row.excluded {
            extend(&mut by_name.entry(order(name)).or_default().1, index);
        }
    }
    by_name
        .into_iter()
        .map(|((_, name), (used, excluded))| (name, used, excluded))
        .collect()
}

/// The track on a local grid: east and north of the first position in the plane that touches the ellipsoid
/// there, height above the ellipsoid, m; `null` without a position.
fn track(rows: &[Row]) -> Value {
    let Some((origin_m, [lat_deg, lon_deg, _])) =
        rows.iter().find_map(|row| row.r_e_m.zip(row.llh))
    else {
        return Value::Null;
    };
    let c_enu_e = geodesy::c_enu_e(lat_deg.to_radians(), lon_deg.to_radians());
    let enu_m: Vec<Option<Vector3<f64>>> = rows
        .iter()
        .map(|row| Some(c_enu_e * (Vector3::from(row.r_e_m?) - Vector3::from(origin_m))))
        .collect();
    json!({
        "lat": lat_deg,
        "lon": lon_deg,
        "e": column(enu_m.iter().map(|enu| enu.map(|enu| enu.x))),
        "n": column(enu_m.iter().map(|enu| enu.map(|enu| enu.y))),
        "h": column(rows.iter().map(|row| row.llh.map(|[_, _, h_m]| h_m))),
    })
}

/// Horizontal and vertical.
fn stanford(rows: &[Row]) -> [Value; 2] {
    [
        Diagram::new(rows, Row::horizontal_error_m, |r| r.hpl_m, |r| r.hal_m).pack(),
        Diagram::new(rows, Row::vertical_error_m, |r| r.vpl_m, |r| r.val_m).pack(),
    ]
}

/// The object the page's script reads.
pub fn pack(table: &Table) -> Value {
    let rows = &table.rows;
    let number = |get: fn(&Row) -> Option<f64>| column(rows.iter().map(get));
    let (states, state) = names(rows, |row| &row.integrity);
    let (reasons, reason) = names(rows, |row| &row.reason);
    let (opinions, opinion) = names(rows, |row| &row.opinions);
    let satellites: Vec<Value> = satellite_ranges(rows)
        .into_iter()
        .map(|(name, used, excluded)| json!({ "id": name, "used": used, "out": excluded }))
        .collect();
    json!({
        "n": rows.len(),
        "t": times(rows),
        "week": number(|r| r.week),
        "tow0": rows[0].tow_s,
        "states": states,
        "state": column(state.into_iter()),
        "reasons": reasons,
        "reason": column(reason.into_iter()),
        "opinions": opinions,
        "opinion": column(opinion.into_iter()),
        "hpl": number(|r| r.hpl_m),
        "vpl": number(|r| r.vpl_m),
        "hal": number(|r| r.hal_m),
        "val": number(|r| r.val_m),
        "stat": number(|r| r.stat),
        "thr": number(|r| r.threshold),
        "nsat": number(|r| r.n_sats),
        "nvis": number(|r| r.n_visible),
        "e": number(|r| r.error_enu_m.map(|e| e[0])),
        "nn": number(|r| r.error_enu_m.map(|e| e[1])),
        "u": number(|r| r.error_enu_m.map(|e| e[2])),
        "uh": number(|r| r.uncertainty_m[0]),
        "uv": number(|r| r.uncertainty_m[1]),
        "nbank": number(|r| r.n_bank),
        "bank": bank::pack(table),
        "track": track(rows),
        "skies": table.satellites.as_ref().map(Satellites::pack),
        "stanford": table.has_errors.then(|| stanford(rows)),
        "truth": table.has_errors,
        "hasUsed": table.has_used,
        "sats": satellites,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_is_that_of_the_standard() {
        // [RFC-4648] section 10.
        for (plain, coded) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
    }

    #[test]
    fn a_column_that_seldom_changes_goes_as_runs() {
        let flat = column((0..100).map(|k| (k < 60).then_some(40.0)));
        assert_eq!(flat, json!({ "r": [[60, 40.0], [40, null]] }));
        let moving = column((0..100).map(|k| Some(f64::from(k))));
        assert!(moving["f"].as_str().unwrap().len() == 400_usize.div_ceil(3) * 4);
    }
}
