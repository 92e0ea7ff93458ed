//! As much of ELF as the checks need: sections, symbol names, the floating-point attributes.
//!
//! 32-bit little endian only. Sources: System V ABI, "Object Files"; ABI for the Arm Architecture,
//! Addenda (IHI 0045), "Build Attributes".

/// A section occupies memory of the running image.
const SHF_ALLOC: u32 = 2;
const SHF_WRITE: u32 = 1;
const SHT_SYMTAB: u32 = 2;
const SHT_NOBITS: u32 = 8;
/// `Tag_FP_arch` of a Cortex-M7 with its double-precision unit.
const FPV5_D16: u64 = 8;

/// An image that was read whole.
pub struct Elf<'a> {
    sections: Vec<Section<'a>>,
}

/// One section of an image.
#[derive(Clone, Copy, Debug)]
pub struct Section<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its size in memory.
    pub size_bytes: u32,
    /// Where the running image has it.
    pub address: u32,
    kind: u32,
    flags: u32,
    link: u32,
    data: &'a [u8],
}

impl Section<'_> {
    /// True when the running image has it in flash or RAM.
    pub fn is_loaded(&self) -> bool {
        self.flags & SHF_ALLOC != 0 && self.size_bytes > 0
    }

    /// True when it occupies RAM.
    pub fn is_writable(&self) -> bool {
        self.flags & SHF_WRITE != 0
    }

    /// True when flash holds its content, also that of variables with an initial value.
    pub fn is_stored(&self) -> bool {
        self.kind != SHT_NOBITS
    }

    #[cfg(test)]
    pub fn for_test(name: &'static str, size_bytes: u32, loaded: bool) -> Self {
        Self {
            name,
            size_bytes,
            address: 0,
            kind: 1,
            flags: if loaded { SHF_ALLOC } else { 0 },
            link: 0,
            data: &[],
        }
    }

    #[cfg(test)]
    pub fn at(self, address: u32, stored: bool) -> Self {
        let kind = if stored { 1 } else { SHT_NOBITS };
        Self {
            address,
            kind,
            ..self
        }
    }
}

/// What an image says of the floating-point unit it was compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct FloatAttributes {
    /// `Tag_FP_arch`: 0 none, 6 VFPv4-D16, 8 FPv5-D16 and so on
    pub architecture: u64,
    /// `Tag_ABI_HardFP_use`: 0 all that the architecture has, 1 single precision only, 3 both.
    pub hardware_use: u64,
    /// `Tag_ABI_VFP_args`: 1 when arguments travel in floating-point registers.
    pub arguments_in_registers: u64,
}

impl FloatAttributes {
    /// True when f64 arithmetic is the hardware's: any other build runs the same bits 45 times slower.
    pub fn has_hardware_f64(&self) -> bool {
        self.architecture == FPV5_D16 && self.hardware_use != 1 && self.arguments_in_registers == 1
    }
}

impl<'a> Elf<'a> {
    /// Reads the section table; nothing when the bytes are not a 32-bit little-endian ELF file.
    pub fn parse(bytes: &'a [u8]) -> Option<Self> {
        if bytes.get(..6)? != b"\x7fELF\x01\x01" {
            return None;
        }
        let table = u32_at(bytes, 32)? as usize;
        let entry_size = usize::from(u16_at(bytes, 46)?);
        let count = usize::from(u16_at(bytes, 48)?);
        let names_index = usize::from(u16_at(bytes, 50)?);
        let header = |index: usize| {
            let start = table.checked_add(index * entry_size)?;
            bytes.get(start..start.checked_add(entry_size)?)
        };
        let names = {
            let names = header(names_index)?;
            slice(bytes, u32_at(names, 16)?, u32_at(names, 20)?)?
        };
        let sections = (0..count)
            .map(|index| {
                let header = header(index)?;
                let (kind, size_bytes) = (u32_at(header, 4)?, u32_at(header, 20)?);
                let stored = if kind == SHT_NOBITS { 0 } else { size_bytes };
                Some(Section {
                    name: text_at(names, u32_at(header, 0)?)?,
                    size_bytes,
                    address: u32_at(header, 12)?,
                    kind,
                    flags: u32_at(header, 8)?,
                    link: u32_at(header, 24)?,
                    data: slice(bytes, u32_at(header, 16)?, stored)?,
                })
            })
            .collect::<Option<_>>()?;
        Some(Self { sections })
    }

    /// All sections, in the file's order.
    pub fn sections(&self) -> &[Section<'a>] {
        &self.sections
    }

    /// The names and addresses of all symbols.
    pub fn symbols(&self) -> Vec<(&'a str, u32)> {
        let tables = self
            .sections
            .iter()
            .filter(|section| section.kind == SHT_SYMTAB);
        tables
            .flat_map(|table| {
                let names = self
                    .sections
                    .get(table.link as usize)
                    .map_or(&[][..], |names| names.data);
                table.data.as_chunks::<16>().0.iter().filter_map(|entry| {
                    Some((text_at(names, u32_at(entry, 0)?)?, u32_at(entry, 4)?))
                })
            })
            .filter(|(name, _)| !name.is_empty())
            .collect()
    }

    /// The floating-point attributes of the image; nothing when it carries none.
    pub fn float_attributes(&self) -> Option<FloatAttributes> {
        let section = self
            .sections
            .iter()
            .find(|section| section.name == ".ARM.attributes")?;
        float_attributes(section.data)
    }
}

/// Walks format 'A' → vendor "aeabi" → the attributes of the whole file (`Tag_File`).
fn float_attributes(section: &[u8]) -> Option<FloatAttributes> {
    const TAG_FILE: u64 = 1;
    let (&version, vendor) = section.split_first()?;
    let length = u32_at(vendor, 0)? as usize;
    let mut rest = vendor.get(4..length)?.strip_prefix(b"aeabi\0")?;
    if version != b'A' || leb128(&mut rest)? != TAG_FILE {
        return None;
    }
    let size = u32_at(rest, 0)? as usize;
    // The size counts itself and the one-byte tag before it.
    let mut attributes = rest.get(4..size.checked_sub(1)?)?;
    let mut found = FloatAttributes::default();
    while !attributes.is_empty() {
        let tag = leb128(&mut attributes)?;
        let value = match tag {
            // CPU names, and every odd tag above 32, hold text.
            4 | 5 => {
                skip_text(&mut attributes)?;
                continue;
            }
            32 => {
                leb128(&mut attributes)?;
                skip_text(&mut attributes)?;
                continue;
            }
            tag if tag > 32 && tag % 2 == 1 => {
                skip_text(&mut attributes)?;
                continue;
            }
            _ => leb128(&mut attributes)?,
        };
        match tag {
            10 => found.architecture = value,
            27 => found.hardware_use = value,
            28 => found.arguments_in_registers = value,
            _ => {}
        }
    }
    Some(found)
}

fn leb128(bytes: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..63).step_by(7) {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

fn skip_text(bytes: &mut &[u8]) -> Option<()> {
    let end = bytes.iter().position(|&byte| byte == 0)?;
    *bytes = bytes.get(end + 1..)?;
    Some(())
}

fn slice(bytes: &[u8], offset: u32, length: u32) -> Option<&[u8]> {
    let start = offset as usize;
    bytes.get(start..start.checked_add(length as usize)?)
}

fn text_at(names: &[u8], offset: u32) -> Option<&str> {
    let from = names.get(offset as usize..)?;
    let end = from.iter().position(|&byte| byte == 0)?;
    std::str::from_utf8(from.get(..end)?).ok()
}

fn u16_at(bytes: &[u8], offset: usize) -> Option<u16> {
    Some(u16::from_le_bytes(*bytes.get(offset..)?.first_chunk()?))
}

fn u32_at(bytes: &[u8], offset: usize) -> Option<u32> {
    Some(u32::from_le_bytes(*bytes.get(offset..)?.first_chunk()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `.ARM.attributes` as rustc 1.95 writes it, for `-C target-cpu=cortex-m7` and for the
    /// target's own default (`readelf -A`: "FPv5/FP-D16 for ARMv8", and "VFPv4-D16" with
    /// "Tag_ABI_HardFP_use: SP only").
    const CORTEX_M7: &str = "4142000000616561626900013800000043322e30390005636f727465782d6d3700\
        060d074d080009020a080e001101140115011703180119011c011e01220124012601";
    const DEFAULT: &str = "4139000000616561626900012f00000043322e303900060d074d080009020a060e\
        001101140115011703180119011b011c011e01220124012601";

    fn bytes(hex: &str) -> Vec<u8> {
        let digits: Vec<u8> = hex.bytes().filter(u8::is_ascii_hexdigit).collect();
        let byte = |pair: &[u8]| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap();
        digits.chunks(2).map(byte).collect()
    }

    #[test]
    fn the_double_precision_unit_is_told_from_the_single_precision_one() {
        let m7 = float_attributes(&bytes(CORTEX_M7)).unwrap();
        assert_eq!((m7.architecture, m7.hardware_use), (8, 0));
        assert!(m7.has_hardware_f64());
        let default = float_attributes(&bytes(DEFAULT)).unwrap();
        assert_eq!((default.architecture, default.hardware_use), (6, 1));
        assert!(!default.has_hardware_f64());
        assert!(!FloatAttributes::default().has_hardware_f64());
    }

    #[test]
    fn cut_attributes_are_refused() {
        let whole = bytes(CORTEX_M7);
        for length in 0..whole.len() {
            assert_eq!(float_attributes(&whole[..length]), None, "{length}");
        }
    }

    /// Name, kind, flags, size, link, data.
    type Part = (&'static str, u32, u32, u32, u32, Vec<u8>);

    /// An ELF file with the sections given.
    fn image(sections: &[Part]) -> Vec<u8> {
        let mut names = Vec::new();
        let mut body = vec![0; 52];
        let mut headers = Vec::new();
        let mut all = sections.to_vec();
        all.push((".shstrtab", 3, 0, 0, 0, Vec::new()));
        let last = all.len() - 1;
        for (index, (name, kind, flags, size, link, data)) in all.into_iter().enumerate() {
            let name_offset = names.len() as u32;
            names.extend_from_slice(name.as_bytes());
            names.push(0);
            let data = if index == last { names.clone() } else { data };
            let size = if kind == SHT_NOBITS {
                size
            } else {
                data.len() as u32
            };
            for word in [
                name_offset,
                kind,
                flags,
                0,
                body.len() as u32,
                size,
                link,
                0,
                0,
                0,
            ] {
                headers.extend_from_slice(&u32::to_le_bytes(word));
            }
            body.extend_from_slice(&data);
        }
        let table = body.len() as u32;
        body.extend_from_slice(&headers);
        body[..6].copy_from_slice(b"\x7fELF\x01\x01");
        body[32..36].copy_from_slice(&table.to_le_bytes());
        body[46..48].copy_from_slice(&40_u16.to_le_bytes());
        body[48..50].copy_from_slice(&(last as u16 + 1).to_le_bytes());
        body[50..52].copy_from_slice(&(last as u16).to_le_bytes());
        body
    }

    #[test]
    fn sections_and_symbols_are_read() {
        let symbol = |name: u32, address: u32| {
            let mut entry = vec![0; 16];
            entry[..4].copy_from_slice(&name.to_le_bytes());
            entry[4..8].copy_from_slice(&address.to_le_bytes());
            entry
        };
        let file = image(&[
            (".text", 1, 6, 0, 0, vec![0; 10]),
            (".bss", SHT_NOBITS, 3, 4096, 0, Vec::new()),
            (".comment", 1, 0, 0, 0, vec![0; 7]),
            (
                ".strtab",
                3,
                0,
                0,
                0,
                b"\0main\0core::panicking::panic\0".to_vec(),
            ),
            (
                ".symtab",
                SHT_SYMTAB,
                0,
                0,
                3,
                [symbol(0, 0), symbol(1, 0x101), symbol(6, 0x200)].concat(),
            ),
            (".ARM.attributes", 0x7000_0003, 0, 0, 0, bytes(CORTEX_M7)),
        ]);
        let elf = Elf::parse(&file).unwrap();
        let loaded: Vec<_> = elf
            .sections()
            .iter()
            .filter(|section| section.is_loaded())
            .map(|section| (section.name, section.size_bytes))
            .collect();
        assert_eq!(loaded, [(".text", 10), (".bss", 4096)]);
        assert_eq!(
            elf.symbols(),
            [("main", 0x101), ("core::panicking::panic", 0x200)]
        );
        assert!(elf.float_attributes().unwrap().has_hardware_f64());
    }

    #[test]
    fn a_cut_image_is_refused() {
        let file = image(&[(".text", 1, 6, 0, 0, vec![0; 10])]);
        assert!(Elf::parse(&file).is_some());
        for length in 0..file.len() {
            assert!(Elf::parse(&file[..length]).is_none(), "{length}");
        }
    }
}
