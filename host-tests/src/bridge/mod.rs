//! The host's side of the sensors of an emulated board (firmware: board/mps2/bridge/).
//!
//! ```text
//! board: driver ─► SpiDevice ─► request ─┐ pipes ┌─► server ─► Sensors ─► register models ◄─ flight
//!               ◄── answer ◄─────────────┘       └── or nothing: the board's time stands still
//! ```
//!
//! A request carries the board's time, and the models advance to exactly that before they answer: a run
//! depends on the flight alone, not on the speed of either side.
//!
//! | file | what it does |
//! |---|---|
//! | `server.rs` | pipes and requests |
//! | `motion.rs` | what a unit feels, at any time of the board |
//! | `units.rs` | the parts of a flight: register models that feel it |

pub mod motion;
pub mod server;
pub mod units;

/// A register model on the bus.
pub trait Device: Send {
    /// One transfer, chip select low to high. The device has been advanced to its time.
    fn transfer(&mut self, mosi: &[u8], miso: &mut [u8]);

    /// Does what is due at `now_ns`, which is [`Device::next_ns`] or before.
    fn advance(&mut self, now_ns: u64);

    /// When the data-ready line became active; `None` while it is not.
    fn ready_ns(&self) -> Option<u64>;

    /// When something is due next, ns on the board's clock; `u64::MAX` for never.
    fn next_ns(&self) -> u64;
}

/// Line of the time pulse.
pub const TIME_PULSE: u8 = 31;

struct Place {
    number: u8,
    device: Box<dyn Device>,
    /// The edge that was told last.
    told_ns: Option<u64>,
}

/// All that is at the lines of the board.
#[derive(Default)]
pub struct Sensors {
    places: Vec<Place>,
    /// Pulses to come, the last first, ns on the board's clock.
    pulses_ns: Vec<u64>,
    /// Lines that became active and were not told yet.
    active: u32,
}

impl Sensors {
    /// Only the time pulse, at these times of the board's clock, ns.
    pub fn new(pulses_ns: impl IntoIterator<Item = u64>) -> Self {
        let mut pulses_ns: Vec<u64> = pulses_ns.into_iter().collect();
        pulses_ns.sort_unstable_by(|a, b| b.cmp(a));
        Self {
            pulses_ns,
            ..Self::default()
        }
    }

    /// Connects a device to the chip select and the line of a number.
    pub fn connect(&mut self, number: u8, device: Box<dyn Device>) {
        self.places.push(Place {
            number,
            device,
            told_ns: None,
        });
    }

    /// The devices that are there, a bit each.
    pub fn present(&self) -> u32 {
        self.places.iter().map(|place| 1 << place.number).sum()
    }

    /// A transfer at a time; a device that is not there leaves the line high.
    pub fn transfer(&mut self, now_ns: u64, number: u8, mosi: &[u8]) -> Vec<u8> {
        self.advance(now_ns);
        let mut miso = vec![0xff; mosi.len()];
        if let Some(place) = self.places.iter_mut().find(|place| place.number == number) {
            place.device.transfer(mosi, &mut miso);
            self.active |= place.edge();
        }
        miso
    }

    /// The lines that became active since the last call, and when one may next.
    pub fn edges(&mut self, now_ns: u64) -> (u32, u64) {
        self.advance(now_ns);
        (std::mem::take(&mut self.active), self.next_ns())
    }

    fn next_ns(&self) -> u64 {
        let devices = self.places.iter().map(|place| place.device.next_ns());
        let pulse = self.pulses_ns.last().copied();
        devices.chain(pulse).min().unwrap_or(u64::MAX)
    }

    /// Everything that is due until `now_ns`, in its order.
    fn advance(&mut self, now_ns: u64) {
        loop {
            let due_ns = self.next_ns();
            if due_ns > now_ns {
                break;
            }
            for place in &mut self.places {
                if place.device.next_ns() <= due_ns {
                    place.device.advance(due_ns);
                    self.active |= place.edge();
                }
            }
            if self.pulses_ns.last().is_some_and(|pulse| *pulse <= due_ns) {
                self.pulses_ns.pop();
                self.active |= 1 << TIME_PULSE;
            }
        }
        // Devices may count time between what is due.
        for place in &mut self.places {
            place.device.advance(now_ns);
            self.active |= place.edge();
        }
    }
}

impl Place {
    /// The bit of the line when it has become active since the last call.
    fn edge(&mut self) -> u32 {
        let ready_ns = self.device.ready_ns();
        let rises = ready_ns.is_some() && ready_ns != self.told_ns;
        if rises {
            self.told_ns = ready_ns;
        }
        u32::from(rises) << self.number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ready every so often until it is read; a part that is not read gives no further edge.
    struct Clockwork {
        next_ns: u64,
        interval_ns: u64,
        ready_ns: Option<u64>,
    }

    impl Device for Clockwork {
        fn transfer(&mut self, mosi: &[u8], miso: &mut [u8]) {
            miso.copy_from_slice(mosi);
            self.ready_ns = None;
        }

        fn advance(&mut self, now_ns: u64) {
            if now_ns >= self.next_ns {
                self.ready_ns.get_or_insert(self.next_ns);
                self.next_ns += self.interval_ns;
            }
        }

        fn ready_ns(&self) -> Option<u64> {
            self.ready_ns
        }

        fn next_ns(&self) -> u64 {
            self.next_ns
        }
    }

    fn clockwork(first_ns: u64, interval_ns: u64) -> Box<dyn Device> {
        Box::new(Clockwork {
            next_ns: first_ns,
            interval_ns,
            ready_ns: None,
        })
    }

    #[test]
    fn a_line_that_is_read_becomes_active_again_and_one_that_is_not_does_not() {
        let mut sensors = Sensors::new([25]);
        sensors.connect(0, clockwork(10, 10));
        sensors.connect(2, clockwork(15, 10));
        assert_eq!(sensors.present(), 0b101);
        assert_eq!(sensors.edges(0), (0, 10));
        assert_eq!(sensors.edges(10), (0b001, 15));
        assert_eq!(sensors.transfer(11, 0, &[7, 8]), [7, 8]);
        assert_eq!(sensors.edges(15), (0b100, 20));
        // Both are ready again, the pulse has come, and line 2 was not read.
        assert_eq!(sensors.edges(27), (0b001 | 1 << TIME_PULSE, 30));
        assert_eq!(sensors.edges(28), (0, 30));
    }

    #[test]
    fn nobody_leaves_the_line_high() {
        assert_eq!(Sensors::default().transfer(0, 1, &[0; 3]), [0xff; 3]);
        assert_eq!(Sensors::default().edges(5), (0, u64::MAX));
    }
}
