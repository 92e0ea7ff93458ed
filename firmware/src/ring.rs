//! A ring of bytes between one interrupt that writes and one task that reads.
//!
//! Lock-free and without unsafe code: both ends only move their own index, and the bytes are
//! atomics. When the ring is full the new byte is dropped and counted: the reader sees a gap, its
//! decoder finds the next frame by itself, and the count tells how much was lost.

use core::sync::atomic::{AtomicU8, AtomicU32, Ordering};

/// Room for `N` bytes; `N` is a power of two.
pub struct Ring<const N: usize> {
    bytes: [AtomicU8; N],
    /// Bytes ever written; the place is this modulo `N`. Moved by the writer only.
    written: AtomicU32,
    /// Bytes ever read. Moved by the reader only.
    read: AtomicU32,
    /// Bytes that found no room.
    lost: AtomicU32,
}

impl<const N: usize> Ring<N> {
    /// A ring with nothing in it.
    pub const fn empty() -> Self {
        const { assert!(N.is_power_of_two() && N <= 1 << 30) };
        Self {
            bytes: [const { AtomicU8::new(0) }; N],
            written: AtomicU32::new(0),
            read: AtomicU32::new(0),
            lost: AtomicU32::new(0),
        }
    }

    /// Puts a byte in, or counts it as lost. For the one writer.
    #[inline]
    pub fn push(&self, byte: u8) {
        let written = self.written.load(Ordering::Relaxed);
        // Acquire: the reader is done with the place before it is written anew.
        if written.wrapping_sub(self.read.load(Ordering::Acquire)) as usize >= N {
            self.add_lost(1);
            return;
        }
        if let Some(place) = self.bytes.get(written as usize % N) {
            place.store(byte, Ordering::Relaxed);
        }
        // Release: the byte is there before the reader may see it.
        self.written
            .store(written.wrapping_add(1), Ordering::Release);
    }

    /// Takes up to `out.len()` bytes and returns how many. For the one reader.
    pub fn pop(&self, out: &mut [u8]) -> usize {
        let read = self.read.load(Ordering::Relaxed);
        let there = self.written.load(Ordering::Acquire).wrapping_sub(read) as usize;
        let count = there.min(out.len());
        for (offset, byte) in out.iter_mut().take(count).enumerate() {
            if let Some(place) = self.bytes.get((read as usize).wrapping_add(offset) % N) {
                *byte = place.load(Ordering::Relaxed);
            }
        }
        self.read
            .store(read.wrapping_add(count as u32), Ordering::Release);
        count
    }

    /// Bytes ever written, modulo 2³²: the place of the next one in the stream.
    #[inline]
    pub fn written(&self) -> u32 {
        self.written.load(Ordering::Acquire)
    }

    /// Bytes ever read, modulo 2³²: the place of the next one to be taken. For the one reader.
    #[inline]
    pub fn taken(&self) -> u32 {
        self.read.load(Ordering::Relaxed)
    }

    /// Bytes to take.
    pub fn waiting(&self) -> u32 {
        let read = self.read.load(Ordering::Relaxed);
        self.written.load(Ordering::Acquire).wrapping_sub(read)
    }

    /// Whether there is nothing to take.
    pub fn is_empty(&self) -> bool {
        self.written.load(Ordering::Acquire) == self.read.load(Ordering::Acquire)
    }

    /// Counts bytes that were lost before they reached the ring. For the one writer.
    #[inline]
    pub fn add_lost(&self, count: u32) {
        let lost = self.lost.load(Ordering::Relaxed);
        self.lost
            .store(lost.saturating_add(count), Ordering::Relaxed);
    }

    /// Bytes lost since the start.
    pub fn lost(&self) -> u32 {
        self.lost.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_out_in_order_around_the_end() {
        let ring = Ring::<8>::empty();
        let mut next_out = 0u8;
        let mut out = [0; 5];
        for round in 0..50u8 {
            for k in 0..5 {
                ring.push(round * 5 + k);
            }
            assert_eq!(ring.pop(&mut out), 5);
            for byte in out {
                assert_eq!(byte, next_out);
                next_out += 1;
            }
        }
        assert_eq!((ring.pop(&mut out), ring.lost()), (0, 0));
    }

    #[test]
    fn a_full_ring_keeps_the_old_bytes_and_counts_the_new() {
        let ring = Ring::<4>::empty();
        (0..7).for_each(|byte| ring.push(byte));
        assert_eq!(ring.lost(), 3);
        let mut out = [0; 8];
        assert_eq!(ring.pop(&mut out), 4);
        assert_eq!(&out[..4], &[0, 1, 2, 3]);
        ring.push(9);
        assert_eq!((ring.pop(&mut out), out[0]), (1, 9));
    }

    #[test]
    fn the_counters_wrap_without_harm() {
        let ring = Ring::<4>::empty();
        ring.written.store(u32::MAX - 1, Ordering::Relaxed);
        ring.read.store(u32::MAX - 1, Ordering::Relaxed);
        (1..=4).for_each(|byte| ring.push(byte));
        ring.push(5);
        let mut out = [0; 8];
        assert_eq!((ring.pop(&mut out), ring.lost()), (4, 1));
        assert_eq!(&out[..4], &[1, 2, 3, 4]);
    }
}
