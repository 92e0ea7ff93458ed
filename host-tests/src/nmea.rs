//! NMEA sentences between native frames, as a reader of the board's output finds them.

use surefix_core::wire::nmea::MAX_SENTENCE_LENGTH;

/// What the start of a piece of output is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sentence<'a> {
    /// A sentence, its line end included, whose checksum is right.
    Whole(&'a str),
    /// The start of what can become one.
    Incomplete,
    /// No sentence.
    None,
}

/// Looks for a sentence at the start of `bytes`.
pub fn find(bytes: &[u8]) -> Sentence<'_> {
    if bytes.first() != Some(&b'$') {
        return Sentence::None;
    }
    let reach = &bytes[..bytes.len().min(MAX_SENTENCE_LENGTH)];
    let Some(end) = reach.iter().position(|byte| *byte == b'\n') else {
        let is_text = |byte: &u8| byte.is_ascii_graphic() || *byte == b'\r';
        return if reach.len() < MAX_SENTENCE_LENGTH && reach.iter().all(is_text) {
            Sentence::Incomplete
        } else {
            Sentence::None
        };
    };
    match std::str::from_utf8(&reach[..=end]) {
        Ok(line) if is_right(line) => Sentence::Whole(line),
        _ => Sentence::None,
    }
}

/// Whether a line ends as a sentence does and its checksum is that of its content.
fn is_right(line: &str) -> bool {
    let parts = line
        .strip_prefix('$')
        .and_then(|line| line.strip_suffix("\r\n"))
        .and_then(|line| line.rsplit_once('*'));
    parts.is_some_and(|(content, sum)| {
        let expected = content.bytes().fold(0, |sum, byte| sum ^ byte);
        content.bytes().all(|byte| byte.is_ascii_graphic()) && sum == format!("{expected:02X}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_is_found_when_it_is_whole_and_right() {
        let line = "$GPGGA,*7A\r\n";
        assert_eq!(find(line.as_bytes()), Sentence::Whole(line));
        let two = format!("{line}$GP");
        assert_eq!(find(two.as_bytes()), Sentence::Whole(line));
        for cut in 1..line.len() {
            assert_eq!(find(&line.as_bytes()[..cut]), Sentence::Incomplete, "{cut}");
        }
        for wrong in [
            "$GPGGA,*57\r\n",
            "$GPGGA,*7A\n",
            "GPGGA,*7A\r\n",
            "$GP GA,*56\r\n",
            "",
        ] {
            assert_eq!(find(wrong.as_bytes()), Sentence::None, "{wrong}");
        }
        // Cut off by a frame.
        assert_eq!(find(b"$GPGG\x53\x46\x01\x12"), Sentence::None);
        assert_eq!(find(&[b'$'; MAX_SENTENCE_LENGTH]), Sentence::None);
        assert_eq!(find(&[b'$'; MAX_SENTENCE_LENGTH - 1]), Sentence::Incomplete);
    }
}
