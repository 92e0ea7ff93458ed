//! Compiler versions, as far as set-up has to compare them.

/// `major.minor.patch`; what follows (`-nightly`, `+dfsg1`) is not compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// Major, minor and patch number.
    numbers: [u32; 3],
}

impl Version {
    /// Reads `1.89`, `1.95.0` or `1.97.0-nightly`.
    pub fn parse(text: &str) -> Option<Self> {
        let mut numbers = [0; 3];
        let plain = text.split(['-', '+']).next()?;
        let mut parts = plain.split('.');
        for (index, number) in numbers.iter_mut().enumerate() {
            match parts.next() {
                Some(part) => *number = part.parse().ok()?,
                None if index > 0 => {}
                None => return None,
            }
        }
        parts.next().is_none().then_some(Self { numbers })
    }
}

impl std::fmt::Display for Version {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let [major, minor, patch] = self.numbers;
        write!(f, "{major}.{minor}.{patch}")
    }
}

/// The value of `key: value` in what `rustc -vV` prints.
pub fn field<'a>(rustc_vv: &'a str, key: &str) -> Option<&'a str> {
    rustc_vv
        .lines()
        .find_map(|line| line.strip_prefix(key)?.strip_prefix(": "))
        .map(str::trim)
}

/// The workspace's `rust-version`, from the text of its `Cargo.toml`.
pub fn minimum(manifest: &str) -> Option<Version> {
    manifest.lines().find_map(|line| {
        let (key, value) = line.split_once('=')?;
        (key.trim() == "rust-version").then(|| Version::parse(value.trim().trim_matches('"')))?
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const DEBIAN: &str = "rustc 1.96.0 (1234abcd 2026-05-28) (built from a source tarball)\n\
        binary: rustc\nhost: x86_64-unknown-linux-gnu\nrelease: 1.96.0\nLLVM version: 22.1.8\n";

    #[test]
    fn versions_are_ordered_by_number_and_not_by_text() {
        let parse = |text| Version::parse(text).unwrap();
        assert!(parse("1.100") > parse("1.89.3"));
        assert_eq!(parse("1.89"), parse("1.89.0"));
        assert_eq!(parse("1.97.0-nightly").to_string(), "1.97.0");
    }

    #[test]
    fn what_is_not_a_version_is_refused() {
        for text in ["", "stable", "1.x", "1.2.3.4", "1..2"] {
            assert_eq!(Version::parse(text), None, "{text}");
        }
    }

    #[test]
    fn fields_of_rustc_are_found_by_their_whole_key() {
        assert_eq!(field(DEBIAN, "release"), Some("1.96.0"));
        assert_eq!(field(DEBIAN, "LLVM version"), Some("22.1.8"));
        assert_eq!(field(DEBIAN, "hos"), None);
    }

    #[test]
    fn the_minimum_comes_from_the_manifest() {
        let manifest = "[workspace.package]\nedition = \"2024\"\nrust-version = \"1.89\"\n";
        assert_eq!(minimum(manifest), Version::parse("1.89"));
        assert_eq!(minimum("[workspace]\n"), None);
        let own = include_str!("../../../Cargo.toml");
        assert!(minimum(own).is_some());
    }
}
