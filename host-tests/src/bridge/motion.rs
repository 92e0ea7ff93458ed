//! What a unit feels, at any time of the board.

use surefix_core::ins::ImuSample;
use surefix_core::time::GpsTime;

/// The board's clock against GPS time.
#[derive(Clone, Copy, Debug)]
pub struct BoardClock {
    /// GPS time at which it stood at [`BoardClock::at_start_ns`].
    pub start: GpsTime,
    /// What it showed then, ns.
    pub at_start_ns: u64,
    /// How much it is too fast, parts in a million.
    pub ppm: f64,
}

impl BoardClock {
    /// What it shows at a GPS time not before the board started, ns.
    pub fn local_ns(&self, time: GpsTime) -> u64 {
        let since_ns = (time.ns() - self.start.ns()) as f64 * (1.0 + self.ppm * 1e-6);
        self.at_start_ns
            .saturating_add_signed(since_ns.round() as i64)
    }

    /// GPS time when it shows `local_ns`.
    pub fn gps(&self, local_ns: u64) -> GpsTime {
        let since_ns = local_ns as f64 - self.at_start_ns as f64;
        self.start
            .plus_ns((since_ns / (1.0 + self.ppm * 1e-6)).round() as i64)
    }
}

/// Increments of a flight summed up, so that the mean over any interval can be told.
#[derive(Clone, Debug)]
pub struct Felt {
    start: GpsTime,
    interval_ns: i64,
    /// Angle (rad) and velocity (m/s) since the start, at each end of an interval.
    sums: Vec<[f64; 6]>,
}

impl Felt {
    /// Of samples without a gap, the first of which begins at `start`.
    pub fn new(start: GpsTime, samples: &[ImuSample]) -> Self {
        let mut sum = [0.0; 6];
        let mut sums = vec![sum];
        for sample in samples {
            let parts = sample.dtheta_is_s_rad.iter().chain(&sample.dv_is_s_mps);
            sum.iter_mut()
                .zip(parts)
                .for_each(|(sum, part)| *sum += part);
            sums.push(sum);
        }
        Self {
            start,
            interval_ns: samples.first().map_or(1, |first| first.interval_ns.into()),
            sums,
        }
    }

    /// Mean angular rate, rad/s, and specific force, m/s², over an interval of GPS time. Before the start and
    /// after the end as at the start and at the end.
    pub fn mean(&self, from: GpsTime, to: GpsTime) -> ([f64; 3], [f64; 3]) {
        let (begin, end) = (self.sum(from), self.sum(to));
        let length_s = to.seconds_since(from);
        let mean: [f64; 6] = std::array::from_fn(|axis| (end[axis] - begin[axis]) / length_s);
        let [x, y, z, u, v, w] = mean;
        ([x, y, z], [u, v, w])
    }

    /// The sum at a time, between the ends of intervals in proportion.
    fn sum(&self, time: GpsTime) -> [f64; 6] {
        let since_ns = time.ns() - self.start.ns();
        let last = self.sums.len().saturating_sub(2) as i64;
        let whole = since_ns.div_euclid(self.interval_ns).clamp(0, last);
        let part = (since_ns - whole * self.interval_ns) as f64 / self.interval_ns as f64;
        let (begin, end) = (self.sums[whole as usize], self.sums[whole as usize + 1]);
        std::array::from_fn(|axis| begin[axis] + part * (end[axis] - begin[axis]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fast_clock_shows_more_and_tells_the_same_time() {
        let clock = BoardClock {
            start: GpsTime::from_ns(1_000_000_000_000),
            at_start_ns: 100_000_000,
            ppm: 50.0,
        };
        let time = clock.start.plus_ns(10_000_000_000);
        assert_eq!(clock.local_ns(time), 100_000_000 + 10_000_500_000);
        assert_eq!(clock.gps(clock.local_ns(time)), time);
    }

    #[test]
    fn means_are_those_of_the_increments_across_their_borders_and_beyond_the_ends() {
        let start = GpsTime::from_ns(0);
        let sample = |k: i64| ImuSample {
            time: GpsTime::from_ns((k + 1) * 1_000_000),
            interval_ns: 1_000_000,
            dtheta_is_s_rad: [k as f64 * 1e-3, 0.0, 0.0],
            dv_is_s_mps: [0.0, 0.0, -9.8e-3],
        };
        let felt = Felt::new(start, &[0, 1, 2, 3].map(sample));
        let mean = |from_us: i64, to_us: i64| {
            let at = |us: i64| GpsTime::from_ns(us * 1000);
            felt.mean(at(from_us), at(to_us))
        };
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-9, "{a} {b}");
        close(mean(1000, 2000).0[0], 1.0);
        close(mean(1500, 3500).0[0], (0.5 + 2.0 + 1.5) / 2.0);
        close(mean(-5000, -1000).0[0], 0.0);
        close(mean(5000, 6000).0[0], 3.0);
        close(mean(250, 270).1[2], -9.8);
    }
}
