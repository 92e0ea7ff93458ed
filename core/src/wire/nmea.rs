//! NMEA 0183 sentences into a caller's bytes: fields, checksum, line end.
//!
//! ```text
//! $ GN GGA , field , field … *hh CR LF        hh: exclusive or of all between $ and *
//! ```
//!
//! Numbers are scaled to integers, rounded once, half away from zero, and written digit by digit. What is
//! not finite or out of the field's range is an empty field, which [NMEA-0183] 5.2.2.3 has for a value that is
//! not known. Sources: [NMEA-0183] 5.3 (form of a sentence), 6.2 (fields), as [IEC-61162-1] has them too.

use core::num::NonZeroU64;

use super::native::{Full, Writer};

/// Longest sentence, `$` and line end included, bytes. [NMEA-0183] 5.3
pub const MAX_SENTENCE_LENGTH: usize = 82;

/// Digits of an angle's minutes behind the point: 1e-7 minutes are 0.2 mm.
pub const MINUTE_DECIMALS: u32 = 7;
const PER_MINUTE: u64 = 10_000_000;
const PER_DEGREE: u64 = 60 * PER_MINUTE;

/// Most decimals of a field.
const MAX_DECIMALS: u32 = 9;

/// The fields of a sentence, written one after the other. Each begins with its comma.
#[derive(Debug)]
pub struct Fields<'a> {
    writer: Writer<'a>,
}

/// Writes one sentence to the start of `out` and tells its length in bytes; `fill` writes the fields.
///
/// # Errors
/// [`Full`] when it does not fit into `out` or is longer than [`MAX_SENTENCE_LENGTH`]; nothing in `out` is then
/// to be used.
pub fn write(
    out: &mut [u8],
    talker: [u8; 2],
    formatter: [u8; 3],
    fill: impl FnOnce(&mut Fields<'_>) -> Result<(), Full>,
) -> Result<usize, Full> {
    let longest = if out.len() < MAX_SENTENCE_LENGTH {
        out.len()
    } else {
        MAX_SENTENCE_LENGTH
    };
    let out = out.get_mut(..longest).ok_or(Full)?;
    let mut fields = Fields {
        writer: Writer::new(out),
    };
    fields.writer.put_u8(b'$')?;
    fields.writer.put_bytes(&talker)?;
    fields.writer.put_bytes(&formatter)?;
    fill(&mut fields)?;
    let end = fields.writer.len();
    let covered = out.get(1..end).ok_or(Full)?;
    let checksum = covered.iter().fold(0, |sum, byte| sum ^ byte);
    let mut tail = Writer::new(out.get_mut(end..).ok_or(Full)?);
    tail.put_bytes(&[
        b'*',
        hexadecimal(checksum >> 4),
        hexadecimal(checksum & 15),
        b'\r',
        b'\n',
    ])?;
    Ok(end.saturating_add(tail.len()))
}

const fn hexadecimal(nibble: u8) -> u8 {
    if nibble < 10 {
        b'0' + nibble
    } else {
        b'A' - 10 + (nibble & 15)
    }
}

/// `value` in units of 1/`per`, rounded; `None` beyond `limit` of them, and for NaN.
fn scaled(value: f64, per: f64, limit: f64) -> Option<i64> {
    let units = libm::round(value * per);
    (libm::fabs(units) <= limit).then_some(units as i64)
}

/// An angle whose unit of writing is 1e-7 minutes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Angle {
    units: i64,
}

impl Angle {
    /// A latitude; `None` beyond the poles, and for NaN.
    pub fn latitude(deg: f64) -> Option<Self> {
        let units = scaled(deg, PER_DEGREE as f64, (90 * PER_DEGREE) as f64)?;
        Some(Self { units })
    }

    /// A longitude; `None` beyond 180° in either direction, and for NaN.
    pub fn longitude(deg: f64) -> Option<Self> {
        let units = scaled(deg, PER_DEGREE as f64, (180 * PER_DEGREE) as f64)?;
        Some(Self { units })
    }
}

impl Fields<'_> {
    /// A field without a value.
    pub fn empty(&mut self) -> Result<(), Full> {
        self.writer.put_u8(b',')
    }

    /// `count` fields without a value.
    pub fn empties(&mut self, count: u8) -> Result<(), Full> {
        (0..count).try_for_each(|_| self.empty())
    }

    /// A letter, or no value.
    pub fn letter(&mut self, letter: Option<u8>) -> Result<(), Full> {
        self.empty()?;
        letter.map_or(Ok(()), |letter| self.writer.put_u8(letter))
    }

    /// A whole number of at least `width` digits.
    pub fn integer(&mut self, value: u64, width: u32) -> Result<(), Full> {
        self.empty()?;
        self.digits(value, width)
    }

    /// A number with `decimals` (at most 9) behind the point. Not finite, of a magnitude of more than
    /// `largest`, or absent: no value.
    pub fn fixed(&mut self, value: Option<f64>, decimals: u32, largest: u32) -> Result<(), Full> {
        self.empty()?;
        let decimals = if decimals < MAX_DECIMALS {
            decimals
        } else {
            MAX_DECIMALS
        };
        // Dividing by it cannot fail.
        let per = NonZeroU64::new(10_u64.wrapping_pow(decimals)).unwrap_or(NonZeroU64::MIN);
        let per_f64 = per.get() as f64;
        let limit = per_f64 * f64::from(largest);
        let Some(units) = value.and_then(|value| scaled(value, per_f64, limit)) else {
            return Ok(());
        };
        if units < 0 {
            self.writer.put_u8(b'-')?;
        }
        let magnitude = units.unsigned_abs();
        self.digits(magnitude / per, 1)?;
        if decimals > 0 {
            self.writer.put_u8(b'.')?;
            self.digits(magnitude % per, decimals)?;
        }
        Ok(())
    }

    /// Latitude and its hemisphere, two fields: ddmm.mmmmmmm.
    pub fn latitude(&mut self, angle: Option<Angle>) -> Result<(), Full> {
        self.angle(angle, 2, [b'N', b'S'])
    }

    /// Longitude and its hemisphere, two fields: dddmm.mmmmmmm.
    pub fn longitude(&mut self, angle: Option<Angle>) -> Result<(), Full> {
        self.angle(angle, 3, [b'E', b'W'])
    }

    fn angle(
        &mut self,
        angle: Option<Angle>,
        degree_digits: u32,
        [positive, negative]: [u8; 2],
    ) -> Result<(), Full> {
        let Some(Angle { units }) = angle else {
            return self.empties(2);
        };
        let magnitude = units.unsigned_abs();
        self.integer(magnitude / PER_DEGREE, degree_digits)?;
        self.digits(magnitude % PER_DEGREE / PER_MINUTE, 2)?;
        self.writer.put_u8(b'.')?;
        self.digits(magnitude % PER_MINUTE, MINUTE_DECIMALS)?;
        self.letter(Some(if units < 0 { negative } else { positive }))
    }

    /// Time of day: hhmmss.ss, or no value.
    pub fn time(&mut self, time: Option<[u8; 4]>) -> Result<(), Full> {
        self.empty()?;
        let Some([hour, minute, second, hundredth]) = time else {
            return Ok(());
        };
        for value in [hour, minute, second] {
            self.digits(u64::from(value), 2)?;
        }
        self.writer.put_u8(b'.')?;
        self.digits(u64::from(hundredth), 2)
    }

    /// Date: ddmmyy, or no value.
    pub fn date(&mut self, date: Option<[u8; 3]>) -> Result<(), Full> {
        self.empty()?;
        for value in date.iter().flatten() {
            self.digits(u64::from(*value), 2)?;
        }
        Ok(())
    }

    /// The digits of a number, at least `width` of them.
    fn digits(&mut self, value: u64, width: u32) -> Result<(), Full> {
        let mut text = [b'0'; 20];
        let (mut rest, mut count) = (value, 0);
        for place in text.iter_mut().rev() {
            if rest == 0 && count >= width {
                break;
            }
            *place = b'0' + (rest % 10) as u8;
            rest /= 10;
            count += 1;
        }
        let start = text.len().saturating_sub(count as usize);
        self.writer.put_bytes(text.get(start..).ok_or(Full)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::String;

    fn sentence(fill: impl FnOnce(&mut Fields<'_>) -> Result<(), Full>) -> String {
        let mut out = [0; MAX_SENTENCE_LENGTH];
        let length = write(&mut out, *b"GN", *b"XYZ", fill).unwrap();
        String::from_utf8(out[..length].to_vec()).unwrap()
    }

    fn field(fill: impl FnOnce(&mut Fields<'_>) -> Result<(), Full>) -> String {
        let text = sentence(fill);
        let fields = text.strip_prefix("$GNXYZ,").unwrap();
        fields[..fields.find('*').unwrap()].into()
    }

    #[test]
    fn checksum_of_a_sentence_known_from_elsewhere() {
        // The example of [NMEA-0183]'s RMC that every tutorial repeats.
        let mut out = [0; MAX_SENTENCE_LENGTH];
        let length = write(&mut out, *b"GP", *b"RMC", |fields| {
            for text in [
                "123519",
                "A",
                "4807.038",
                "N",
                "01131.000",
                "E",
                "022.4",
                "084.4",
                "230394",
                "003.1",
                "W",
            ] {
                fields.empty()?;
                fields.writer.put_bytes(text.as_bytes())?;
            }
            Ok(())
        });
        assert_eq!(
            &out[..length.unwrap()],
            b"$GPRMC,123519,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W*6A\r\n"
        );
    }

    #[test]
    fn angles_roll_over_and_keep_their_hemisphere() {
        let lat = |deg: f64| field(|f| f.latitude(Angle::latitude(deg)));
        let lon = |deg: f64| field(|f| f.longitude(Angle::longitude(deg)));
        assert_eq!(lat(0.0), "0000.0000000,N");
        assert_eq!(lat(-0.0), "0000.0000000,N");
        assert_eq!(lat(-1e-12), "0000.0000000,N", "no negative zero");
        assert_eq!(lat(55.0 + 59.999_999_94 / 60.0), "5559.9999999,N");
        assert_eq!(lat(55.0 + 59.999_999_96 / 60.0), "5600.0000000,N");
        assert_eq!(lat(-55.0 - 59.999_999_96 / 60.0), "5600.0000000,S");
        assert_eq!(lat(9.5), "0930.0000000,N");
        assert_eq!(
            (lat(90.0), lat(-90.0)),
            ("9000.0000000,N".into(), "9000.0000000,S".into())
        );
        assert_eq!(lat(90.000_001), ",");
        assert_eq!(
            (lon(180.0), lon(-180.0)),
            ("18000.0000000,E".into(), "18000.0000000,W".into())
        );
        assert_eq!(lon(179.999_999_999_999), "18000.0000000,E");
        assert_eq!(lon(-7.25), "00715.0000000,W");
        assert_eq!(lon(180.000_001), ",");
        for nothing in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
            assert_eq!((lat(nothing), lon(nothing)), (",".into(), ",".into()));
        }
    }

    #[test]
    fn numbers_are_rounded_once_and_are_empty_out_of_range() {
        let fixed =
            |value: f64, decimals, largest| field(|f| f.fixed(Some(value), decimals, largest));
        assert_eq!(fixed(0.0, 3, 9), "0.000");
        assert_eq!(fixed(-0.0, 3, 9), "0.000");
        assert_eq!(fixed(-0.000_4, 3, 9), "0.000", "no negative zero");
        assert_eq!(fixed(-0.000_6, 3, 9), "-0.001");
        assert_eq!(fixed(1.999_5, 3, 9), "2.000");
        assert_eq!(fixed(-12.5, 0, 99), "-13");
        assert_eq!(fixed(99.994, 2, 100), "99.99");
        assert_eq!(fixed(123.0, 12, 1000), "123.000000000");
        assert_eq!(fixed(9.000_4, 3, 9), "9.000");
        for nothing in [
            9.000_6,
            -9.000_6,
            f64::NAN,
            f64::INFINITY,
            f64::NEG_INFINITY,
        ] {
            assert_eq!(fixed(nothing, 3, 9), "");
        }
        assert_eq!(field(|f| f.fixed(None, 3, 9)), "");
        assert_eq!(field(|f| f.integer(7, 2)), "07");
        assert_eq!(field(|f| f.integer(u64::MAX, 1)), "18446744073709551615");
        assert_eq!(field(|f| f.time(Some([0, 0, 60, 99]))), "000060.99");
        assert_eq!(field(|f| f.date(Some([1, 12, 9]))), "011209");
        assert_eq!(field(|f| f.time(None).and_then(|()| f.date(None))), ",");
    }

    #[test]
    fn a_sentence_that_does_not_fit_is_refused_at_every_size() {
        let fill = |count: u8| move |fields: &mut Fields<'_>| fields.empties(count);
        let mut out = [0; 200];
        // "$GNXYZ" before and "*hh", CR, LF behind.
        let room = (MAX_SENTENCE_LENGTH - 6 - 5) as u8;
        assert_eq!(write(&mut out, *b"GN", *b"XYZ", fill(room)), Ok(82));
        assert_eq!(write(&mut out, *b"GN", *b"XYZ", fill(room + 1)), Err(Full));
        for size in 0..14 {
            let written = write(&mut out[..size], *b"GN", *b"XYZ", fill(3));
            assert_eq!(written, Err(Full), "{size}");
        }
        assert_eq!(write(&mut out[..14], *b"GN", *b"XYZ", fill(3)), Ok(14));
    }
}
