//! From raw samples to increments that follow each other without a gap or an overlap.
//!
//! In: samples as a unit sends them: late, repeated, missing, not numbers, at the end of their range.
//! Out: increments in body axes that together cover all time since the intake began, or a fault that
//! says why they cannot. No sample is dropped or replaced without being counted.
//!
//! | symbol | code          | unit | meaning                                                       |
//! |--------|---------------|------|---------------------------------------------------------------|
//! | T      | `nominal_ns`  | ns   | interval between samples by configuration                     |
//! |        | `elapsed_ns`  | ns   | end of this sample minus end of the last one that was used    |
//! |        | `missing_ns`  | ns   | what of it the sample itself did not integrate                |
//!
//! A used sample answers for everything since the last used one. Missing up to half of T is the jitter
//! of time stamps: the increments are stretched to what elapsed. More is a gap, and is filled with the
//! mean of the rates on both sides, exact for a motion whose rates are straight lines, up to
//! [`MAX_BRIDGE_NS`]; beyond it the intake begins anew and the fault tells the user to do the same.
//! Departures: times are compared in integer nanoseconds, so that the lengths add up exactly.

use super::{ImuSample, Increment, InertialConfig, SensorRange};
use crate::time::{GpsTime, NS_PER_S};
use nalgebra::{Matrix3, Vector3};

/// Longest gap that is filled, ns: five samples at 100 Hz.
pub const MAX_BRIDGE_NS: i64 = 50_000_000;
/// A sample later than the last by more than this shows a new time, not a silence, ns.
const MAX_SILENCE_NS: i64 = 60 * NS_PER_S;
/// A sample's own interval may differ from the nominal one by this factor.
const MAX_INTERVAL_FACTOR: i64 = 10;
/// The same content again, earlier than this part of T after the last: the same sample read twice.
const REPEATED_BEFORE: (i64, i64) = (4, 5);
/// Stretching by more than this is counted.
const STRETCH_COUNTED: f64 = 0.01;

/// What became of the samples. Counts stop at their largest value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IntakeCounters {
    /// Samples used.
    pub used: u32,
    /// Samples that came twice: dropped.
    pub repeated: u32,
    /// Samples older than the last used one: dropped.
    pub late: u32,
    /// Samples that never came or were of no use, and were bridged.
    pub missing: u32,
    /// Samples used whose increments were stretched or shrunk by more than a hundredth.
    pub stretched: u32,
    /// Samples with a number that is not finite: not used.
    pub not_finite: u32,
    /// Samples at the end of the sensors' range: not used.
    pub saturated: u32,
    /// Samples with an interval that is zero, or ten times too long or too short: not used.
    pub bad_interval: u32,
    /// Usable samples that showed a fault: the new beginning, whose increments were not given.
    pub begun: u32,
}

impl IntakeCounters {
    /// No sample has come.
    pub const ZERO: Self = Self {
        used: 0,
        repeated: 0,
        late: 0,
        missing: 0,
        stretched: 0,
        not_finite: 0,
        saturated: 0,
        bad_interval: 0,
        begun: 0,
    };
}

/// Why the increments do not follow from those before. The intake has begun anew.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntakeFault {
    /// No sample for longer than can be bridged.
    Silent {
        /// What is missing, ns.
        missing_ns: i64,
    },
    /// Samples that are no numbers for longer than can be bridged.
    NotFinite {
        /// What is missing, ns.
        missing_ns: i64,
    },
    /// Samples at the end of the range for longer than can be bridged.
    Saturated {
        /// What is missing, ns.
        missing_ns: i64,
    },
    /// Time ran backwards or leapt, or the samples' intervals cannot be.
    Time {
        /// Time of the sample minus that of the last one used, ns.
        step_ns: i64,
    },
}

/// A gap that was filled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bridge {
    /// Mean of the rates before and after, over the gap. Comes before the sample's own.
    pub increment: Increment,
    /// Length of the gap, ns.
    pub interval_ns: i64,
    /// About so many samples are missing, at least one.
    pub samples: u32,
}

/// A sample that was used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Taken {
    /// The gap before it, if there was one: the process noise over it is not that of the sensors.
    pub bridge: Option<Bridge>,
    /// Its increments, body axes.
    pub increment: Increment,
    /// Length that they cover, ns.
    pub interval_ns: i64,
    /// End of it.
    pub time: GpsTime,
}

/// Why a sample is of no use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Unusable {
    NotFinite,
    Saturated,
    Interval,
}

/// Unusable samples since the last used one.
#[derive(Clone, Copy, Debug)]
struct Refused {
    not_finite: u32,
    saturated: u32,
    interval: u32,
}

impl Refused {
    const NONE: Self = Self {
        not_finite: 0,
        saturated: 0,
        interval: 0,
    };
}

/// The last sample that was used.
#[derive(Clone, Copy, Debug)]
struct Last {
    /// Its end; nothing before it is used.
    time: GpsTime,
    /// As it came, and its rates in body axes. `None` when unusable samples broke the sequence: the
    /// next usable one begins it.
    sample: Option<(ImuSample, Rates)>,
}

/// Mean rates of a sample, body axes.
#[derive(Clone, Copy, Debug)]
struct Rates {
    angular_b: Vector3<f64>,
    force_b: Vector3<f64>,
}

impl Rates {
    /// What these rates give over a length of time.
    fn over(&self, interval_ns: i64) -> Increment {
        let dt_s = seconds(interval_ns);
        Increment {
            dtheta_b: self.angular_b * dt_s,
            dv_b: self.force_b * dt_s,
            dt_s,
        }
    }

    fn mean(&self, other: &Self) -> Self {
        Self {
            angular_b: (self.angular_b + other.angular_b) * 0.5,
            force_b: (self.force_b + other.force_b) * 0.5,
        }
    }
}

/// The state between samples.
#[derive(Clone, Copy, Debug)]
pub struct Intake {
    nominal_ns: i64,
    c_b_s: Matrix3<f64>,
    max_rate_radps: f64,
    max_force_mps2: f64,
    last: Option<Last>,
    refused: Refused,
    /// Consecutive samples that are late by more than T.
    far_late: u32,
    counters: IntakeCounters,
}

impl Intake {
    /// Refuses every sample until it is configured.
    pub const EMPTY: Self = Self {
        nominal_ns: 0,
        c_b_s: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        max_rate_radps: 0.0,
        max_force_mps2: 0.0,
        last: None,
        refused: Refused::NONE,
        far_late: 0,
        counters: IntakeCounters::ZERO,
    };

    /// Begins with a unit whose configuration has passed [`InertialConfig::check`].
    pub fn configure(&mut self, config: &InertialConfig) {
        self.configure_unit(config.interval_ns, &config.c_b_s, &config.range);
    }

    /// The same from what it needs: nominal interval, ns, mounting, range.
    pub(crate) fn configure_unit(
        &mut self,
        interval_ns: u32,
        c_b_s: &[[f64; 3]; 3],
        range: &SensorRange,
    ) {
        let [[c11, c12, c13], [c21, c22, c23], [c31, c32, c33]] = *c_b_s;
        *self = Self {
            nominal_ns: i64::from(interval_ns),
            c_b_s: Matrix3::new(c11, c12, c13, c21, c22, c23, c31, c32, c33),
            max_rate_radps: range.rate_radps,
            max_force_mps2: range.specific_force_mps2,
            ..Self::EMPTY
        };
    }

    /// What became of the samples since [`Intake::configure`].
    pub fn counters(&self) -> IntakeCounters {
        self.counters
    }

    /// End of the last sample used; `None` before the first. Silence shows here before the next sample
    /// tells.
    pub fn last_time(&self) -> Option<GpsTime> {
        self.last.map(|last| last.time)
    }

    /// All times so far were wrong by this much, ns, as when the week becomes known.
    pub fn shift(&mut self, by_ns: i64) {
        if let Some(last) = &mut self.last {
            last.time = last.time.plus_ns(by_ns);
            if let Some((sample, _)) = &mut last.sample {
                sample.time = sample.time.plus_ns(by_ns);
            }
        }
    }

    /// Takes one sample: `Ok(None)` when it was dropped and counted.
    ///
    /// The first sample of all covers its own interval. After a fault the sample that showed it is the
    /// beginning, its increments are not given; when it is of no use itself, the next usable sample
    /// is, as the first of all.
    ///
    /// # Errors
    /// [`IntakeFault`]; what was built on the increments before must be given up.
    pub fn take(&mut self, sample: &ImuSample) -> Result<Option<Taken>, IntakeFault> {
        let rates = self.rates(sample);
        let Some(last) = self.last else {
            return Ok(match rates {
                Ok(rates) => Some(self.begin(sample, rates)),
                Err(why) => {
                    self.refuse(why);
                    None
                }
            });
        };
        let elapsed_ns = sample.time.ns().saturating_sub(last.time.ns());
        if elapsed_ns <= 0 {
            return self.late(sample, rates, elapsed_ns);
        }
        let rates = match rates {
            Ok(rates) => rates,
            Err(why) => return self.unusable(sample, why, elapsed_ns),
        };
        let Some((last_sample, rates_before)) = last.sample else {
            return Ok(Some(self.begin(sample, rates)));
        };

        let (numerator, denominator) = REPEATED_BEFORE;
        if elapsed_ns.saturating_mul(denominator) < self.nominal_ns * numerator
            && same_content(sample, &last_sample)
        {
            count(&mut self.counters.repeated);
            return Ok(None);
        }
        if elapsed_ns > MAX_SILENCE_NS {
            count(&mut self.counters.begun);
            self.restart(sample, Some(rates));
            return Err(IntakeFault::Time {
                step_ns: elapsed_ns,
            });
        }

        let own_ns = i64::from(sample.interval_ns);
        let missing_ns = elapsed_ns - own_ns;
        if 2 * missing_ns <= self.nominal_ns {
            let stretch = elapsed_ns as f64 / own_ns as f64;
            if libm::fabs(stretch - 1.0) > STRETCH_COUNTED {
                count(&mut self.counters.stretched);
            }
            let increment = if missing_ns == 0 {
                self.own_increment(sample)
            } else {
                rates.over(elapsed_ns)
            };
            return Ok(Some(self.used(sample, rates, None, increment, elapsed_ns)));
        }
        if missing_ns > MAX_BRIDGE_NS {
            let fault = self.fault(missing_ns);
            count(&mut self.counters.begun);
            self.restart(sample, Some(rates));
            return Err(fault);
        }
        let samples = self.samples_in(missing_ns);
        self.counters.missing = self.counters.missing.saturating_add(samples);
        let bridge = Bridge {
            increment: rates_before.mean(&rates).over(missing_ns),
            interval_ns: missing_ns,
            samples,
        };
        let increment = self.own_increment(sample);
        Ok(Some(self.used(
            sample,
            rates,
            Some(bridge),
            increment,
            own_ns,
        )))
    }

    /// Mean rates of a sample, or why it is of no use.
    fn rates(&self, sample: &ImuSample) -> Result<Rates, Unusable> {
        let own_ns = i64::from(sample.interval_ns);
        if own_ns == 0
            || own_ns > self.nominal_ns * MAX_INTERVAL_FACTOR
            || own_ns * MAX_INTERVAL_FACTOR < self.nominal_ns
        {
            return Err(Unusable::Interval);
        }
        let dt_s = seconds(own_ns);
        let all = [
            (sample.dtheta_is_s_rad, self.max_rate_radps * dt_s),
            (sample.dv_is_s_mps, self.max_force_mps2 * dt_s),
        ];
        for (increments, _) in all {
            if !increments.iter().all(|part| part.is_finite()) {
                return Err(Unusable::NotFinite);
            }
        }
        for (increments, end) in all {
            if !increments.iter().all(|part| libm::fabs(*part) < end) {
                return Err(Unusable::Saturated);
            }
        }
        let per_dt = 1.0 / dt_s;
        let own = self.own_increment(sample);
        Ok(Rates {
            angular_b: own.dtheta_b * per_dt,
            force_b: own.dv_b * per_dt,
        })
    }

    /// The sample over its own interval, in body axes.
    fn own_increment(&self, sample: &ImuSample) -> Increment {
        Increment {
            dtheta_b: self.c_b_s * Vector3::from(sample.dtheta_is_s_rad),
            dv_b: self.c_b_s * Vector3::from(sample.dv_is_s_mps),
            dt_s: seconds(i64::from(sample.interval_ns)),
        }
    }

    fn begin(&mut self, sample: &ImuSample, rates: Rates) -> Taken {
        let increment = self.own_increment(sample);
        self.used(
            sample,
            rates,
            None,
            increment,
            i64::from(sample.interval_ns),
        )
    }

    fn used(
        &mut self,
        sample: &ImuSample,
        rates: Rates,
        bridge: Option<Bridge>,
        increment: Increment,
        interval_ns: i64,
    ) -> Taken {
        self.restart(sample, Some(rates));
        count(&mut self.counters.used);
        Taken {
            bridge,
            increment,
            interval_ns,
            time: sample.time,
        }
    }

    /// A sample that is not later than the last one used.
    fn late(
        &mut self,
        sample: &ImuSample,
        rates: Result<Rates, Unusable>,
        elapsed_ns: i64,
    ) -> Result<Option<Taken>, IntakeFault> {
        if elapsed_ns == 0 {
            count(&mut self.counters.repeated);
            return Ok(None);
        }
        count(&mut self.counters.late);
        if elapsed_ns < -self.nominal_ns {
            count(&mut self.far_late);
            if i64::from(self.far_late) * self.nominal_ns > MAX_BRIDGE_NS {
                self.restart(sample, rates.ok());
                return Err(IntakeFault::Time {
                    step_ns: elapsed_ns,
                });
            }
        }
        Ok(None)
    }

    /// A sample of no use: it leaves a gap, which is a fault as soon as it cannot be bridged.
    fn unusable(
        &mut self,
        sample: &ImuSample,
        why: Unusable,
        elapsed_ns: i64,
    ) -> Result<Option<Taken>, IntakeFault> {
        self.refuse(why);
        let unbroken = self.last.is_some_and(|last| last.sample.is_some());
        // After a leap its time is not believed either.
        if unbroken && elapsed_ns > MAX_BRIDGE_NS && elapsed_ns <= MAX_SILENCE_NS {
            let fault = self.fault(elapsed_ns);
            self.restart(sample, None);
            return Err(fault);
        }
        Ok(None)
    }

    fn refuse(&mut self, why: Unusable) {
        let (total, since_used) = match why {
            Unusable::NotFinite => (&mut self.counters.not_finite, &mut self.refused.not_finite),
            Unusable::Saturated => (&mut self.counters.saturated, &mut self.refused.saturated),
            Unusable::Interval => (&mut self.counters.bad_interval, &mut self.refused.interval),
        };
        count(total);
        count(since_used);
    }

    /// What made a gap: what came and was of no use when it makes up half of it, else silence.
    fn fault(&self, missing_ns: i64) -> IntakeFault {
        let Refused {
            not_finite,
            saturated,
            interval,
        } = self.refused;
        let refused = not_finite
            .saturating_add(saturated)
            .saturating_add(interval);
        if refused.saturating_mul(2) < self.samples_in(missing_ns) {
            IntakeFault::Silent { missing_ns }
        } else if not_finite >= saturated && not_finite >= interval {
            IntakeFault::NotFinite { missing_ns }
        } else if saturated >= interval {
            IntakeFault::Saturated { missing_ns }
        } else {
            IntakeFault::Time {
                step_ns: missing_ns,
            }
        }
    }

    /// About how many samples a length of time is, at least one.
    fn samples_in(&self, length_ns: i64) -> u32 {
        let nominal_ns = self.nominal_ns.max(1);
        let samples = (length_ns + nominal_ns / 2) / nominal_ns;
        u32::try_from(samples).unwrap_or(u32::MAX).max(1)
    }

    fn restart(&mut self, sample: &ImuSample, rates: Option<Rates>) {
        self.last = Some(Last {
            time: sample.time,
            sample: rates.map(|rates| (*sample, rates)),
        });
        self.refused = Refused::NONE;
        self.far_late = 0;
    }
}

fn count(counter: &mut u32) {
    *counter = counter.saturating_add(1);
}

fn seconds(interval_ns: i64) -> f64 {
    interval_ns as f64 / NS_PER_S as f64
}

/// The same bits in every increment.
fn same_content(a: &ImuSample, b: &ImuSample) -> bool {
    let same = |a: &[f64; 3], b: &[f64; 3]| a.map(f64::to_bits) == b.map(f64::to_bits);
    same(&a.dtheta_is_s_rad, &b.dtheta_is_s_rad) && same(&a.dv_is_s_mps, &b.dv_is_s_mps)
}
