//! Coarse initial attitude: given, from the course over ground, the rotation of the Earth, or the magnetic
//! field; with its accuracy, or why there is none.
//!
//! In: increments and magnetic samples as they come, and at an epoch the receiver's position and velocity.
//! Out: the rotation from body to ECEF with one sigma about north, east, down.
//!
//! | symbol | code                | shape | unit  | frame | meaning                                     |
//! |--------|---------------------|-------|-------|-------|---------------------------------------------|
//! | f      | `force_b`, `force_n`| 3     | m/s²  | b, n  | mean specific force: of the unit in the axes of the end of its window, and v̇ + 2ω×v − g by the receiver |
//! | T      | `window_s`          |       | s     |       | length of the window                        |
//! | b_a, b_g | `accel_bias_mps2`, `gyro_bias_radps` | | | | one sigma of the biases                     |
//! | N_a, N_g | `noise.vrw`, `noise.arw` |  |       |       | velocity and angle random walk              |
//! | σ_v    | `sigma_enu_mps`     | 3     | m/s   | enu   | one sigma of the receiver's velocity        |
//! | σ_s    | `allowance_ned_rad` | 3     | rad   | n     | configured: side-slip, vibration            |
//!
//! | mode | needs | roll and pitch, σ_l | heading, σ_ψ |
//! |---|---|---|---|
//! | given | | as configured | as configured |
//! | course | motion, window between two epochs | (b_a ⊕ N_a/√T ⊕ √2 σ_v/T ⊕ g b_g T/2)/f ⊕ σ_ψ f_h/f ⊕ σ_s | σ_v across the course/speed ⊕ σ_s |
//! | gyrocompass | rest ([`MIN_GYROCOMPASS_S`] at least) | (b_a ⊕ N_a/√T)/g | (b_g ⊕ N_g/√T)/(Ω cos φ) ⊕ σ_l tan φ |
//! | magnetic field | rest or motion | as at rest, or as with the course | σ_m/(F cos I) ⊕ σ_l tan I ⊕ σ_D |
//!
//! ⊕ is the root of the sum of squares, f_h the horizontal part of f. Turning within a window between epochs is followed by the
//! gyroscopes, so that the vehicle may manoeuvre. The walk of a bias adds the mean that it has over T. The
//! heading of a gyrocompass is that of a triad (`alignment/vectors.rs`) of gravity and the rotation of the Earth:
//! [GROVES-2013] chapter 5 has the same attitude in another form; all sigmas are derived here
//! (docs/decisions/016-alignment.md). Keys: docs/references.md.
//! Assumes: at rest the unit does not turn but for what `alignment/rest.rs` can see. Modes that are allowed are tried in
//! the order course, gyrocompass, magnetic field: the first that has an answer gives it.

mod course;
mod magnetometer;
mod outcome;
mod rest;
mod vectors;

use super::{AttitudeStart, Increment, InertialConfig, InertialNoise, MagneticSample};
use crate::consts::OMEGA_EARTH_WGS84_RADPS as OMEGA;
use crate::frames::geodesy::to_llh;
use crate::frames::rotation::{self, Quaternion};
use crate::ins::gravity::gravity_e;
use crate::time::{GpsTime, NS_PER_S};
use nalgebra::{Matrix3, Vector3};

pub use magnetometer::{DECLINATION_CHANGE_RAD_PER_Y, Magnetometer, MagnetometerError};
pub use outcome::{Aligned, AlignmentMode, NotAligned, Obstacle};
use rest::Rest;
use vectors::Pairs;

/// Shortest window, ns: less than a second, for receivers whose epochs jitter.
pub const MIN_WINDOW_NS: i64 = NS_PER_S - NS_PER_S / 20;
/// Longest window, ns: what is longer has a gap in it.
pub const MAX_WINDOW_NS: i64 = 5 * NS_PER_S / 2;
/// Shortest rest that a gyrocompass needs, s: what turns the unit unseen counts for less the longer it is.
pub const MIN_GYROCOMPASS_S: f64 = 60.0;
/// Largest one sigma of a heading to start a filter from, rad: 30°, beyond which a filter that is linear in its
/// errors may lose itself (docs/decisions/016-alignment.md).
pub const MAX_HEADING_SIGMA_RAD: f64 = core::f64::consts::FRAC_PI_6;
/// Slowest course an attitude that was lost is found again by, m/s, where none is configured.
const RESTART_SPEED_MPS: f64 = 2.0;
/// Largest one sigma of a heading by the rotation of the Earth after a given one was lost, rad: 10°.
const RESTART_GYROCOMPASS_RAD: f64 = 10.0 * core::f64::consts::PI / 180.0;
/// Increments may cover the window but for this part of it.
const MAX_UNCOVERED: f64 = 0.05;
/// A vector that is farther from what it is taken for, in sigmas, is something else.
const MAX_MISMATCH_SIGMAS: f64 = 5.0;
/// A receiver that stands may tell of a velocity of this many of its sigmas, and of this besides, m/s.
const REST_SIGMAS: f64 = 4.0;
/// See [`REST_SIGMAS`].
const REST_SPEED_MPS: f64 = 0.05;

const ZERO: Vector3<f64> = Vector3::new(0.0, 0.0, 0.0);

/// What errors a unit may have.
#[derive(Clone, Copy, Debug)]
struct UnitErrors {
    noise: InertialNoise,
    gyro_bias_radps: f64,
    accel_bias_mps2: f64,
}

/// What the receiver knows at an epoch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignmentEpoch {
    /// When.
    pub time: GpsTime,
    /// Position, ECEF, m.
    pub r_e: Vector3<f64>,
    /// Velocity east, north, up, m/s, where the receiver has one.
    pub v_enu: Option<Vector3<f64>>,
    /// One sigma of it, m/s.
    pub sigma_enu_mps: [f64; 3],
}

/// An epoch that begins a window.
#[derive(Clone, Copy, Debug)]
struct Begin {
    time: GpsTime,
    v_e: Vector3<f64>,
}

/// Sums of the magnetic field, body axes, µT.
#[derive(Clone, Copy, Debug)]
struct FieldSum {
    sum_b_ut: Vector3<f64>,
    samples: f64,
}

impl FieldSum {
    const NONE: Self = Self {
        sum_b_ut: ZERO,
        samples: 0.0,
    };

    fn add(&mut self, field_b_ut: &Vector3<f64>) {
        self.sum_b_ut += field_b_ut;
        self.samples += 1.0;
    }

    fn mean(&self) -> Option<Vector3<f64>> {
        (self.samples > 0.0).then(|| self.sum_b_ut / self.samples)
    }
}

/// Where an epoch is.
struct Place {
    lat_rad: f64,
    c_e_n: Matrix3<f64>,
    gravity_n: Vector3<f64>,
}

/// A window between two epochs, in motion or not.
struct Motion {
    window_s: f64,
    force_b: Vector3<f64>,
    force_n: Vector3<f64>,
    v_n: Vector3<f64>,
    speed_mps: f64,
    field_b_ut: Option<Vector3<f64>>,
}

/// A specific force in both axes, with one sigma of its direction.
struct Levelled {
    force_b: Vector3<f64>,
    force_n: Vector3<f64>,
    sigma_level_rad: f64,
}

/// Sums since the window began, and since rest began.
#[derive(Clone, Copy, Debug)]
pub struct CoarseAlignment {
    start: AttitudeStart,
    /// An attitude was lost: a given one is not given any more, and any course will do.
    is_resumed: bool,
    unit: UnitErrors,
    allowance_ned_rad: [f64; 3],
    magnetometer: Option<Magnetometer>,
    trusts_field: bool,
    begin: Option<Begin>,
    /// Integral of the specific force, in the body axes of now.
    dv_b: Vector3<f64>,
    covered_s: f64,
    /// Of the same window, in the body axes of now.
    field: FieldSum,
    rest: Rest,
    field_at_rest: FieldSum,
}

impl CoarseAlignment {
    /// Never finds an attitude until it is configured.
    pub const EMPTY: Self = Self {
        start: AttitudeStart::Course {
            min_speed_mps: f64::INFINITY,
        },
        is_resumed: false,
        unit: UnitErrors {
            noise: InertialNoise {
                arw: 0.0,
                vrw: 0.0,
                gyro_bias_walk: 0.0,
                accel_bias_walk: 0.0,
            },
            gyro_bias_radps: 0.0,
            accel_bias_mps2: 0.0,
        },
        allowance_ned_rad: [0.0; 3],
        magnetometer: None,
        trusts_field: true,
        begin: None,
        dv_b: ZERO,
        covered_s: 0.0,
        field: FieldSum::NONE,
        rest: Rest::NONE,
        field_at_rest: FieldSum::NONE,
    };

    /// Begins anew, with a unit whose configuration has passed [`InertialConfig::check`]. The magnetometer stays.
    pub fn configure(&mut self, config: &InertialConfig) {
        *self = Self {
            start: config.start,
            unit: UnitErrors {
                noise: config.noise,
                gyro_bias_radps: config.sigma.gyro_bias_radps,
                accel_bias_mps2: config.sigma.accel_bias_mps2,
            },
            allowance_ned_rad: config.sigma.attitude_ned_rad,
            magnetometer: self.magnetometer,
            ..Self::EMPTY
        };
    }

    /// There is a magnetometer, whose configuration has passed [`Magnetometer::check`].
    pub fn set_magnetometer(&mut self, magnetometer: &Magnetometer) {
        self.magnetometer = Some(*magnetometer);
        self.field = FieldSum::NONE;
        self.field_at_rest = FieldSum::NONE;
    }

    /// Begins anew after an attitude was lost. `trusts_field` is false where it was the magnetic field that was
    /// wrong: it is not asked again.
    pub fn resume(&mut self, trusts_field: bool) {
        self.is_resumed = true;
        self.trusts_field = self.trusts_field && trusts_field;
        self.restart();
    }

    /// Forgets the window and the rest: the increments do not follow each other, or begin anew.
    pub fn restart(&mut self) {
        self.begin = None;
        self.rest = Rest::NONE;
        self.field = FieldSum::NONE;
        self.field_at_rest = FieldSum::NONE;
    }

    /// Takes the increments of a sample, or of a bridged gap.
    pub fn accumulate(&mut self, increment: &Increment) {
        // Into the axes of the end of the sample; of its own velocity, half the turn.
        let phi = increment.dtheta_b;
        let back = rotation::to_matrix(&rotation::from_rotation_vector(&-phi));
        self.dv_b = back * self.dv_b + increment.dv_b - phi.cross(&increment.dv_b) * 0.5;
        self.covered_s += increment.dt_s;
        self.field.sum_b_ut = back * self.field.sum_b_ut;
        if self.rest.add(increment, &self.unit) == Some(false) {
            self.field_at_rest = FieldSum::NONE;
        }
    }

    /// Takes a sample of the magnetometer, where one is configured. One that is no number is not taken.
    pub fn on_field(&mut self, sample: &MagneticSample) {
        let Some(magnetometer) = &self.magnetometer else {
            return;
        };
        let field_b_ut = magnetometer.calibrated(sample.field_s_ut);
        if field_b_ut.iter().all(|part| part.is_finite()) {
            self.field.add(&field_b_ut);
            self.field_at_rest.add(&field_b_ut);
        }
    }

    /// How long the unit has been at rest by its samples, s.
    pub const fn rest_s(&self) -> f64 {
        self.rest.duration_s()
    }

    /// Slowest course that is taken, m/s.
    fn min_speed_mps(&self) -> Option<f64> {
        match self.start {
            AttitudeStart::Course { min_speed_mps }
            | AttitudeStart::Automatic { min_speed_mps, .. } => Some(min_speed_mps),
            AttitudeStart::Given { .. }
            | AttitudeStart::Gyrocompass { .. }
            | AttitudeStart::MagneticField => self.is_resumed.then_some(RESTART_SPEED_MPS),
        }
    }

    /// Largest one sigma of a heading by the rotation of the Earth, rad, where that is asked.
    fn max_gyrocompass_rad(&self) -> Option<f64> {
        match self.start {
            AttitudeStart::Gyrocompass {
                max_heading_sigma_rad,
            }
            | AttitudeStart::Automatic {
                max_heading_sigma_rad,
                ..
            } => Some(max_heading_sigma_rad),
            AttitudeStart::Given { .. } => self.is_resumed.then_some(RESTART_GYROCOMPASS_RAD),
            AttitudeStart::Course { .. } | AttitudeStart::MagneticField => None,
        }
    }

    fn asks_field(&self) -> bool {
        self.trusts_field
            && matches!(
                self.start,
                AttitudeStart::MagneticField | AttitudeStart::Automatic { .. }
            )
    }

    /// The attitude at an epoch.
    ///
    /// # Errors
    /// [`NotAligned`]; the next epochs may have more.
    pub fn epoch(&mut self, at: &AlignmentEpoch) -> Result<Aligned, NotAligned> {
        let place = place(&at.r_e)?;
        if let (
            AttitudeStart::Given {
                roll_pitch_heading_rad,
            },
            false,
        ) = (&self.start, self.is_resumed)
        {
            let c_n_b = rotation::c_n_b(roll_pitch_heading_rad);
            return aligned(&place, &c_n_b, self.allowance_ned_rad, AlignmentMode::Given);
        }
        let Some(v_enu) = &at.v_enu else {
            self.restart();
            return Err(NotAligned::Window);
        };
        if !is_slow(v_enu, &at.sigma_enu_mps) {
            self.rest = Rest::NONE;
            self.field_at_rest = FieldSum::NONE;
        }
        let motion = self.window(at, v_enu, &place);
        if let (Ok(motion), Some(min_speed_mps)) = (&motion, self.min_speed_mps())
            && motion.speed_mps >= min_speed_mps
            && motion.speed_mps > 0.0
        {
            return self.by_course(motion, &at.sigma_enu_mps, &place);
        }
        let standing = self.standing(at.time, &place);
        if standing.is_ok() {
            return standing;
        }
        match (motion, standing) {
            (Ok(motion), _) if self.asks_field() && self.rest.duration_s() <= 0.0 => {
                let level = self.level_in_motion(&motion, &at.sigma_enu_mps);
                self.by_field(&level, motion.field_b_ut, at.time, &place)
            }
            // Of a unit at rest its own reason, if it asks anything that is asked at rest.
            (_, Err(why)) if why != NotAligned::Moving => Err(why),
            (Err(why), _) => Err(why),
            (Ok(motion), _) if self.min_speed_mps().is_some() => Err(NotAligned::TooSlow {
                speed_mps: motion.speed_mps,
            }),
            (Ok(_), _) => Err(NotAligned::Moving),
        }
    }

    /// Roll and pitch of a unit at rest, with a heading that is known otherwise: one sigma of it, rad.
    ///
    /// # Errors
    /// [`NotAligned::Moving`] when it has not been at rest for a second.
    pub fn with_heading(
        &self,
        r_e: &Vector3<f64>,
        heading_rad: f64,
        sigma_heading_rad: f64,
    ) -> Result<Aligned, NotAligned> {
        let place = place(r_e)?;
        let level = self.level_at_rest(&place).ok_or(NotAligned::Moving)?;
        let c_h_n = rotation::c_n_b(&[0.0, 0.0, heading_rad]).transpose();
        let [roll, pitch] = course::roll_and_pitch(&level.force_b, &(c_h_n * level.force_n))?;
        let sigma_ned_rad =
            vectors::sigma_ned_rad(&level.force_n, level.sigma_level_rad, sigma_heading_rad);
        let c_n_b = rotation::c_n_b(&[roll, pitch, heading_rad]);
        aligned(&place, &c_n_b, sigma_ned_rad, AlignmentMode::Kept)
    }

    /// Closes the window between the last epoch and this.
    fn window(
        &mut self,
        at: &AlignmentEpoch,
        v_enu: &Vector3<f64>,
        place: &Place,
    ) -> Result<Motion, NotAligned> {
        let v_n = Vector3::new(v_enu.y, v_enu.x, -v_enu.z);
        let v_e = place.c_e_n * v_n;
        let elapsed_ns = self
            .begin
            .map(|begin| at.time.ns().saturating_sub(begin.time.ns()));
        if elapsed_ns.is_some_and(|ns| (0..MIN_WINDOW_NS).contains(&ns)) {
            return Err(NotAligned::Window);
        }
        let (dv_b, covered_s) = (self.dv_b, self.covered_s);
        let begin = self.begin.replace(Begin { time: at.time, v_e });
        (self.dv_b, self.covered_s) = (ZERO, 0.0);
        let field_b_ut = core::mem::replace(&mut self.field, FieldSum::NONE).mean();
        let begin = begin
            .filter(|_| elapsed_ns.is_some_and(|ns| (MIN_WINDOW_NS..=MAX_WINDOW_NS).contains(&ns)))
            .ok_or(NotAligned::Window)?;
        let window_s = at.time.seconds_since(begin.time);
        if !(libm::fabs(covered_s - window_s) <= MAX_UNCOVERED * window_s) {
            return Err(NotAligned::SamplesMissing { covered_s });
        }
        let v_mean = (v_e + begin.v_e) * 0.5;
        let coriolis = Vector3::new(-2.0 * OMEGA * v_mean.y, 2.0 * OMEGA * v_mean.x, 0.0);
        let force_e = (v_e - begin.v_e) / window_s + coriolis - gravity_e(&at.r_e);
        Ok(Motion {
            window_s,
            force_b: dv_b / covered_s,
            force_n: place.c_e_n.transpose() * force_e,
            v_n,
            speed_mps: libm::sqrt(v_n.x * v_n.x + v_n.y * v_n.y),
            field_b_ut,
        })
    }

    /// How well a window in motion shows where its specific force points.
    fn level_in_motion(&self, motion: &Motion, sigma_enu_mps: &[f64; 3]) -> Levelled {
        let [sigma_east, sigma_north, _] = *sigma_enu_mps;
        let t_s = motion.window_s;
        let force_mps2 = motion.force_n.norm();
        let white = self.unit.noise.vrw * self.unit.noise.vrw / t_s;
        // Two velocities in each of two directions.
        let receiver = (sigma_east * sigma_east + sigma_north * sigma_north) / (t_s * t_s);
        let turned = 0.5 * force_mps2 * self.unit.gyro_bias_radps * t_s;
        let bias = self.unit.accel_bias_mps2;
        Levelled {
            force_b: motion.force_b,
            force_n: motion.force_n,
            sigma_level_rad: libm::sqrt(bias * bias + white + receiver + turned * turned)
                / force_mps2,
        }
    }

    /// A unit that stands shows where up is; `None` while it does not.
    fn level_at_rest(&self, place: &Place) -> Option<Levelled> {
        if !(self.rest.duration_s() > 0.0) {
            return None;
        }
        let (force_b, _) = self.rest.means();
        Some(Levelled {
            force_b,
            force_n: -place.gravity_n,
            sigma_level_rad: self.rest.sigma_force_mps2(&self.unit) / place.gravity_n.norm(),
        })
    }

    fn by_course(
        &self,
        motion: &Motion,
        sigma_enu_mps: &[f64; 3],
        place: &Place,
    ) -> Result<Aligned, NotAligned> {
        let heading = libm::atan2(motion.v_n.y, motion.v_n.x);
        let c_h_n = rotation::c_n_b(&[0.0, 0.0, heading]).transpose();
        let force_h = c_h_n * motion.force_n;
        let [roll, pitch] = course::roll_and_pitch(&motion.force_b, &force_h)?;
        let (sin, cos) = libm::sincos(heading);
        let [sigma_east, sigma_north, _] = *sigma_enu_mps;
        let across_mps = libm::hypot(sigma_east * cos, sigma_north * sin);
        let [slack_north, slack_east, side_slip] = self.allowance_ned_rad;
        let sigma_heading = libm::hypot(across_mps / motion.speed_mps, side_slip);
        if !(sigma_heading <= MAX_HEADING_SIGMA_RAD) {
            return Err(NotAligned::HeadingTooUncertain {
                sigma_rad: sigma_heading,
            });
        }
        let level = self.level_in_motion(motion, sigma_enu_mps);
        // A wrong heading turns the horizontal force, and the level follows it.
        let horizontal = libm::hypot(force_h.x, force_h.y) / force_h.norm();
        let sigma_level = libm::hypot(level.sigma_level_rad, sigma_heading * horizontal);
        let sigma_ned_rad = [
            libm::hypot(sigma_level, slack_north),
            libm::hypot(sigma_level, slack_east),
            sigma_heading,
        ];
        let c_n_b = rotation::c_n_b(&[roll, pitch, heading]);
        aligned(place, &c_n_b, sigma_ned_rad, AlignmentMode::Course)
    }

    /// What is asked of a unit at rest.
    fn standing(&self, time: GpsTime, place: &Place) -> Result<Aligned, NotAligned> {
        let level = self.level_at_rest(place).ok_or(NotAligned::Moving)?;
        let by_rotation = self
            .max_gyrocompass_rad()
            .map(|max_rad| self.by_rotation(&level, max_rad, place));
        match by_rotation {
            Some(Ok(found)) => Ok(found),
            Some(Err(why)) if !self.asks_field() => Err(why),
            None if !self.asks_field() => Err(NotAligned::Moving),
            _ => self.by_field(&level, self.field_at_rest.mean(), time, place),
        }
    }

    fn by_rotation(
        &self,
        level: &Levelled,
        max_rad: f64,
        place: &Place,
    ) -> Result<Aligned, NotAligned> {
        let (sin_lat, cos_lat) = libm::sincos(place.lat_rad);
        // No patience makes good for a bias.
        let least_rad = self.unit.gyro_bias_radps / (OMEGA * cos_lat);
        if !(least_rad <= max_rad) {
            return Err(NotAligned::HeadingTooUncertain {
                sigma_rad: least_rad,
            });
        }
        let duration_s = self.rest.duration_s();
        if !(duration_s >= MIN_GYROCOMPASS_S) {
            return Err(NotAligned::RestTooShort { duration_s });
        }
        let (_, rate_b) = self.rest.means();
        let pairs = Pairs {
            force_b: level.force_b,
            force_n: level.force_n,
            sigma_level_rad: level.sigma_level_rad,
            second_b: rate_b,
            second_n: Vector3::new(OMEGA * cos_lat, 0.0, -OMEGA * sin_lat),
            sigma_second: self.rest.sigma_rate_radps(&self.unit),
        };
        let sigma_rad = pairs.sigma_about_force_rad();
        if !(sigma_rad <= max_rad) {
            return Err(NotAligned::HeadingTooUncertain { sigma_rad });
        }
        let mismatch = pairs.mismatch();
        if !mismatch.is_within(MAX_MISMATCH_SIGMAS) {
            return Err(NotAligned::EarthRateMismatch {
                length_sigmas: mismatch.length_sigmas,
                angle_sigmas: mismatch.angle_sigmas,
            });
        }
        self.by_pairs(&pairs, sigma_rad, AlignmentMode::Gyrocompass, place)
    }

    fn by_field(
        &self,
        level: &Levelled,
        field_b_ut: Option<Vector3<f64>>,
        time: GpsTime,
        place: &Place,
    ) -> Result<Aligned, NotAligned> {
        let (Some(magnetometer), Some(field_b_ut)) = (&self.magnetometer, field_b_ut) else {
            return Err(NotAligned::NoField);
        };
        let difference_mps2 = level.force_b.norm() - level.force_n.norm();
        if !(libm::fabs(difference_mps2) <= course::MAX_FORCE_DIFFERENCE_MPS2) {
            return Err(NotAligned::ForceMismatch { difference_mps2 });
        }
        let pairs = Pairs {
            force_b: level.force_b,
            force_n: level.force_n,
            sigma_level_rad: level.sigma_level_rad,
            second_b: field_b_ut,
            second_n: magnetometer.field_n_ut(),
            sigma_second: magnetometer.sigma_ut,
        };
        let mismatch = pairs.mismatch();
        if !mismatch.is_within(MAX_MISMATCH_SIGMAS) {
            return Err(NotAligned::FieldMismatch {
                length_sigmas: mismatch.length_sigmas,
                angle_sigmas: mismatch.angle_sigmas,
            });
        }
        let sigma_rad = libm::hypot(
            pairs.sigma_about_force_rad(),
            magnetometer.sigma_declination_rad(time),
        );
        if !(sigma_rad <= MAX_HEADING_SIGMA_RAD) {
            return Err(NotAligned::HeadingTooUncertain { sigma_rad });
        }
        self.by_pairs(&pairs, sigma_rad, AlignmentMode::MagneticField, place)
    }

    fn by_pairs(
        &self,
        pairs: &Pairs,
        sigma_heading_rad: f64,
        mode: AlignmentMode,
        place: &Place,
    ) -> Result<Aligned, NotAligned> {
        let c_n_b = pairs.c_n_b().ok_or(NotAligned::NotFinite)?;
        let sigma_ned_rad =
            vectors::sigma_ned_rad(&pairs.force_n, pairs.sigma_level_rad, sigma_heading_rad);
        aligned(place, &c_n_b, sigma_ned_rad, mode)
    }
}

fn place(r_e: &Vector3<f64>) -> Result<Place, NotAligned> {
    let llh = to_llh(r_e).map_err(NotAligned::Position)?;
    let c_e_n = rotation::c_e_n(llh.lat_rad, llh.lon_rad);
    Ok(Place {
        lat_rad: llh.lat_rad,
        c_e_n,
        gravity_n: c_e_n.transpose() * gravity_e(r_e),
    })
}

/// Whether a velocity may be that of a receiver at rest.
pub(crate) fn is_slow(v_enu: &Vector3<f64>, sigma_enu_mps: &[f64; 3]) -> bool {
    v_enu
        .iter()
        .zip(sigma_enu_mps)
        .all(|(part, sigma)| libm::fabs(*part) <= REST_SIGMAS * sigma + REST_SPEED_MPS)
}

fn aligned(
    place: &Place,
    c_n_b: &Matrix3<f64>,
    sigma_ned_rad: [f64; 3],
    mode: AlignmentMode,
) -> Result<Aligned, NotAligned> {
    let q_e_b: Quaternion =
        rotation::from_matrix(&(place.c_e_n * c_n_b)).ok_or(NotAligned::NotFinite)?;
    if sigma_ned_rad.iter().all(|s| *s > 0.0 && s.is_finite()) {
        Ok(Aligned {
            q_e_b,
            sigma_ned_rad,
            mode,
        })
    } else {
        Err(NotAligned::NotFinite)
    }
}

#[cfg(test)]
mod tests;
