//! Fixed columns of a RINEX line.

use surefix_core::gnss::{Satellite, System};
use surefix_core::time::{GpsTime, NS_PER_S};

/// Columns `from..to` of a line, or as much of them as there is.
pub fn columns(line: &str, from: usize, to: usize) -> &str {
    line.get(from.min(line.len())..to.min(line.len()))
        .unwrap_or_default()
}

/// A number in columns `from..to`, with the exponent letter D of Fortran as well as E.
/// `None` for blanks and for what is no finite number.
pub fn number(line: &str, from: usize, to: usize) -> Option<f64> {
    let text = columns(line, from, to).trim();
    if text.is_empty() {
        return None;
    }
    let value: f64 = if text.contains(['D', 'd']) {
        text.replace(['D', 'd'], "E").parse().ok()?
    } else {
        text.parse().ok()?
    };
    value.is_finite().then_some(value)
}

/// A whole number in columns `from..to`.
pub fn integer(line: &str, from: usize, to: usize) -> Option<i64> {
    columns(line, from, to).trim().parse().ok()
}

/// Label of a header line, columns 61 to 80.
pub fn label(line: &str) -> &str {
    columns(line, 60, 80).trim_end()
}

/// The satellite a name of three characters stands for ("G05", "G 5"): `Ok(None)` for a
/// constellation surefix does not use, `Err` for no satellite at all.
pub fn satellite(name: &str) -> Result<Option<Satellite>, ()> {
    let letter = name.chars().next().ok_or(())?;
    let prn: u8 = name.get(1..3).ok_or(())?.trim().parse().map_err(|_| ())?;
    match System::from_letter(letter) {
        Some(system) => Satellite::new(system, prn).map(Some).ok_or(()),
        None if letter.is_ascii_uppercase() => Ok(None),
        None => Err(()),
    }
}

/// A calendar date and time of day in a scale that counts from 1980-01-06 without leap seconds,
/// as nanoseconds of [`GpsTime`]. `second` keeps its decimals as text, so that nothing is rounded.
pub fn calendar(
    year: i64,
    month: i64,
    day: i64,
    hour: i64,
    minute: i64,
    second: &str,
) -> Option<GpsTime> {
    let (whole, decimals) = second.trim().split_once('.').unwrap_or((second.trim(), ""));
    let whole: i64 = whole.trim().parse().ok()?;
    if !(1980..2200).contains(&year)
        || !(1..=12).contains(&month)
        || !(1..=31).contains(&day)
        || !(0..24).contains(&hour)
        || !(0..60).contains(&minute)
        || !(0..=60).contains(&whole)
        || !decimals.bytes().all(|b| b.is_ascii_digit())
    {
        return None;
    }
    let nanoseconds: i64 = format!("{decimals:0<9}").get(..9)?.parse().ok()?;
    // Days since 1970-01-01 by the civil calendar in eras of 400 years that start in March.
    let shifted_year = if month <= 2 { year - 1 } else { year };
    let era = shifted_year.div_euclid(400);
    let year_of_era = shifted_year.rem_euclid(400);
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    let days = era * 146_097 + day_of_era - 719_468 - 3_657;
    let seconds = days * 86_400 + hour * 3_600 + minute * 60 + whole;
    Some(GpsTime::from_ns(seconds * NS_PER_S + nanoseconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calendar_counts_from_the_start_of_gps_time() {
        assert_eq!(calendar(1980, 1, 6, 0, 0, "0"), Some(GpsTime::from_ns(0)));
        let t = calendar(2020, 6, 25, 0, 0, " 0.0000000").unwrap();
        assert_eq!((t.week(), t.tow_ns()), (2111, 345_600 * NS_PER_S));
        let leap_day = calendar(2024, 2, 29, 23, 59, "59.1234567").unwrap();
        let next = calendar(2024, 3, 1, 0, 0, "0").unwrap();
        assert_eq!(next.ns() - leap_day.ns(), 876_543_300);
        assert_eq!(calendar(2024, 13, 1, 0, 0, "0"), None);
    }

    #[test]
    fn fortran_exponents_are_numbers_and_stars_are_not() {
        assert_eq!(number(" 4.6566D-09", 0, 11), Some(4.6566e-9));
        assert_eq!(number("-.226460397243E-04", 0, 19), Some(-2.26460397243e-5));
        assert_eq!(number("***********", 0, 11), None);
        assert_eq!(number("   ", 0, 11), None);
    }

    #[test]
    fn a_blank_in_a_satellite_name_is_a_zero() {
        assert_eq!(satellite("G 5"), satellite("G05"));
        assert_eq!(satellite("R05"), Ok(None));
        assert_eq!(satellite("G99"), Err(()));
    }
}
