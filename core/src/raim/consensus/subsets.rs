//! Every subset of so many rows, or as many of them as there is time for.
//!
//! In: rows and members. Out: the subsets one after the other, members ascending.
//!
//! | symbol | code | unit | meaning |
//! |--------|------|------|---------|
//! | C(n, s) | `total` | 1 | subsets there are |
//! | i | `index` | 1 | number of a subset in lexicographic order, from 0 |
//!
//! Source: the number of a combination [KNUTH-2]. Up to [`MAX_SUBSETS`] all are visited, in order. Of
//! more that many are, none twice, spread evenly over the order by steps of about the golden section that have
//! no divisor in common with the total: the same ones in every run. Keys: docs/references.md.

use super::MAX_MEMBERS;
use crate::consts::MAX_SATELLITES;

/// Most subsets visited: all fours of 24 rows.
pub const MAX_SUBSETS: u32 = 10_626;

/// The golden section, 2/(1 + √5).
const GOLDEN_SECTION: f64 = 0.618_033_988_749_894_9;

/// C(n, k) for every n and k that occur.
const BINOMIALS: [[u32; MAX_MEMBERS + 1]; MAX_SATELLITES + 1] = {
    let mut table = [[0_u32; MAX_MEMBERS + 1]; MAX_SATELLITES + 1];
    let mut n = 0;
    while n <= MAX_SATELLITES {
        table[n][0] = 1;
        let mut k = 1;
        while k <= MAX_MEMBERS && k <= n {
            table[n][k] = table[n - 1][k - 1] + table[n - 1][k];
            k += 1;
        }
        n += 1;
    }
    table
};

const _: () = assert!(BINOMIALS[24][4] == MAX_SUBSETS);

/// C(n, k); 0 where it is not tabulated.
fn binomial(n: usize, k: usize) -> u32 {
    let row = BINOMIALS.get(n);
    row.and_then(|row| row.get(k)).copied().unwrap_or(0)
}

/// Subsets of rows, visited once each.
pub(crate) struct Subsets {
    n: usize,
    size: usize,
    members: [usize; MAX_MEMBERS],
    total: u32,
    /// 1 while all are visited.
    step: u32,
    index: u32,
    left: u32,
}

impl Subsets {
    /// Subsets of `size` of `n` rows; none where that makes no sense.
    pub(crate) fn new(n: usize, size: usize) -> Self {
        let total = if size == 0 { 0 } else { binomial(n, size) };
        let is_whole = total <= MAX_SUBSETS;
        Self {
            n,
            size,
            members: [0; MAX_MEMBERS],
            total,
            step: if is_whole { 1 } else { step_through(total) },
            index: 0,
            left: if is_whole { total } else { MAX_SUBSETS },
        }
    }

    /// The next subset.
    #[inline]
    pub(crate) fn next(&mut self) -> Option<&[usize]> {
        if self.left == 0 {
            return None;
        }
        self.left -= 1;
        if self.step == 1 && self.index > 0 {
            self.advance();
        } else {
            self.place();
        }
        // Both are below 2³¹.
        self.index += self.step;
        if self.index >= self.total {
            self.index -= self.total;
        }
        self.members.get(..self.size)
    }

    /// From a subset to the next in order.
    fn advance(&mut self) {
        let mut limit = self.n;
        let mut position = self.size;
        // The last member that can go up; those after it follow closely.
        for member in self.members.iter().take(self.size).rev() {
            position -= 1;
            if member + 1 < limit {
                break;
            }
            limit -= 1;
        }
        let mut following = None;
        for member in self.members.iter_mut().take(self.size).skip(position) {
            let value = following.map_or(*member + 1, |before| before + 1);
            *member = value;
            following = Some(value);
        }
    }

    /// The subset of number `index`.
    fn place(&mut self) {
        let mut index = self.index;
        let mut row = 0;
        let mut open = self.size;
        for member in self.members.iter_mut().take(self.size) {
            open -= 1;
            // Subsets that begin with this row here; bounded by the rows.
            for _ in 0..self.n {
                let beginning = binomial((self.n - 1).saturating_sub(row), open);
                if index < beginning {
                    break;
                }
                index -= beginning;
                row += 1;
            }
            *member = row;
            row += 1;
        }
    }
}

/// A step of about the golden section of the total that has no divisor in common with it.
fn step_through(total: u32) -> u32 {
    let mut step = (GOLDEN_SECTION * f64::from(total)) as u32;
    // Numbers without a common divisor lie closer together than this.
    for _ in 0..64 {
        if greatest_common_divisor(total, step) == 1 {
            break;
        }
        step -= 1;
    }
    step
}

fn greatest_common_divisor(a: u32, b: u32) -> u32 {
    let (mut a, mut b) = (a, b);
    // Each step takes off a bit at least every other time.
    for _ in 0..64 {
        if b == 0 {
            break;
        }
        (a, b) = (b, a % b);
    }
    a
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use std::vec::Vec;

    fn all(n: usize, size: usize) -> Vec<Vec<usize>> {
        let mut subsets = Subsets::new(n, size);
        let mut seen = Vec::new();
        while let Some(members) = subsets.next() {
            seen.push(members.to_vec());
        }
        seen
    }

    #[test]
    fn every_subset_of_few_rows_is_visited_once_and_in_order() {
        for (n, size, total) in [(4, 4, 1), (6, 4, 15), (12, 5, 792), (24, 4, 10_626)] {
            let seen = all(n, size);
            assert_eq!(seen.len(), total);
            assert!(seen.windows(2).all(|pair| pair[0] < pair[1]));
            for members in &seen {
                assert!(members.windows(2).all(|pair| pair[0] < pair[1]));
                assert!(members[size - 1] < n);
            }
        }
    }

    #[test]
    fn of_many_rows_as_many_are_visited_as_there_is_time_for_none_twice_and_each_row_as_often() {
        for (n, size) in [(25, 4), (24, 5), (48, 6)] {
            let seen = all(n, size);
            assert_eq!(seen.len(), MAX_SUBSETS as usize);
            let distinct: BTreeSet<&Vec<usize>> = seen.iter().collect();
            assert_eq!(distinct.len(), seen.len());
            let expected = MAX_SUBSETS as f64 * size as f64 / n as f64;
            for row in 0..n {
                let members = seen.iter().filter(|members| members.contains(&row)).count();
                assert!(
                    (members as f64 / expected - 1.0).abs() < 0.05,
                    "{row}: {members}"
                );
            }
        }
    }

    #[test]
    fn placing_gives_what_advancing_gives() {
        let mut placed = Subsets::new(9, 5);
        for (index, members) in all(9, 5).into_iter().enumerate() {
            placed.index = index as u32;
            placed.place();
            assert_eq!(placed.members[..5], members[..]);
        }
    }

    #[test]
    fn what_makes_no_sense_has_no_subset() {
        for (n, size) in [(3, 4), (0, 4), (10, 0), (49, 4), (20, MAX_MEMBERS + 1)] {
            assert!(all(n, size).is_empty(), "{size} of {n}");
        }
    }
}
