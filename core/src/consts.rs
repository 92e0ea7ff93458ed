//! Constants of the field, each with its source. Keys: docs/references.md.

/// Speed of light in vacuum, m/s. [IS-GPS-200] 20.3.4.3, exact by definition of the metre.
pub const SPEED_OF_LIGHT_MPS: f64 = 299_792_458.0;

/// Earth rotation rate, rad/s. [IS-GPS-200] table 20-IV, [GAL-OS-SIS-ICD] table 58 (WGS-84, GTRF).
pub const OMEGA_EARTH_RADPS: f64 = 7.292_115_146_7e-5;

/// Earth rotation rate of CGCS2000, rad/s. [BDS-SIS-ICD-B1I] 5.2.4.
pub const OMEGA_EARTH_BDS_RADPS: f64 = 7.292_115_0e-5;

/// Gravitational constant times mass of the Earth for GPS ephemerides, m³/s². [IS-GPS-200] table 20-IV.
pub const MU_GPS: f64 = 3.986_005e14;

/// Gravitational constant times mass of the Earth for Galileo ephemerides, m³/s². [GAL-OS-SIS-ICD] table 58.
pub const MU_GALILEO: f64 = 3.986_004_418e14;

/// Gravitational constant times mass of the Earth for BDS ephemerides, m³/s². [BDS-SIS-ICD-B1I] 5.2.4.
pub const MU_BDS: f64 = 3.986_004_418e14;

/// Semi-major axis of the WGS-84 ellipsoid, m. [NGA.STND.0036] table 3.1.
pub const WGS84_A_M: f64 = 6_378_137.0;

/// Flattening of the WGS-84 ellipsoid. [NGA.STND.0036] table 3.1.
///
/// CGCS2000 has 1/298.257222101; the two ellipsoids differ by 0.1 mm in height, which is nothing
/// beside any level surefix prints.
pub const WGS84_F: f64 = 1.0 / 298.257_223_563;

/// Gravitational constant times mass of the Earth, m³/s². [NGA.STND.0036] table 3.1.
pub const WGS84_MU: f64 = 3.986_004_418e14;

/// Earth rotation rate of inertial navigation, rad/s. [NGA.STND.0036] table 3.1.
pub const OMEGA_EARTH_WGS84_RADPS: f64 = 7.292_115e-5;

/// Second zonal harmonic of the Earth's gravitation. [GROVES-2013] chapter 2.
pub const WGS84_J2: f64 = 1.082_627e-3;

/// Most satellites one epoch holds: GPS, BDS and Galileo average 32 in the open sky of Europe.
pub const MAX_SATELLITES: usize = 48;

/// Most signals kept of one satellite.
pub const MAX_SIGNALS: usize = 6;

/// Most receiver clock columns of a solution: one per constellation.
pub const MAX_CLOCKS: usize = 3;

/// Columns of the snapshot solution: three of position and one per clock.
pub const MAX_UNKNOWNS: usize = 3 + MAX_CLOCKS;
