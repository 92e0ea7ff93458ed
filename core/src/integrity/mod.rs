//! What a pilot may rely on: phases of flight and their limits, reasons, the verdict, and how long an alert lasts.

pub mod alert;
pub mod opinion;
pub mod phases;
pub mod verdict;

pub use alert::{AlertEvent, AlertState, Alerts};
pub use opinion::{BankOpinion, Opinions};
pub use phases::{Phase, PhaseRequirements};
pub use verdict::{
    InertialStatus, Integrity, Mode, NoBound, ProtectionLevel, Reason, Suspect, Verdict,
};
