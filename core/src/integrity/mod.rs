//! What a pilot may rely on: phases of flight and their limits, reasons, the verdict.

pub mod opinion;
pub mod phases;
pub mod verdict;

pub use opinion::{BankOpinion, Opinions};
pub use phases::{Phase, PhaseRequirements};
pub use verdict::{
    InertialStatus, Integrity, Mode, NoBound, ProtectionLevel, Reason, Suspect, Verdict,
};
