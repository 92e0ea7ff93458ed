//! The committed sizes of an image: `firmware/expected/IMAGE.size`.
//!
//! One line per section that the running image has, `section max_bytes`; `#` starts a comment.
//! A section above its maximum, one that is not listed and one that has vanished all fail, so that
//! the memory of the board never changes unseen.

use crate::elf::Section;

/// Largest size allowed of one section.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Limit {
    section: String,
    max_bytes: u32,
}

/// Reads the lines of a size file, or says which one is wrong.
pub fn parse(text: &str) -> Result<Vec<Limit>, String> {
    let mut limits: Vec<Limit> = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let content = line.split('#').next().unwrap_or_default().trim();
        if content.is_empty() {
            continue;
        }
        let mut words = content.split_whitespace();
        let limit = match (words.next(), words.next(), words.next()) {
            (Some(section), Some(number), None) => {
                number.replace('_', "").parse().ok().map(|max_bytes| Limit {
                    section: section.to_owned(),
                    max_bytes,
                })
            }
            _ => None,
        };
        let limit =
            limit.ok_or_else(|| format!("line {}: expected `section max_bytes`", index + 1))?;
        if limits.iter().any(|other| other.section == limit.section) {
            return Err(format!(
                "line {}: {} is listed twice",
                index + 1,
                limit.section
            ));
        }
        limits.push(limit);
    }
    Ok(limits)
}

/// Every way in which an image departs from its limits.
pub fn departures(limits: &[Limit], sections: &[Section]) -> Vec<String> {
    let loaded = || sections.iter().filter(|section| section.is_loaded());
    let mut found = Vec::new();
    for section in loaded() {
        match limits.iter().find(|limit| limit.section == section.name) {
            Some(limit) if section.size_bytes > limit.max_bytes => found.push(format!(
                "{} has {} bytes, {} are allowed",
                section.name, section.size_bytes, limit.max_bytes
            )),
            Some(_) => {}
            None => found.push(format!(
                "{} ({} bytes) is not in the list",
                section.name, section.size_bytes
            )),
        }
    }
    for limit in limits {
        if limit.max_bytes > 0 && !loaded().any(|section| section.name == limit.section) {
            found.push(format!(
                "{} is in the list and not in the image",
                limit.section
            ));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_comments_and_separators_are_read() {
        let limits = parse("# mps2\n.text 120_000 # code\n\n.bss\t4096\n").unwrap();
        let pairs: Vec<_> = limits
            .iter()
            .map(|limit| (limit.section.as_str(), limit.max_bytes))
            .collect();
        assert_eq!(pairs, [(".text", 120_000), (".bss", 4096)]);
    }

    #[test]
    fn a_wrong_line_is_named() {
        assert!(
            parse(".text 1\n.bss many")
                .unwrap_err()
                .starts_with("line 2")
        );
        assert!(parse(".text 1 2").is_err());
        assert!(parse(".text").is_err());
        assert!(parse(".text 1\n.text 2").unwrap_err().contains("twice"));
    }

    #[test]
    fn growth_and_unlisted_and_vanished_sections_are_departures() {
        let sections = [
            Section::for_test(".text", 11, true),
            Section::for_test(".data", 4, true),
            Section::for_test(".debug_info", 99, false),
        ];
        let limits = parse(".text 10\n.axisram 8").unwrap();
        assert_eq!(
            departures(&limits, &sections),
            [
                ".text has 11 bytes, 10 are allowed",
                ".data (4 bytes) is not in the list",
                ".axisram is in the list and not in the image"
            ]
        );
        let exact = parse(".text 11\n.data 4").unwrap();
        assert!(departures(&exact, &sections).is_empty());
    }
}
