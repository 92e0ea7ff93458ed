//! Satellite and signal data of MSM4 to MSM7. [RTCM-3] tables 3.5-79 to 3.5-86
//!
//! | part | MSM4 | MSM5 | MSM6 | MSM7 | unit | none when |
//! |---|---|---|---|---|---|---|
//! | rough range, whole | 8 | 8 | 8 | 8 | ms | 255 |
//! | extended satellite information | | 4 | | 4 | | |
//! | rough range, fraction | 10 | 10 | 10 | 10 | 2⁻¹⁰ ms | |
//! | rough phase range rate | | 14 | | 14 | m/s | −2¹³ |
//! | fine pseudorange | 15 | 15 | 20 | 20 | 2⁻²⁴, 2⁻²⁹ ms | lowest |
//! | fine phase range | 22 | 22 | 24 | 24 | 2⁻²⁹, 2⁻³¹ ms | lowest |
//! | lock time | 4 | 4 | 10 | 10 | | |
//! | half-cycle ambiguity | 1 | 1 | 1 | 1 | | |
//! | carrier to noise | 6 | 6 | 10 | 10 | 1, 2⁻⁴ dB-Hz | 0 |
//! | fine phase range rate | | 15 | | 15 | 10⁻⁴ m/s | −2¹⁴ |
//!
//! Satellite data stand field by field over all satellites, then signal data field by field over
//! all cells. Ranges are summed as integers, so nothing is rounded here.

use super::header::MsmHeader;
use super::{Constellation, ContentError};
use crate::wire::bits::Bits;

/// A view of an MSM4 to MSM7 whose length was checked.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Msm<'a> {
    header: MsmHeader,
    layout: Layout,
    bits: Bits<'a>,
}

/// One signal of one satellite as it stands in the message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Number of the satellite in its system's mask, 1 to 64.
    pub satellite: u8,
    /// Number of the signal in its system's mask, 1 to 32.
    pub signal: u8,
    /// Pseudorange in units of 2⁻²⁹ ms.
    pub pseudorange: Option<i64>,
    /// Carrier phase as a range, in units of 2⁻³¹ ms.
    pub phase_range: Option<i64>,
    /// Rate of the carrier phase range in units of 10⁻⁴ m/s, positive when receding; MSM4 and MSM6
    /// have none.
    pub phase_range_rate: Option<i32>,
    /// Carrier to noise in units of 2⁻⁴ dB-Hz.
    pub carrier_to_noise: Option<u16>,
    /// Lock time indicator as it stands. DF402, DF407
    pub lock_time: u16,
    /// The carrier phase may be off by half a cycle. DF420
    pub half_cycle_ambiguity: bool,
}

/// Widths of the fields and where each column starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Layout {
    has_rates: bool,
    pseudorange_width: u32,
    phase_width: u32,
    lock_width: u32,
    noise_width: u32,
    rough_ms: usize,
    rough_fraction: usize,
    rough_rate: usize,
    pseudorange: usize,
    phase: usize,
    lock: usize,
    half_cycle: usize,
    noise: usize,
    rate: usize,
    end: usize,
}

impl Layout {
    /// The layout of a message with at most 64 satellites and 64 cells.
    const fn new(header: &MsmHeader) -> Self {
        let n_satellites = header.satellites.count_ones() as usize;
        let n_cells = header.cells.count_ones() as usize;
        let has_rates = matches!(header.variant, 5 | 7);
        let (pseudorange_width, phase_width, lock_width, noise_width) =
            if matches!(header.variant, 4 | 5) {
                (15, 22, 4, 6)
            } else {
                (20, 24, 10, 10)
            };
        let (information_width, rough_rate_width, rate_width) =
            if has_rates { (4, 14, 15) } else { (0, 0, 0) };
        let rough_ms = header.len_bits();
        let rough_fraction = rough_ms + (8 + information_width) * n_satellites;
        let rough_rate = rough_fraction + 10 * n_satellites;
        let pseudorange = rough_rate + rough_rate_width * n_satellites;
        let phase = pseudorange + pseudorange_width as usize * n_cells;
        let lock = phase + phase_width as usize * n_cells;
        let half_cycle = lock + lock_width as usize * n_cells;
        let noise = half_cycle + n_cells;
        let rate = noise + noise_width as usize * n_cells;
        Self {
            has_rates,
            pseudorange_width,
            phase_width,
            lock_width,
            noise_width,
            rough_ms,
            rough_fraction,
            rough_rate,
            pseudorange,
            phase,
            lock,
            half_cycle,
            noise,
            rate,
            end: rate + rate_width * n_cells,
        }
    }
}

/// Satellite data of one satellite.
#[derive(Clone, Copy)]
struct Rough {
    /// In units of 2⁻¹⁰ ms.
    range: Option<i64>,
    /// m/s.
    rate: Option<i64>,
}

impl<'a> Msm<'a> {
    /// Checks that everything the header announces is there.
    pub fn parse(bits: Bits<'a>, header: MsmHeader) -> Result<Self, ContentError> {
        let layout = Layout::new(&header);
        if layout.end > bits.len() {
            return Err(ContentError::Truncated {
                number: header.number,
            });
        }
        Ok(Self {
            header,
            layout,
            bits,
        })
    }

    /// The header.
    pub const fn header(&self) -> &MsmHeader {
        &self.header
    }

    /// The constellation.
    pub const fn constellation(&self) -> Constellation {
        self.header.constellation
    }

    /// Gives every cell in use to `take`, satellite by satellite.
    pub fn for_each_cell(&self, mut take: impl FnMut(Cell)) {
        let mut satellites = self.header.satellites;
        let mut cells = self.header.cells;
        let mut cell_index = 0;
        for satellite_index in 0..64 {
            if satellites == 0 {
                break;
            }
            let satellite = satellites.leading_zeros();
            satellites &= !(1 << (63 - (satellite & 63)));
            let Some(rough) = self.rough(satellite_index) else {
                break;
            };
            let mut signals = self.header.signals;
            for _ in 0..32 {
                if signals == 0 {
                    break;
                }
                let signal = signals.leading_zeros();
                signals &= !(1 << (31 - (signal & 31)));
                let is_used = cells >> 63 != 0;
                cells <<= 1;
                if is_used {
                    if let Some(cell) = self.cell(rough, cell_index) {
                        take(Cell {
                            satellite: satellite as u8 + 1,
                            signal: signal as u8 + 1,
                            ..cell
                        });
                    }
                    cell_index += 1;
                }
            }
        }
    }

    fn rough(&self, index: usize) -> Option<Rough> {
        let layout = &self.layout;
        let whole_ms = self.bits.unsigned(layout.rough_ms + 8 * index, 8)? as i64;
        let fraction = self.bits.unsigned(layout.rough_fraction + 10 * index, 10)? as i64;
        let rate = if layout.has_rates {
            self.signed_or_none(layout.rough_rate + 14 * index, 14)?
        } else {
            None
        };
        Some(Rough {
            range: (whole_ms != 255).then_some(whole_ms << 10 | fraction),
            rate,
        })
    }

    /// Cell number `index` of those in use; satellite and signal are filled in by the caller.
    fn cell(&self, rough: Rough, index: usize) -> Option<Cell> {
        let layout = &self.layout;
        let column = |start: usize, width: u32| start + width as usize * index;

        let width = layout.pseudorange_width;
        let fine = self.signed_or_none(column(layout.pseudorange, width), width)?;
        let to_finest = if width == 15 { 5 } else { 0 };
        let pseudorange = match (rough.range, fine) {
            (Some(rough), Some(fine)) => Some((rough << 19) + (fine << to_finest)),
            _ => None,
        };

        let width = layout.phase_width;
        let fine = self.signed_or_none(column(layout.phase, width), width)?;
        let to_finest = if width == 22 { 2 } else { 0 };
        let phase_range = match (rough.range, fine) {
            (Some(rough), Some(fine)) => Some((rough << 21) + (fine << to_finest)),
            _ => None,
        };

        let fine = if layout.has_rates {
            self.signed_or_none(column(layout.rate, 15), 15)?
        } else {
            None
        };
        let phase_range_rate = match (rough.rate, fine) {
            (Some(rough), Some(fine)) => Some((rough * 10_000 + fine) as i32),
            _ => None,
        };

        let width = layout.noise_width;
        let noise = self.bits.unsigned(column(layout.noise, width), width)? as u16;
        let to_finest = if width == 6 { 4 } else { 0 };

        let width = layout.lock_width;
        Some(Cell {
            satellite: 0,
            signal: 0,
            pseudorange,
            phase_range,
            phase_range_rate,
            carrier_to_noise: (noise != 0).then_some(noise << to_finest),
            lock_time: self.bits.unsigned(column(layout.lock, width), width)? as u16,
            half_cycle_ambiguity: self.bits.unsigned(layout.half_cycle + index, 1)? != 0,
        })
    }

    /// A two's complement field whose lowest value says that there is none.
    fn signed_or_none(&self, offset: usize, width: u32) -> Option<Option<i64>> {
        let value = self.bits.signed(offset, width)?;
        let none = -1_i64 << ((width - 1) & 63);
        Some((value != none).then_some(value))
    }
}
