//! Satellite names and fixed sets of them.

/// The constellations surefix navigates with. Others are counted and skipped.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum System {
    /// GPS, RINEX letter G.
    Gps = 0,
    /// Galileo, RINEX letter E.
    Galileo = 1,
    /// BDS (BeiDou), RINEX letter C.
    Bds = 2,
}

impl System {
    /// Every system, in the order of clock columns.
    pub const ALL: [Self; 3] = [Self::Gps, Self::Galileo, Self::Bds];

    /// RINEX letter.
    pub const fn letter(self) -> char {
        match self {
            Self::Gps => 'G',
            Self::Galileo => 'E',
            Self::Bds => 'C',
        }
    }

    /// System of a RINEX letter, `None` for one surefix does not use.
    pub const fn from_letter(letter: char) -> Option<Self> {
        match letter {
            'G' => Some(Self::Gps),
            'E' => Some(Self::Galileo),
            'C' => Some(Self::Bds),
            _ => None,
        }
    }

    /// Position in [`System::ALL`].
    pub const fn index(self) -> usize {
        self as usize
    }

    /// System at a position of [`System::ALL`].
    pub const fn from_index(index: usize) -> Option<Self> {
        match index {
            0 => Some(Self::Gps),
            1 => Some(Self::Galileo),
            2 => Some(Self::Bds),
            _ => None,
        }
    }

    /// Highest PRN or slot number: GPS 32, Galileo 36, BDS 63.
    pub const fn max_prn(self) -> u8 {
        match self {
            Self::Gps => 32,
            Self::Galileo => 36,
            Self::Bds => 63,
        }
    }

    const fn first_index(self) -> usize {
        match self {
            Self::Gps => 0,
            Self::Galileo => 32,
            Self::Bds => 32 + 36,
        }
    }
}

/// One satellite: a system and a PRN that exists in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Satellite {
    system: System,
    prn: u8,
}

impl Satellite {
    /// Number of satellites that can be named; [`Satellite::index`] lies below it.
    pub const COUNT: usize = 32 + 36 + 63;

    /// The satellite, or `None` where the PRN is 0 or above [`System::max_prn`].
    pub const fn new(system: System, prn: u8) -> Option<Self> {
        if prn == 0 || prn > system.max_prn() {
            None
        } else {
            Some(Self { system, prn })
        }
    }

    /// Constellation.
    pub const fn system(self) -> System {
        self.system
    }

    /// PRN (GPS), SVID (Galileo) or PRN (BDS), from 1.
    pub const fn prn(self) -> u8 {
        self.prn
    }

    /// Place in tables over all satellites: GPS, Galileo, BDS, each by PRN.
    pub const fn index(self) -> usize {
        self.system.first_index() + self.prn as usize - 1
    }

    /// Inverse of [`Satellite::index`].
    pub const fn from_index(index: usize) -> Option<Self> {
        if index < 32 {
            Self::new(System::Gps, index as u8 + 1)
        } else if index < 32 + 36 {
            Self::new(System::Galileo, (index - 32) as u8 + 1)
        } else if index < Self::COUNT {
            Self::new(System::Bds, (index - 32 - 36) as u8 + 1)
        } else {
            None
        }
    }

    /// BDS geostationary satellite: C01 to C05 and C59 to C63. [BDS-SIS-ICD-B1I] 4.3.1, ERRATA.
    pub const fn is_bds_geo(self) -> bool {
        matches!(self.system, System::Bds) && (self.prn <= 5 || self.prn >= 59)
    }
}

impl core::fmt::Display for Satellite {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}{:02}", self.system.letter(), self.prn)
    }
}

/// A set of satellites in 24 bytes: one bit mask per system, bit `prn − 1`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SatelliteSet {
    masks: [u64; 3],
}

impl SatelliteSet {
    /// No satellite.
    pub const EMPTY: Self = Self { masks: [0; 3] };

    /// The set of these masks, in the order of [`System::ALL`]; bits above a system's highest PRN are dropped.
    pub const fn from_masks(masks: [u64; 3]) -> Self {
        Self {
            masks: [
                masks[0] & ((1 << 32) - 1),
                masks[1] & ((1 << 36) - 1),
                masks[2] & ((1 << 63) - 1),
            ],
        }
    }

    /// Bit masks in the order of [`System::ALL`].
    pub const fn masks(&self) -> [u64; 3] {
        self.masks
    }

    /// Adds a satellite.
    pub fn insert(&mut self, satellite: Satellite) {
        if let Some(mask) = self.masks.get_mut(satellite.system.index()) {
            *mask |= 1 << (satellite.prn - 1);
        }
    }

    /// Takes a satellite out.
    pub fn remove(&mut self, satellite: Satellite) {
        if let Some(mask) = self.masks.get_mut(satellite.system.index()) {
            *mask &= !(1 << (satellite.prn - 1));
        }
    }

    /// Whether the satellite is in the set.
    pub fn contains(&self, satellite: Satellite) -> bool {
        self.masks
            .get(satellite.system.index())
            .is_some_and(|mask| mask & (1 << (satellite.prn - 1)) != 0)
    }

    /// Number of satellites.
    pub fn len(&self) -> usize {
        self.masks
            .iter()
            .map(|mask| mask.count_ones() as usize)
            .sum()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.masks.iter().all(|mask| *mask == 0)
    }

    /// The satellites in the order of [`Satellite::index`].
    pub fn iter(&self) -> impl Iterator<Item = Satellite> + '_ {
        (0..Satellite::COUNT)
            .filter_map(Satellite::from_index)
            .filter(|satellite| self.contains(*satellite))
    }
}

/// A set of constellations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct SystemSet {
    bits: u8,
}

impl SystemSet {
    /// No system.
    pub const EMPTY: Self = Self { bits: 0 };
    /// GPS, Galileo and BDS.
    pub const ALL: Self = Self { bits: 0b111 };

    /// The set of these bits, bit [`System::index`]; others are dropped.
    pub const fn from_bits(bits: u8) -> Self {
        Self { bits: bits & 0b111 }
    }

    /// Bit [`System::index`] per system.
    pub const fn bits(self) -> u8 {
        self.bits
    }

    /// This set and one system more.
    pub const fn with(self, system: System) -> Self {
        Self {
            bits: self.bits | 1 << system.index(),
        }
    }

    /// Whether the system is in the set.
    pub const fn contains(self, system: System) -> bool {
        self.bits & (1 << system.index()) != 0
    }

    /// Number of systems.
    pub const fn len(self) -> usize {
        self.bits.count_ones() as usize
    }

    /// Whether there is none.
    pub const fn is_empty(self) -> bool {
        self.bits == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn index_and_satellite_are_each_others_inverse() {
        for index in 0..Satellite::COUNT {
            assert_eq!(
                Satellite::from_index(index).map(Satellite::index),
                Some(index)
            );
        }
        assert_eq!(Satellite::from_index(Satellite::COUNT), None);
    }

    #[test]
    fn prn_outside_the_system_is_no_satellite() {
        assert_eq!(Satellite::new(System::Gps, 0), None);
        assert_eq!(Satellite::new(System::Gps, 33), None);
        assert_eq!(Satellite::new(System::Galileo, 37), None);
        assert!(Satellite::new(System::Bds, 63).is_some_and(Satellite::is_bds_geo));
    }

    #[test]
    fn a_set_holds_what_was_put_in_and_nothing_else() {
        let mut set = SatelliteSet::EMPTY;
        let all = (0..Satellite::COUNT).filter_map(Satellite::from_index);
        for satellite in all.clone() {
            set.insert(satellite);
        }
        assert_eq!(set.len(), Satellite::COUNT);
        assert_eq!(SatelliteSet::from_masks([u64::MAX; 3]), set);
        for satellite in all {
            assert!(set.contains(satellite));
            set.remove(satellite);
            assert!(!set.contains(satellite));
        }
        assert!(set.is_empty());
    }
}
