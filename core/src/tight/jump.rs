//! Jumps of the receiver clock, seen in innovations that most satellites have in common.

/// Without a snapshot solution an innovation common to the satellites and beyond this is a jump of the
/// clock, m: no drift between two epochs and no coasting of a minute comes near it, and a jump by a
/// millisecond is a hundred times it.
const JUMP_M: f64 = 3.0e3;
/// Innovations that agree to this are common, m.
pub(super) const COMMON_M: f64 = 300.0;

/// The middle of some numbers (the lower of two), found by counting: there are a few dozen at most.
pub(super) fn median(values: &mut [f64]) -> Option<f64> {
    let middle = values.len().saturating_sub(1) / 2;
    values.iter().enumerate().find_map(|(at, value)| {
        let below = values
            .iter()
            .enumerate()
            .filter(|(other_at, other)| **other < *value || (**other == *value && *other_at < at))
            .count();
        (below == middle).then_some(*value)
    })
}

/// How far the clock jumped, if most innovations say the same and no clock drifts so.
pub(super) fn common_jump(innovations_m: &mut [f64]) -> Option<f64> {
    let middle_m = median(innovations_m)?;
    let agreeing = innovations_m
        .iter()
        .filter(|value| libm::fabs(**value - middle_m) <= COMMON_M)
        .count();
    // An innovation is predicted minus measured.
    (libm::fabs(middle_m) > JUMP_M && agreeing >= 2 && 2 * agreeing > innovations_m.len())
        .then_some(-middle_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn the_median_is_the_lower_middle_whatever_the_order() {
        assert_eq!(median(&mut []), None);
        for n in 1..=9_usize {
            let sorted: Vec<f64> = (0..n).map(|k| k as f64 - 3.0).collect();
            for turn in 0..n {
                let mut values = sorted.clone();
                values.rotate_left(turn);
                assert_eq!(median(&mut values), Some(sorted[(n - 1) / 2]));
                values.reverse();
                assert_eq!(median(&mut values), Some(sorted[(n - 1) / 2]));
            }
        }
        assert_eq!(median(&mut [2.0, 2.0, 2.0, 1.0]), Some(2.0));
        assert_eq!(median(&mut [-0.0, 0.0, 7.0]), Some(0.0));
    }

    #[test]
    fn a_jump_is_what_most_innovations_say() {
        // An innovation is predicted minus measured.
        let jump_m = common_jump(&mut [-3.0e5, -3.0e5 + 40.0, -3.0e5 - 25.0]);
        assert_eq!(jump_m, Some(3.0e5));
        assert_eq!(common_jump(&mut [5.0e3, 5.1e3, 4.9e3, 10.0]), Some(-4.9e3));
        // One satellite may be faulty, so may half of them; and a drift is no jump.
        assert_eq!(common_jump(&mut [3.0e5]), None);
        assert_eq!(common_jump(&mut [3.0e5, 3.0e5, 0.0, 0.0]), None);
        assert_eq!(common_jump(&mut [3.0e5, 1.0e5, 2.0e5]), None);
        assert_eq!(common_jump(&mut [2.9e3, 2.9e3, 2.9e3]), None);
        assert_eq!(common_jump(&mut []), None);
        assert_eq!(common_jump(&mut [f64::INFINITY; 3]), None);
    }
}
