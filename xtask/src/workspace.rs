//! Where things are.

use std::path::{Path, PathBuf};

/// The Cortex-M7 target of every firmware image.
pub const TARGET: &str = "thumbv7em-none-eabihf";

/// Paths of the workspace and of its build output.
pub struct Workspace {
    /// The folder of the workspace's `Cargo.toml`.
    pub root: PathBuf,
    /// Cargo's target directory.
    pub target_dir: PathBuf,
}

impl Workspace {
    /// The workspace this program was compiled from, and the target directory it was built into.
    pub fn locate() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"))
            .parent()
            .map_or_else(|| PathBuf::from("."), Path::to_path_buf);
        // <target directory>/<profile>/xtask, wherever CARGO_TARGET_DIR or a cargo
        // configuration has put it: nested builds must share it.
        let target_dir = std::env::current_exe()
            .ok()
            .and_then(|program| Some(program.parent()?.parent()?.to_path_buf()))
            .unwrap_or_else(|| root.join("target"));
        Self { root, target_dir }
    }

    /// True when the recordings and golden numbers lie beside the workspace.
    pub fn has_recordings(&self) -> bool {
        self.root.join("../shared").is_dir()
    }

    /// xtask's own corner of the target directory.
    pub fn scratch(&self) -> PathBuf {
        self.target_dir.join("xtask")
    }
}
