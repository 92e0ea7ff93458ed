//! What several test files share.

use std::path::{Path, PathBuf};

/// A file of `../shared` beside the workspace, or `None`, said aloud, where it is absent.
pub fn shared(relative: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../shared")
        .join(relative);
    if path.exists() {
        Some(path)
    } else {
        eprintln!("SKIPPED: ../shared/{relative} is absent");
        None
    }
}
