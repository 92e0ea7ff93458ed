//! What can be wrong with a part and its wires.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// One thing that is wrong. A part ignores what it cannot have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// Another part answers.
    WrongId,
    /// The data-ready line does not move.
    StuckDataReady {
        /// Where it stays.
        active: bool,
    },
    /// Every bit that the part sends is turned with this probability.
    FlipBits {
        /// Of one bit.
        probability: f64,
        /// Of the random numbers.
        seed: u64,
    },
    /// One bit is turned once.
    FlipOnce {
        /// In this transfer, counted from zero since nothing was wrong.
        transfer: u32,
        /// Place in the transfer, first sent first.
        bit: usize,
    },
    /// The line from the part is high throughout.
    AllOnes,
    /// The line from the part is low throughout.
    AllZeros,
    /// The bus reports an error instead of each transfer.
    BusError,
    /// The bus reports an error instead of this transfer, counted from zero since nothing was wrong.
    BusErrorOnce {
        /// Which.
        transfer: u32,
    },
    /// The counter or time stamp moves by so many samples too many at each sample.
    SkipCounter {
        /// How many.
        by: u16,
    },
    /// The counter or time stamp stays.
    RepeatCounter,
    /// The test of the sensors fails.
    SelfTestFails,
    /// A sensor answers the test far too much.
    SelfTestTooStrong,
    /// The part says that it lost data.
    Overrun,
    /// The part says that a sensor failed.
    Failing,
    /// All axes are at the end of their numbers.
    Saturated,
    /// An axis has no number.
    NoNumber,
    /// A reset does not end.
    ResetStuck,
    /// Writes to this register are lost.
    RegisterStuck {
        /// Address.
        address: u8,
    },
    /// The part's constants have a wrong bit.
    BadTrimming,
    /// No samples.
    Silent,
}

/// All that is wrong.
#[derive(Debug)]
pub struct Faults {
    active: Vec<Fault>,
    random: ChaCha8Rng,
    flipped: u64,
    /// Transfers since nothing was wrong.
    transfers: u32,
}

impl Default for Faults {
    fn default() -> Self {
        Self {
            active: Vec::new(),
            random: ChaCha8Rng::seed_from_u64(0),
            flipped: 0,
            transfers: 0,
        }
    }
}

impl Faults {
    /// From now on this is wrong as well.
    pub fn set(&mut self, fault: Fault) {
        if let Fault::FlipBits { seed, .. } = fault {
            self.random = ChaCha8Rng::seed_from_u64(seed);
        }
        self.active.push(fault);
    }

    /// From now on nothing is wrong.
    pub fn clear(&mut self) {
        self.active.clear();
        self.transfers = 0;
    }

    /// Whether exactly this is wrong.
    pub fn has(&self, fault: Fault) -> bool {
        self.active.contains(&fault)
    }

    /// Bits turned so far.
    pub fn flipped(&self) -> u64 {
        self.flipped
    }

    /// Whether the bus reports an error this time.
    pub(super) fn is_bus_error(&mut self) -> bool {
        let transfer = self.transfers;
        let is_error = self.has(Fault::BusError) || self.has(Fault::BusErrorOnce { transfer });
        if is_error {
            self.transfers = transfer.saturating_add(1);
        }
        is_error
    }

    /// Samples by which the counter moves.
    pub(super) fn counter_step(&self) -> u16 {
        let mut step = 1;
        for fault in &self.active {
            match fault {
                Fault::SkipCounter { by } => step += by,
                Fault::RepeatCounter => step = 0,
                _ => {}
            }
        }
        step
    }

    /// Whether writes to this register are lost.
    pub(super) fn loses(&self, address: u8) -> bool {
        self.has(Fault::RegisterStuck { address })
    }

    /// What the wires make of what the part sends.
    pub(super) fn on_line(&mut self, miso: &mut [u8]) {
        let this = self.transfers;
        self.transfers = this.saturating_add(1);
        for fault in self.active.clone() {
            match fault {
                Fault::FlipOnce { transfer, bit } if transfer == this => {
                    if let Some(byte) = miso.get_mut(bit / 8) {
                        *byte ^= 0x80 >> (bit % 8);
                        self.flipped += 1;
                    }
                }
                Fault::AllOnes => miso.fill(0xff),
                Fault::AllZeros => miso.fill(0x00),
                Fault::FlipBits { probability, .. } => {
                    for byte in miso.iter_mut() {
                        for bit in 0..8 {
                            let draw = self.random.next_u32();
                            if f64::from(draw) < probability * 4_294_967_296.0 {
                                *byte ^= 1 << bit;
                                self.flipped += 1;
                            }
                        }
                    }
                }
                _ => {}
            }
        }
    }
}
