//! Inertial navigation: samples of a unit of gyroscopes and accelerometers to position, velocity and
//! attitude in ECEF.
//!
//! Frames: i inertial, e ECEF, b body (forward, right, down), s the axes of the inertial unit as it is
//! mounted.

pub mod aiding;
pub mod aids;
pub mod alignment;
pub mod barometer;
pub mod gravity;
pub(crate) mod horizon;
pub mod intake;
pub mod mechanisation;
pub mod sample;
pub mod sample_clock;
pub mod stationarity;
pub mod unit;
pub mod voting;

pub use aiding::{MagneticSample, PressureSample};
pub use aids::{AidUse, AidsConfig, AidsConfigError, BarometerModel, ZeroVelocityModel};
pub use alignment::{CoarseAlignment, Magnetometer, NotAligned};
pub use barometer::{Barometer, PressureHeight};
pub use horizon::{HorizonState, MAX_LATENCY_NS};
pub use intake::{Bridge, Intake, IntakeCounters, IntakeFault, Taken};
pub use mechanisation::{Increment, Mechanisation, Step};
pub use sample::{
    AttitudeStart, ClockNoise, ImuSample, InertialConfig, InertialConfigError, InertialNoise,
    InitialSigma, InitialState, MeasurementFactors, ReferenceModel, SensorRange,
};
pub use sample_clock::{NoTime, SampleClock, SampleClockCounters, SampleClockState};
pub use stationarity::{Scatter, Stationarity};
pub use unit::{MAX_UNITS, UnitSample};
pub use voting::{
    UnitConfig, UnitFault, UnitState, UnitTolerance, Voting, VotingConfigureError, VotingMode,
};
