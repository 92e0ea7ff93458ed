//! Which satellites the bank monitors when there are more than it has places for.
//!
//! In: the rows of an epoch, the bank. Out: the rows in the order in which places are to be given, and
//! at most one satellite that is to give up its place.
//!
//! The value of a satellite is what the position of an epoch loses without it: by how much the trace of
//! its cofactor matrix grows, |u_i|²/q_i with the gain u_i and the redundancy q_i of row i in the least
//! squares of all satellites seen. One look at all satellites at once, not a search; whoever is in
//! stays in until somebody outside is worth [`SWAP_FACTOR`] times as much, so that two satellites of about
//! the same value do not take turns.

use heapless::Vec;

use super::bank::{Bank, BankRow, MAX_BANK};
use super::least_squares::{MIN_LEFT, Normals, POSITION, dot, whitened};
use crate::consts::MAX_SATELLITES;
use crate::gnss::Satellite;
use crate::time::{GpsTime, NS_PER_S};

/// By how much more than a satellite in the bank one outside must be worth to take its place.
pub const SWAP_FACTOR: f64 = 2.0;

/// How long a satellite that is missing keeps its place when others wait, ns: as long as an obstruction may
/// hide it.
const PATIENCE_NS: i64 = 60 * NS_PER_S;
/// A position gain below this is none, m²: a satellite alone on its clock.
const NO_GAIN_M2: f64 = 1.0e-12;

/// Puts rows without a place into the order of their value, behind those with one, and names the
/// satellite that has to leave for the first of them: the one missing longest, or the one worth
/// least by far; nobody unless `may_leave`.
#[inline(never)]
pub fn select<const K: usize, const M: usize>(
    bank: &Bank<K, M>,
    rows: &mut Vec<BankRow<M>, MAX_SATELLITES>,
    now: GpsTime,
    may_leave: bool,
) -> Option<Satellite> {
    let is_waiting =
        |row: &BankRow<M>| !bank.has(row.satellite) && !bank.excluded().contains(row.satellite);
    let waiting = rows.iter().filter(|row| is_waiting(row)).count();
    if bank.len() + waiting <= MAX_BANK {
        return None;
    }
    let mut values: Vec<f64, MAX_SATELLITES> = Vec::new();
    fill_values(rows, &mut values);
    // Insertion sort of a few dozen: those with a place first, then by value.
    let mut from = 1;
    while from < rows.len() {
        let mut at = from;
        while at > 0 && comes_before(bank, rows, &values, at) {
            rows.swap_checked(at);
            values.swap_checked(at);
            at -= 1;
        }
        from += 1;
    }
    if bank.len() < MAX_BANK || !may_leave {
        return None;
    }
    if let Some((held, since)) = bank.missing_longest()
        && now.ns().saturating_sub(since.ns()) >= PATIENCE_NS
    {
        return Some(held);
    }
    let of_members = |has_place: bool| {
        rows.iter().zip(&values).filter(move |(row, _)| {
            if has_place {
                bank.has(row.satellite)
            } else {
                is_waiting(row)
            }
        })
    };
    let mut worst: Option<(Satellite, f64)> = None;
    for (row, value) in of_members(true) {
        if worst.is_none_or(|(_, least)| *value < least) {
            worst = Some((row.satellite, *value));
        }
    }
    let (_, best) = of_members(false).next()?;
    let (satellite, least) = worst?;
    if !(*best > SWAP_FACTOR * least) {
        return None;
    }
    // It waits behind all others from now on.
    if let Some(from) = rows.iter().position(|row| row.satellite == satellite) {
        for at in from + 1..rows.len() {
            rows.swap_checked(at);
        }
    }
    Some(satellite)
}

/// Swaps an element with the one before it.
trait SwapChecked {
    fn swap_checked(&mut self, at: usize);
}

impl<T, const N: usize> SwapChecked for Vec<T, N> {
    fn swap_checked(&mut self, at: usize) {
        let before = at.wrapping_sub(1);
        if before < at && at < self.len() {
            self.swap(before, at);
        }
    }
}

/// Whether the row at a place has to come before the one in front of it.
fn comes_before<const K: usize, const M: usize>(
    bank: &Bank<K, M>,
    rows: &[BankRow<M>],
    values: &[f64],
    at: usize,
) -> bool {
    let key = |at: usize| {
        let (row, value) = (rows.get(at)?, values.get(at)?);
        Some((bank.has(row.satellite), *value))
    };
    match (key(at.wrapping_sub(1)), key(at)) {
        (Some((true, _)), Some(_)) | (None, _) | (_, None) => false,
        (Some((false, _)), Some((true, _))) => true,
        (Some((false, before)), Some((false, after))) => after > before,
    }
}

/// What the position would lose without each row, m²; nothing where there is no position.
fn fill_values<const M: usize>(rows: &[BankRow<M>], values: &mut Vec<f64, MAX_SATELLITES>) {
    let mut normals = Normals::ZERO;
    for design in rows.iter().filter_map(|row| whitened(&row.row)) {
        normals.add(&design);
    }
    let is_whole = normals.factor();
    values.clear();
    for row in rows {
        let value = match whitened(&row.row).filter(|_| is_whole) {
            None => 0.0,
            Some(design) => {
                let gain = normals.solve(&design);
                let moved: f64 = gain.iter().skip(POSITION).map(|part| part * part).sum();
                let left = 1.0 - dot(&design, &gain);
                if moved < NO_GAIN_M2 {
                    0.0
                } else if left > MIN_LEFT {
                    moved / left
                } else {
                    f64::INFINITY
                }
            }
        };
        // As many as there are rows.
        let _ = values.push(value);
    }
}
