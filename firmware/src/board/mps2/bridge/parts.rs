//! The drivers on this bus.

use crate::sensors::Parts;

/// For `init`, once.
pub fn parts() -> Parts<'static> {
    Parts::default()
}
