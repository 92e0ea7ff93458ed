//! GNSS time in integer nanoseconds.
//!
//! One scale inside surefix: GPS time (GPST), counted from 1980-01-06 00:00:00 UTC. BDS time (BDT)
//! and Galileo system time (GST) are converted where bytes become domain types; the sub-nanosecond
//! offsets between the scales that control segments broadcast are part of the clock unknowns.
//!
//! | scale | week 0 starts at (GPST) | seconds of week against GPST |
//! |---|---|---|
//! | GPST | 1980-01-06 00:00:00 | |
//! | GST | 1999-08-22 00:00:00, GPS week 1024 | equal |
//! | BDT | 2006-01-01 00:00:14, GPS week 1356 | GPST − 14 s |
//!
//! Sources: [IS-GPS-200] 20.3.3.3.1.1, [GAL-OS-SIS-ICD] 5.1.2, [BDS-SIS-ICD-B1I] 3.3.

/// Nanoseconds in a second.
pub const NS_PER_S: i64 = 1_000_000_000;
/// Seconds in a week.
pub const SECONDS_PER_WEEK: i64 = 604_800;
/// Nanoseconds in a week.
pub const NS_PER_WEEK: i64 = SECONDS_PER_WEEK * NS_PER_S;
/// GPST − BDT, s. [BDS-SIS-ICD-B1I] 3.3: BDT starts at 2006-01-01 UTC, when GPST led UTC by 14 s.
pub const GPST_MINUS_BDT_S: i64 = 14;
/// GPS week in which BDT week 0 starts.
pub const BDT_WEEK_OFFSET: i32 = 1356;
/// GPS week in which GST week 0 starts.
pub const GST_WEEK_OFFSET: i32 = 1024;

/// An instant of GPS time.
///
/// Compared, added and subtracted exactly; no two instants are equal and also ordered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct GpsTime {
    ns: i64,
}

impl GpsTime {
    /// The instant `ns` nanoseconds after the start of GPS week 0.
    pub const fn from_ns(ns: i64) -> Self {
        Self { ns }
    }

    /// Week `week` of GPST and `tow_ns` nanoseconds into it. The nanoseconds may lie outside the week.
    pub const fn from_week_tow_ns(week: i32, tow_ns: i64) -> Self {
        Self {
            ns: (week as i64).wrapping_mul(NS_PER_WEEK).wrapping_add(tow_ns),
        }
    }

    /// Week `week` of GPST and `tow_s` whole seconds into it.
    pub const fn from_week_tow_s(week: i32, tow_s: i64) -> Self {
        Self::from_week_tow_ns(week, tow_s.wrapping_mul(NS_PER_S))
    }

    /// BDT week and seconds of week, as BDS ephemerides give toe and toc.
    pub const fn from_bdt(week: i32, sow_s: i64) -> Self {
        Self::from_week_tow_s(
            week.wrapping_add(BDT_WEEK_OFFSET),
            sow_s.wrapping_add(GPST_MINUS_BDT_S),
        )
    }

    /// GST week and seconds of week, as Galileo ephemerides give toe and toc.
    pub const fn from_gst(week: i32, tow_s: i64) -> Self {
        Self::from_week_tow_s(week.wrapping_add(GST_WEEK_OFFSET), tow_s)
    }

    /// Nanoseconds since the start of GPS week 0.
    pub const fn ns(self) -> i64 {
        self.ns
    }

    /// GPS week, not reduced modulo 1024.
    pub const fn week(self) -> i32 {
        self.ns.div_euclid(NS_PER_WEEK) as i32
    }

    /// Nanoseconds into the GPS week, 0 to 604,799,999,999,999.
    pub const fn tow_ns(self) -> i64 {
        self.ns.rem_euclid(NS_PER_WEEK)
    }

    /// Seconds into the GPS week.
    pub fn tow_s(self) -> f64 {
        self.tow_ns() as f64 / NS_PER_S as f64
    }

    /// `self − earlier` in seconds; exact to a nanosecond up to 104 days, rounded beyond.
    pub fn seconds_since(self, earlier: Self) -> f64 {
        self.ns.wrapping_sub(earlier.ns) as f64 / NS_PER_S as f64
    }

    /// This instant moved by `ns` nanoseconds.
    pub const fn plus_ns(self, ns: i64) -> Self {
        Self {
            ns: self.ns.wrapping_add(ns),
        }
    }

    /// The instant with this time of week that lies nearest to `reference`, at most half a week away.
    ///
    /// Resolves a time of week that arrives without its week, also across a rollover.
    pub const fn nearest(tow_ns: i64, reference: Self) -> Self {
        let mut difference = tow_ns
            .wrapping_sub(reference.tow_ns())
            .rem_euclid(NS_PER_WEEK);
        if difference >= NS_PER_WEEK / 2 {
            difference -= NS_PER_WEEK;
        }
        reference.plus_ns(difference)
    }
}

/// Resolves a week number that is broadcast modulo `modulus` (1024 for the GPS legacy message) to
/// the full week nearest to `reference_week`.
pub const fn resolve_week(truncated: i32, modulus: i32, reference_week: i32) -> i32 {
    if modulus <= 0 {
        return truncated;
    }
    let mut difference = truncated.wrapping_sub(reference_week).rem_euclid(modulus);
    if difference >= modulus / 2 {
        difference -= modulus;
    }
    reference_week.wrapping_add(difference)
}

/// Leap seconds GPST − UTC: from the GPST instant (first entry, s) on, the second entry, s.
///
/// For output only. [IERS-C] Bulletin C up to number 70; none announced after 2017-01-01.
const LEAP_SECONDS: [(i64, i64); 18] = [
    (46_828_801, 1),
    (78_364_802, 2),
    (109_900_803, 3),
    (173_059_204, 4),
    (252_028_805, 5),
    (315_187_206, 6),
    (346_723_207, 7),
    (393_984_008, 8),
    (425_520_009, 9),
    (457_056_010, 10),
    (504_489_611, 11),
    (551_750_412, 12),
    (599_184_013, 13),
    (820_108_814, 14),
    (914_803_215, 15),
    (1_025_136_016, 16),
    (1_119_744_017, 17),
    (1_167_264_018, 18),
];

/// Leap seconds GPST − UTC in force at an instant. For output only, never for navigation.
pub fn leap_seconds(time: GpsTime) -> i64 {
    let seconds = time.ns().div_euclid(NS_PER_S);
    LEAP_SECONDS
        .iter()
        .rev()
        .find(|(from_s, _)| seconds >= *from_s)
        .map_or(0, |(_, leap_s)| *leap_s)
}

/// A date and a time of day in UTC.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Utc {
    /// Year of the Gregorian calendar.
    pub year: i64,
    /// Month, 1 to 12.
    pub month: u8,
    /// Day, 1 to 31.
    pub day: u8,
    /// Hour, 0 to 23.
    pub hour: u8,
    /// Minute, 0 to 59.
    pub minute: u8,
    /// Nanosecond of the minute, 0 to 59,999,999,999, and a second more while a leap second is inserted.
    pub ns_of_minute: i64,
}

/// Days from 0000-03-01 to 1980-01-06.
const MARCH_0000_TO_GPS_DAYS: i64 = 723_125;

/// An instant in UTC, by the leap seconds known here: after the last of them as many as then, so that an
/// insertion announced later makes it wrong by a second. For output only.
pub fn utc(time: GpsTime) -> Utc {
    let leap_s = leap_seconds(time);
    // The second before the count changes is the one that is inserted: 23:59:60.
    let is_inserted = leap_seconds(time.plus_ns(NS_PER_S)) > leap_s;
    let behind_s = leap_s + is_inserted as i64;
    let ns = time.plus_ns(behind_s.wrapping_mul(-NS_PER_S)).ns();
    let seconds = ns.div_euclid(NS_PER_S);
    let (days, of_day_s) = (seconds.div_euclid(86_400), seconds.rem_euclid(86_400));
    let of_minute_s = of_day_s % 60 + is_inserted as i64;
    let (year, month, day) = civil(days);
    Utc {
        year,
        month,
        day,
        hour: (of_day_s / 3600) as u8,
        minute: (of_day_s / 60 % 60) as u8,
        ns_of_minute: of_minute_s * NS_PER_S + ns.rem_euclid(NS_PER_S),
    }
}

/// Year, month and day of the Gregorian calendar, `days` after 1980-01-06. [HINNANT-2014]
fn civil(days: i64) -> (i64, u8, u8) {
    // Years begin in March, so that a leap day ends one; an i64 of nanoseconds is 107,000 days.
    let days = days + MARCH_0000_TO_GPS_DAYS;
    let (era, of_era) = (days.div_euclid(146_097), days.rem_euclid(146_097));
    let year_of_era = (of_era - of_era / 1460 + of_era / 36_524 - of_era / 146_096) / 365;
    let of_year = of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let from_march = (5 * of_year + 2) / 153;
    let day = of_year - (153 * from_march + 2) / 5 + 1;
    let month = if from_march < 10 {
        from_march + 3
    } else {
        from_march - 9
    };
    let year = year_of_era + era * 400 + (month <= 2) as i64;
    (year, month as u8, day as u8)
}

/// The start of a day of the Gregorian calendar, leap seconds apart: to know a week by, not a second.
/// [HINNANT-2014] The inverse of what [`utc`] does.
///
/// `None` for a month or day there is not, or a year outside 1980 to 2136, which GPS weeks of 13 bits reach.
pub fn start_of_day(year: u16, month: u8, day: u8) -> Option<GpsTime> {
    if !((1980..=2136).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day)) {
        return None;
    }
    let from_march = (i64::from(month) + 9) % 12;
    let march_year = i64::from(year) - (from_march >= 10) as i64;
    let (era, of_era) = (march_year.div_euclid(400), march_year.rem_euclid(400));
    let of_year = (153 * from_march + 2) / 5 + i64::from(day) - 1;
    let days =
        era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - MARCH_0000_TO_GPS_DAYS;
    // A day that the month does not have comes out as one of the next.
    (civil(days) == (i64::from(year), month, day))
        .then_some(GpsTime::from_week_tow_s(0, days * 86_400))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bdt_leads_to_gpst_by_fourteen_seconds() {
        // BDT week 0, second 0 is 2006-01-01 00:00:14 GPST, the Sunday of GPS week 1356.
        let t = GpsTime::from_bdt(0, 0);
        assert_eq!((t.week(), t.tow_ns()), (1356, 14 * NS_PER_S));
    }

    #[test]
    fn bdt_second_before_its_rollover_is_in_the_next_gps_week() {
        let t = GpsTime::from_bdt(653, 604_786);
        assert_eq!((t.week(), t.tow_ns()), (2010, 0));
    }

    #[test]
    fn galileo_week_zero_is_gps_week_1024() {
        assert_eq!(GpsTime::from_gst(986, 345_600).week(), 2010);
    }

    #[test]
    fn time_of_week_resolves_across_a_rollover() {
        let before = GpsTime::from_week_tow_s(2009, 604_799);
        assert_eq!(
            GpsTime::nearest(0, before),
            GpsTime::from_week_tow_s(2010, 0)
        );
        let after = GpsTime::from_week_tow_s(2010, 0);
        assert_eq!(
            GpsTime::nearest(604_799 * NS_PER_S, after),
            GpsTime::from_week_tow_s(2009, 604_799)
        );
    }

    #[test]
    fn ten_bit_week_takes_the_nearest_era() {
        assert_eq!(resolve_week(2009 % 1024, 1024, 2010), 2009);
        assert_eq!(resolve_week(2048 % 1024, 1024, 2047), 2048);
        assert_eq!(resolve_week(1023, 1024, 2048), 2047);
    }

    #[test]
    fn leap_seconds_change_at_the_announced_instants() {
        // 2017-01-01 00:00:00 UTC is GPST 2017-01-01 00:00:18, GPS week 1930 second 18.
        let step = GpsTime::from_week_tow_s(1930, 18);
        assert_eq!(leap_seconds(step), 18);
        assert_eq!(leap_seconds(step.plus_ns(-1)), 17);
        assert_eq!(leap_seconds(GpsTime::from_ns(0)), 0);
    }

    #[test]
    fn days_start_where_the_calendar_has_them() {
        for day in 0..=57_000 {
            let time = GpsTime::from_ns(day * 86_400 * NS_PER_S);
            let (year, month, day) = civil(day);
            let found = start_of_day(year.try_into().unwrap(), month, day);
            assert_eq!(found, Some(time));
        }
        for (year, month, day) in [
            (2025, 2, 29),
            (2025, 4, 31),
            (2025, 0, 1),
            (2025, 13, 1),
            (2025, 1, 0),
            (1979, 12, 31),
            (0, 0, 0),
            (u16::MAX, 12, 31),
        ] {
            assert_eq!(start_of_day(year, month, day), None, "{year}-{month}-{day}");
        }
    }

    fn text(time: GpsTime) -> std::string::String {
        let utc = utc(time);
        let (s, ns) = (utc.ns_of_minute / NS_PER_S, utc.ns_of_minute % NS_PER_S);
        std::format!(
            "{}-{:02}-{:02} {:02}:{:02}:{s:02}.{ns:09}",
            utc.year,
            utc.month,
            utc.day,
            utc.hour,
            utc.minute
        )
    }

    #[test]
    fn utc_of_dates_known_from_elsewhere() {
        // By the calendar of Python's `datetime`, which knows nothing of leap seconds; those by hand.
        for (week, tow_s, expected) in [
            (0, 0, "1980-01-06 00:00:00.000000000"),
            (-1, 604_799, "1980-01-05 23:59:59.000000000"),
            (1046, 172_813, "2000-01-25 00:00:00.000000000"),
            (1051, 172_813, "2000-02-29 00:00:00.000000000"),
            (2047, 604_799, "2019-04-06 23:59:41.000000000"),
            (2048, 18, "2019-04-07 00:00:00.000000000"),
            (2424, 0, "2026-06-20 23:59:42.000000000"),
            (6260, 0, "2099-12-26 23:59:42.000000000"),
        ] {
            assert_eq!(text(GpsTime::from_week_tow_s(week, tow_s)), expected);
        }
    }

    /// [IERS-C] 52: 2016-12-31 has a second 23:59:60.
    #[test]
    fn an_inserted_second_is_the_sixtieth() {
        let step = GpsTime::from_week_tow_s(1930, 18);
        assert_eq!(text(step), "2017-01-01 00:00:00.000000000");
        for (before_ns, expected) in [
            (1, "2016-12-31 23:59:60.999999999"),
            (NS_PER_S, "2016-12-31 23:59:60.000000000"),
            (NS_PER_S + 1, "2016-12-31 23:59:59.999999999"),
        ] {
            assert_eq!(text(step.plus_ns(-before_ns)), expected);
        }
    }

    #[test]
    fn every_day_follows_the_one_before() {
        let mut last = utc(GpsTime::from_ns(i64::MIN));
        for day in -106_750..=106_750 {
            let next = utc(GpsTime::from_ns(day * 86_400 * NS_PER_S + 20 * NS_PER_S));
            let follows = match (next.month, next.day) {
                (_, day) if day > 1 => {
                    (next.year, next.month, day - 1) == (last.year, last.month, last.day)
                }
                (month, _) if month > 1 => (next.year, month - 1) == (last.year, last.month),
                _ => (next.year - 1, 12, 31) == (last.year, last.month, last.day),
            };
            assert!(follows || day == -106_750, "{last:?} {next:?}");
            last = next;
        }
        utc(GpsTime::from_ns(i64::MAX));
    }
}
