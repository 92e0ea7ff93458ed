//! What goes wrong with one of several inertial units: `UNIT:KIND:MAG:T0:T1[:AXIS]`.
//!
//! | kind | what the unit gives for T0 ≤ t < T1 | MAG |
//! |---|---|---|
//! | step | a further bias | °/s or m/s² |
//! | drift | a bias that grows from T0 on | °/s or m/s² per second |
//! | scale | 1 + MAG times the truth | 1 |
//! | stuck | the rate of the last sample before | not used |
//! | noise | white noise MAG times as strong | 1 |
//! | silence | nothing | not used |
//! | offset | what was MAG earlier, with the time of now | s |
//!
//! AXIS is one of gx, gy, gz (gyroscopes), ax, ay, az (accelerometers) in the unit's axes, gz unless given;
//! silence and offset are of the whole unit.

use std::fmt;
use std::str::FromStr;

use anyhow::{Context, Result, bail};
use surefix_core::ins::MAX_UNITS;

/// Kinds of faults.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "lowercase")]
pub enum UnitFaultKind {
    /// A further bias.
    Step,
    /// A bias that grows.
    Drift,
    /// A wrong scale factor.
    Scale,
    /// An axis that repeats itself.
    Stuck,
    /// More noise.
    Noise,
    /// No samples.
    Silence,
    /// Measurements of another time than they say.
    Offset,
}

impl UnitFaultKind {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::Step,
        Self::Drift,
        Self::Scale,
        Self::Stuck,
        Self::Noise,
        Self::Silence,
        Self::Offset,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Step => "step",
            Self::Drift => "drift",
            Self::Scale => "scale",
            Self::Stuck => "stuck",
            Self::Noise => "noise",
            Self::Silence => "silence",
            Self::Offset => "offset",
        }
    }
}

/// Names of the axes, gyroscopes first.
pub const AXES: [&str; 6] = ["gx", "gy", "gz", "ax", "ay", "az"];

/// A fault of one unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitFaultSpec {
    /// Number of the unit, from 0.
    pub unit: usize,
    /// What.
    pub kind: UnitFaultKind,
    /// How much, in SI units: rad/s or m/s², per second, a ratio, s.
    pub magnitude: f64,
    /// Start, s.
    pub t0_s: f64,
    /// End, s; not part of the fault.
    pub t1_s: f64,
    /// Place of the axis in [`AXES`].
    pub axis: usize,
}

impl UnitFaultSpec {
    /// Whether it is there at a time.
    pub fn is_at(&self, t_s: f64) -> bool {
        t_s >= self.t0_s && t_s < self.t1_s
    }
}

/// SI units per unit of the command line.
fn per_unit(kind: UnitFaultKind, axis: usize) -> f64 {
    let is_rate = matches!(kind, UnitFaultKind::Step | UnitFaultKind::Drift);
    if is_rate && axis < 3 {
        core::f64::consts::PI / 180.0
    } else {
        1.0
    }
}

impl FromStr for UnitFaultSpec {
    type Err = anyhow::Error;

    fn from_str(spec: &str) -> Result<Self> {
        let usage = || format!("--imu-fault \"{spec}\" is not UNIT:KIND:MAG:T0:T1[:AXIS]");
        let parts: Vec<&str> = spec.split(':').collect();
        let (unit, kind, numbers, axis) = match parts.as_slice() {
            [unit, kind, magnitude, t0, t1] => (unit, kind, [magnitude, t0, t1], "gz"),
            [unit, kind, magnitude, t0, t1, axis] => (unit, kind, [magnitude, t0, t1], *axis),
            _ => bail!("{}", usage()),
        };
        let unit: usize = unit.parse().with_context(usage)?;
        if unit >= MAX_UNITS {
            bail!("{}: units are 0 to {}", usage(), MAX_UNITS - 1);
        }
        let kind = UnitFaultKind::ALL
            .into_iter()
            .find(|known| known.name() == *kind)
            .with_context(|| {
                let names = UnitFaultKind::ALL.map(UnitFaultKind::name).join(", ");
                format!("{}: KIND is one of {names}", usage())
            })?;
        let axis = AXES
            .iter()
            .position(|known| *known == axis)
            .with_context(|| format!("{}: AXIS is one of {}", usage(), AXES.join(", ")))?;
        let mut values = [0.0; 3];
        for (value, text) in values.iter_mut().zip(numbers) {
            *value = text
                .parse::<f64>()
                .ok()
                .filter(|value| value.is_finite())
                .with_context(|| format!("{}: \"{text}\" is no number", usage()))?;
        }
        let [magnitude, t0_s, t1_s] = values;
        if t1_s <= t0_s {
            bail!("{}: it ends before it starts", usage());
        }
        if kind == UnitFaultKind::Noise && magnitude < 1.0 {
            bail!("{}: noise is multiplied by 1 at least", usage());
        }
        Ok(Self {
            unit,
            kind,
            magnitude: magnitude * per_unit(kind, axis),
            t0_s,
            t1_s,
            axis,
        })
    }
}

impl fmt::Display for UnitFaultSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{}:{}:{}:{}:{}:{}",
            self.unit,
            self.kind.name(),
            self.magnitude / per_unit(self.kind, self.axis),
            self.t0_s,
            self.t1_s,
            AXES[self.axis]
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn specifications_read_back() {
        for text in [
            "1:step:0.5:100:200:gx",
            "0:drift:0.001:1:2:az",
            "2:scale:-0.01:0:9:gz",
            "2:offset:0.01:0:9:gz",
        ] {
            let spec: UnitFaultSpec = text.parse().unwrap();
            assert_eq!(spec.to_string(), text);
        }
        let spec: UnitFaultSpec = "1:step:180:1:2".parse().unwrap();
        assert_eq!((spec.axis, spec.magnitude), (2, core::f64::consts::PI));
    }

    #[test]
    fn what_cannot_be_is_refused_with_what_can() {
        for (text, word) in [
            ("3:step:1:0:1", "0 to 2"),
            ("0:leap:1:0:1", "silence"),
            ("0:step:x:0:1", "\"x\""),
            ("0:step:1:1:1", "before"),
            ("0:step:1:0:1:mx", "gx"),
            ("0:noise:0.5:0:1", "at least"),
            ("0:step", "AXIS"),
        ] {
            let error = text.parse::<UnitFaultSpec>().unwrap_err();
            assert!(format!("{error:#}").contains(word), "{error:#}");
        }
    }
}
