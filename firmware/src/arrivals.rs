//! When the bytes in the ring came: what the age of an answer is counted from.
//!
//! The interrupt notes place and time of a byte that finds the ring empty, and then of one byte in
//! [`EVERY`]. A byte came no earlier than the last note before it, so an age is never told too short;
//! too long by what [`EVERY`] bytes take, and only when they had to wait. Lock-free and without unsafe
//! code, as the ring.

use core::sync::atomic::{AtomicU32, Ordering};

/// Bytes between two notes while the ring is not empty.
pub const EVERY: u32 = 64;

/// Notes for a ring of `N` × [`EVERY`] bytes; `N` is a power of two.
pub struct Arrivals<const N: usize> {
    places: [AtomicU32; N],
    times: [AtomicU32; N],
    /// Notes ever written. Moved by the writer only.
    written: AtomicU32,
}

impl<const N: usize> Arrivals<N> {
    /// Nothing came.
    pub const fn empty() -> Self {
        const { assert!(N.is_power_of_two() && N <= 1 << 16) };
        Self {
            places: [const { AtomicU32::new(0) }; N],
            times: [const { AtomicU32::new(0) }; N],
            written: AtomicU32::new(0),
        }
    }

    /// The byte at `place` of the stream comes now; `found_empty` tells whether all before it had been
    /// taken. `now` is asked only when there is something to note. For the one writer.
    #[inline]
    pub fn note(&self, place: u32, found_empty: bool, now: impl FnOnce() -> u32) {
        let written = self.written.load(Ordering::Relaxed);
        let last = self
            .places
            .get(written.wrapping_sub(1) as usize % N)
            .map_or(0, |last| last.load(Ordering::Relaxed));
        if !found_empty && written > 0 && place.wrapping_sub(last) < EVERY {
            return;
        }
        let slot = written as usize % N;
        if let (Some(noted), Some(time)) = (self.places.get(slot), self.times.get(slot)) {
            noted.store(place, Ordering::Relaxed);
            time.store(now(), Ordering::Relaxed);
        }
        // Release: the note is there before the reader may see it.
        self.written
            .store(written.wrapping_add(1), Ordering::Release);
    }

    /// A time at which the byte at `place` had not come yet, or came. For the one reader, of a byte after
    /// which fewer than `N` × [`EVERY`] came while the ring was not empty.
    pub fn time_of(&self, place: u32) -> u32 {
        let written = self.written.load(Ordering::Acquire);
        let mut found = 0;
        for back in 1..=written.min(N as u32) {
            let slot = written.wrapping_sub(back) as usize % N;
            let (Some(noted), Some(time)) = (self.places.get(slot), self.times.get(slot)) else {
                break;
            };
            found = time.load(Ordering::Relaxed);
            // Places wrap: half of all lie before.
            if place.wrapping_sub(noted.load(Ordering::Relaxed)) < 1 << 31 {
                break;
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_that_waits_for_nobody_has_its_own_time() {
        let arrivals = Arrivals::<8>::empty();
        for place in 0..100 {
            arrivals.note(place, true, || 1000 + place);
            assert_eq!(arrivals.time_of(place), 1000 + place);
        }
    }

    #[test]
    fn a_byte_in_a_queue_has_a_time_at_most_a_block_too_early() {
        let arrivals = Arrivals::<8>::empty();
        let start = u32::MAX - 100;
        for count in 0..300 {
            let place = start.wrapping_add(count);
            arrivals.note(place, count == 0, || place);
        }
        for count in 0..300 {
            let place = start.wrapping_add(count);
            let early = place.wrapping_sub(arrivals.time_of(place));
            assert!(early < EVERY, "{count}: {early}");
        }
    }
}
