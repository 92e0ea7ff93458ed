//! One unit's samples on the common grid of times.
//!
//! In: samples as the unit sends them, at its own rate. Out: mean rates over each cell of the grid, cell
//! g being (gT, (g+1)T], once the unit has measured all of it.
//!
//! | symbol | code          | unit           | meaning                                              |
//! |--------|---------------|----------------|------------------------------------------------------|
//! | T      | `cell_ns`     | ns             | length of a cell                                     |
//! | m_k    | `mean`        | rad/s, m/s²    | mean rates of a sample, body axes, gyroscopes first  |
//! | a_k    | `slope`       | rad/s², m/s³   | their slope, from this sample and the one before     |
//!
//! A sample that lies in one cell is added to it as it came. One that crosses a border is divided by
//! the straight line a_k that agrees with both its own mean and that of the sample before:
//! ∫ from u to w after its start = m (w − u) + a ((w² − u²) − h (w − u))/2 with h its length. The parts add
//! up to the whole, so that nothing is lost or counted twice. Where the intake has filled a gap the cell
//! stays empty: what was not measured is not compared.

use nalgebra::Vector6;

use crate::ins::{ImuSample, Increment, Intake, IntakeCounters, IntakeFault, UnitConfig};
use crate::time::{GpsTime, NS_PER_S};

/// Cells between the oldest that waits for a unit and the newest any unit has reached.
pub(super) const RING: usize = 16;
/// Most cells of one sample: ten nominal intervals of 20 ms in cells of 2.5 ms, and its two ends.
const MAX_PARTS: usize = 84;

/// Gyroscopes x, y, z, then accelerometers x, y, z.
pub(super) type Channels = Vector6<f64>;

#[derive(Clone, Copy, Debug)]
struct Cell {
    /// The low half of its number: what the ring holds lies closer together.
    index: u32,
    covered_ns: u32,
    integral: Channels,
}

impl Cell {
    const EMPTY: Self = Self {
        index: 0,
        covered_ns: 0,
        integral: Channels::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };
}

/// The cell in which the nanosecond before `time` lies.
pub(super) fn cell_before(time: GpsTime, cell_ns: i64) -> i64 {
    time.ns()
        .saturating_sub(1)
        .checked_div_euclid(cell_ns)
        .unwrap_or(0)
}

/// Where the ring holds a cell.
fn place(index: i64) -> usize {
    index.rem_euclid(RING as i64) as usize
}

/// Intake and cells of one unit.
#[derive(Clone, Debug)]
pub(super) struct UnitGrid {
    intake: Intake,
    cells: [Cell; RING],
    /// Mean rates and length, s, of the sample before, which ended where the next begins.
    before: Option<(Channels, f64)>,
}

impl UnitGrid {
    pub(super) const EMPTY: Self = Self {
        intake: Intake::EMPTY,
        cells: [Cell::EMPTY; RING],
        before: None,
    };

    pub(super) fn configure(&mut self, unit: &UnitConfig) {
        *self = Self::EMPTY;
        self.intake
            .configure_unit(unit.interval_ns, &unit.c_b_s, &unit.range);
    }

    /// End of what it has measured.
    pub(super) fn end(&self) -> Option<GpsTime> {
        self.intake.last_time()
    }

    pub(super) fn counters(&self) -> IntakeCounters {
        self.intake.counters()
    }

    pub(super) fn shift(&mut self, by_ns: i64) {
        self.intake.shift(by_ns);
        self.clear();
    }

    /// Forgets the cells; what comes next begins anew.
    pub(super) fn clear(&mut self) {
        self.cells = [Cell::EMPTY; RING];
        self.before = None;
    }

    /// Takes a sample; cells before `next` are past.
    ///
    /// # Errors
    /// [`IntakeFault`]: what it measured does not follow from what it measured before.
    pub(super) fn take(
        &mut self,
        sample: &ImuSample,
        next: i64,
        cell_ns: i64,
    ) -> Result<(), IntakeFault> {
        let taken = self.intake.take(sample).inspect_err(|_| {
            self.before = None;
        })?;
        let Some(taken) = taken else { return Ok(()) };
        if taken.bridge.is_some() {
            self.before = None;
        }
        self.divide(
            &taken.increment,
            taken.time,
            taken.interval_ns,
            next,
            cell_ns,
        );
        Ok(())
    }

    fn divide(
        &mut self,
        increment: &Increment,
        end: GpsTime,
        length_ns: i64,
        next: i64,
        cell_ns: i64,
    ) {
        let (w, f) = (increment.dtheta_b, increment.dv_b);
        let whole = Channels::new(w.x, w.y, w.z, f.x, f.y, f.z);
        let length_s = increment.dt_s;
        if !(length_s > 0.0) {
            return;
        }
        let mean = whole / length_s;
        let slope = match self.before.replace((mean, length_s)) {
            Some((before, before_s)) => (mean - before) * (2.0 / (length_s + before_s)),
            None => Channels::zeros(),
        };
        let begin_ns = end.ns().saturating_sub(length_ns);
        let last = cell_before(end, cell_ns);
        let first = begin_ns.checked_div_euclid(cell_ns).unwrap_or(last);
        for index in (first.max(next)..=last).take(MAX_PARTS) {
            let cell_begin_ns = index.saturating_mul(cell_ns);
            let from_ns = cell_begin_ns.saturating_sub(begin_ns).max(0);
            let to_ns = cell_begin_ns
                .saturating_add(cell_ns)
                .saturating_sub(begin_ns)
                .min(length_ns);
            let part = if from_ns == 0 && to_ns == length_ns {
                whole
            } else {
                let (from_s, to_s) = (seconds(from_ns), seconds(to_ns));
                let part_s = to_s - from_s;
                mean * part_s
                    + slope * (0.5 * ((to_s * to_s - from_s * from_s) - length_s * part_s))
            };
            self.add(index, to_ns.saturating_sub(from_ns), &part);
        }
    }

    fn add(&mut self, index: i64, length_ns: i64, part: &Channels) {
        let index_low = index as u32;
        if let Some(cell) = self.cells.get_mut(place(index)) {
            if cell.index != index_low {
                *cell = Cell {
                    index: index_low,
                    ..Cell::EMPTY
                };
            }
            let length_ns = u32::try_from(length_ns).unwrap_or(u32::MAX);
            cell.covered_ns = cell.covered_ns.saturating_add(length_ns);
            cell.integral += part;
        }
    }

    /// Mean rates over a cell, where the unit has measured all of it.
    pub(super) fn rates(&self, index: i64, cell_ns: i64) -> Option<Channels> {
        let cell = self.cells.get(place(index))?;
        (cell.index == index as u32 && i64::from(cell.covered_ns) == cell_ns)
            .then(|| cell.integral / seconds(cell_ns))
    }
}

pub(super) fn seconds(ns: i64) -> f64 {
    ns as f64 / NS_PER_S as f64
}
