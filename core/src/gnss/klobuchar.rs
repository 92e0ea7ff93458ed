//! Broadcast parameters of the Klobuchar ionosphere model.

use super::System;

/// The eight parameters of one system's broadcast. [IS-GPS-200] 20.3.3.5.1.7, [BDS-SIS-ICD-B1I] 5.2.4.7.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KlobucharParameters {
    /// Who broadcast them: [`System::Gps`] or [`System::Bds`]; Galileo broadcasts another model.
    pub system: System,
    /// α0 to α3: s, s/semicircle, s/semicircle², s/semicircle³ (BDS: per π rad, which is the same).
    pub alpha: [f64; 4],
    /// β0 to β3: s, s/semicircle, s/semicircle², s/semicircle³.
    pub beta: [f64; 4],
}
