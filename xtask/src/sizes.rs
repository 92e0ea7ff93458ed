//! The committed sizes of an image: `firmware/expected/BOARD.size`.
//!
//! | line | meaning |
//! |---|---|
//! | `section max_bytes` | a section of the running image |
//! | `region NAME origin length max_bytes` | a memory of the board, and how much of it may be used |
//!
//! `#` starts a comment. A section above its maximum, one that is not listed and one that has vanished
//! all fail, and so does what lies in no region, so that the memory of the board never changes unseen.

use crate::elf::Section;

/// What a size file says.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Limits {
    sections: Vec<Limit>,
    regions: Vec<Region>,
}

/// Largest size allowed of one section.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Limit {
    section: String,
    max_bytes: u32,
}

/// A memory of the board.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Region {
    name: String,
    origin: u32,
    length: u32,
    max_bytes: u32,
}

/// How much of a memory an image takes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Use {
    /// Name of the memory.
    pub region: String,
    /// Bytes taken, the stack included.
    pub used_bytes: u32,
    /// Bytes there are.
    pub length: u32,
    /// Bytes that may be taken.
    max_bytes: u32,
}

/// The addresses between which the stack lies.
pub type Stack = std::ops::Range<u32>;

impl Region {
    fn contains(&self, address: u32) -> bool {
        (self.origin..self.origin.saturating_add(self.length)).contains(&address)
    }

    /// What of it is taken: sections that run in it, and in the one that holds the code the initial
    /// content of those that run elsewhere.
    fn used(&self, sections: &[Section], stack: &Stack) -> u32 {
        let loaded = || sections.iter().filter(|section| section.is_loaded());
        let is_stored_here = loaded()
            .any(|section| section.name == ".vector_table" && self.contains(section.address));
        let of_sections: u32 = loaded()
            .filter(|section| {
                self.contains(section.address) || is_stored_here && section.is_stored()
            })
            .map(|section| section.size_bytes)
            .sum();
        let is_stack_here = !stack.is_empty() && self.contains(stack.start);
        of_sections + if is_stack_here { stack.len() as u32 } else { 0 }
    }
}

/// A number with `_` between its digits, hexadecimal after `0x`.
fn number(word: &str) -> Option<u32> {
    let digits = word.replace('_', "");
    match digits.strip_prefix("0x") {
        Some(hexadecimal) => u32::from_str_radix(hexadecimal, 16).ok(),
        None => digits.parse().ok(),
    }
}

/// Reads the lines of a size file, or says which one is wrong.
pub fn parse(text: &str) -> Result<Limits, String> {
    let mut limits = Limits::default();
    for (index, line) in text.lines().enumerate() {
        let content = line.split('#').next().unwrap_or_default().trim();
        if content.is_empty() {
            continue;
        }
        let words: Vec<&str> = content.split_whitespace().collect();
        let name = match words[..] {
            ["region", name, origin, length, max] => match [origin, length, max].map(number) {
                [Some(origin), Some(length), Some(max_bytes)] if max_bytes <= length => {
                    limits.regions.push(Region {
                        name: name.to_owned(),
                        origin,
                        length,
                        max_bytes,
                    });
                    Some(name)
                }
                _ => None,
            },
            [section, max] => number(max).map(|max_bytes| {
                limits.sections.push(Limit {
                    section: section.to_owned(),
                    max_bytes,
                });
                section
            }),
            _ => None,
        };
        let name = name.ok_or_else(|| {
            format!(
                "line {}: expected `section max_bytes` or `region NAME origin length max_bytes`",
                index + 1
            )
        })?;
        let sections = limits.sections.iter().map(|limit| &limit.section);
        let regions = limits.regions.iter().map(|region| &region.name);
        if sections
            .chain(regions)
            .filter(|other| *other == name)
            .count()
            > 1
        {
            return Err(format!("line {}: {name} is listed twice", index + 1));
        }
    }
    Ok(limits)
}

/// What of each memory an image takes.
pub fn uses(limits: &Limits, sections: &[Section], stack: &Stack) -> Vec<Use> {
    let of = |region: &Region| Use {
        region: region.name.clone(),
        used_bytes: region.used(sections, stack),
        length: region.length,
        max_bytes: region.max_bytes,
    };
    limits.regions.iter().map(of).collect()
}

/// Every way in which an image departs from its limits.
pub fn departures(limits: &Limits, sections: &[Section], stack: &Stack) -> Vec<String> {
    let loaded = || sections.iter().filter(|section| section.is_loaded());
    let mut found = Vec::new();
    for section in loaded() {
        let mut listed = limits.sections.iter();
        match listed.find(|limit| limit.section == section.name) {
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
        let mut regions = limits.regions.iter();
        if !regions.any(|region| region.contains(section.address)) {
            found.push(format!(
                "{} at {:#010x} is in no region of the list",
                section.name, section.address
            ));
        }
    }
    for limit in &limits.sections {
        if limit.max_bytes > 0 && !loaded().any(|section| section.name == limit.section) {
            found.push(format!(
                "{} is in the list and not in the image",
                limit.section
            ));
        }
    }
    for region in uses(limits, sections, stack) {
        if region.used_bytes > region.max_bytes {
            found.push(format!(
                "{} bytes of {} are used, {} are allowed",
                region.used_bytes, region.region, region.max_bytes
            ));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    const NO_STACK: Stack = 0..0;

    #[test]
    fn lines_comments_and_separators_are_read() {
        let limits =
            parse("# mps2\n.text 120_000 # code\n\n.bss\t4096\nregion RAM 0x2000_0000 65_536 600")
                .unwrap();
        let pairs: Vec<_> = limits
            .sections
            .iter()
            .map(|limit| (limit.section.as_str(), limit.max_bytes))
            .collect();
        assert_eq!(pairs, [(".text", 120_000), (".bss", 4096)]);
        let [region] = &limits.regions[..] else {
            panic!("{limits:?}");
        };
        let numbers = (region.origin, region.length, region.max_bytes);
        assert_eq!(numbers, (0x2000_0000, 65_536, 600));
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
        assert!(parse("region RAM 0 10").is_err());
        // More than there is.
        assert!(parse("region RAM 0 10 11").is_err());
    }

    #[test]
    fn growth_and_unlisted_and_vanished_sections_are_departures() {
        let sections = [
            Section::for_test(".text", 11, true),
            Section::for_test(".data", 4, true),
            Section::for_test(".debug_info", 99, false),
        ];
        let limits = parse(".text 10\n.axisram 8\nregion ALL 0 100 100").unwrap();
        assert_eq!(
            departures(&limits, &sections, &NO_STACK),
            [
                ".text has 11 bytes, 10 are allowed",
                ".data (4 bytes) is not in the list",
                ".axisram is in the list and not in the image"
            ]
        );
        let exact = parse(".text 11\n.data 4\nregion ALL 0 100 100").unwrap();
        assert!(departures(&exact, &sections, &NO_STACK).is_empty());
    }

    #[test]
    fn a_memory_holds_its_sections_its_stack_and_flash_the_content_of_all() {
        let section =
            |name, size, address, stored| Section::for_test(name, size, true).at(address, stored);
        let sections = [
            section(".vector_table", 10, 0, true),
            section(".text", 40, 10, true),
            section(".data", 6, 1030, true),
            section(".bss", 20, 1036, false),
            section(".far", 7, 5000, false),
        ];
        let listed = ".vector_table 10\n.text 40\n.data 6\n.bss 20\n.far 7\n";
        let stack = 1000..1030;
        let limits = parse(&format!(
            "{listed}region FLASH 0 99 56\nregion RAM 1000 99 55"
        ))
        .unwrap();
        let used: Vec<_> = uses(&limits, &sections, &stack)
            .iter()
            .map(|region| region.used_bytes)
            .collect();
        assert_eq!(used, [10 + 40 + 6, 30 + 6 + 20]);
        assert_eq!(
            departures(&limits, &sections, &stack),
            [
                ".far at 0x00001388 is in no region of the list",
                "56 bytes of RAM are used, 55 are allowed"
            ]
        );
    }
}
