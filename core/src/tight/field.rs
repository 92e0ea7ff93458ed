//! Magnetic samples on their way to the alignment: each waits for the increments of its time, which
//! themselves may wait for an epoch (`horizon.rs`).

use super::TightMonitor;
use crate::ins::MagneticSample;
use crate::time::{GpsTime, NS_PER_S};

/// Samples that wait. More than that are not taken: an alignment averages those it has.
pub(super) const CAPACITY: usize = 8;
/// A sample farther ahead of the increments than this is of another time, ns.
const MAX_AHEAD_NS: i64 = NS_PER_S;
/// A sample older than this belongs to axes that are gone, ns.
const MAX_AGE_NS: i64 = 50_000_000;

impl TightMonitor {
    /// A sample of the magnetometer. A filter that runs needs none.
    pub(crate) fn on_field(&mut self, sample: &MagneticSample) {
        if !self.is_running() {
            // Full: see CAPACITY.
            let _ = self.fields.push_back(*sample);
        }
    }

    /// Gives the alignment what lies before `until`, where its increments end.
    pub(super) fn pass_fields(&mut self, until: GpsTime) {
        for _ in 0..CAPACITY {
            let Some(sample) = self.fields.front().copied() else {
                return;
            };
            let ahead_ns = sample.time.ns().saturating_sub(until.ns());
            if (1..=MAX_AHEAD_NS).contains(&ahead_ns) {
                return;
            }
            self.fields.pop_front();
            if (-MAX_AGE_NS..=0).contains(&ahead_ns) {
                self.alignment.on_field(&sample);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(milliseconds: i64) -> GpsTime {
        GpsTime::from_week_tow_ns(2400, milliseconds * 1_000_000)
    }

    #[test]
    fn a_sample_waits_for_the_increments_of_its_time() {
        let mut tight = std::boxed::Box::new(TightMonitor::EMPTY);
        let left = |tight: &mut TightMonitor, until_ms| {
            tight.pass_fields(at(until_ms));
            tight.fields.len()
        };
        for milliseconds in [900, 1000, 1100, 90_000, 1200] {
            tight.on_field(&MagneticSample {
                time: at(milliseconds),
                field_s_ut: [20.0, 0.0, 40.0],
            });
        }
        assert_eq!(left(&mut tight, 899), 5);
        assert_eq!(left(&mut tight, 1000), 3);
        // What is of another time holds nothing up.
        assert_eq!(left(&mut tight, 1150), 1);
        assert_eq!(left(&mut tight, 1200), 0);
        for milliseconds in 0..20 {
            tight.on_field(&MagneticSample {
                time: at(milliseconds),
                field_s_ut: [20.0, 0.0, 40.0],
            });
        }
        assert_eq!(tight.fields.len(), CAPACITY);
        assert_eq!(left(&mut tight, 60_000), 0);
    }
}
