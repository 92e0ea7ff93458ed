//! RXM-SFRBX: the words of one subframe, page or string as the receiver decoded them.
//! [UBX-F9-HPG] UBX-RXM-SFRBX

use super::PayloadError;
use crate::wire::broadcast::Subframe;

/// Bytes before the first word.
pub const HEADER_LEN: usize = 8;

/// Offset of the number of words.
const COUNT_AT: usize = 4;

/// Whether a length can be that of the message, as far as its content is there.
pub(super) fn length_is_possible(length: usize, content: &[u8]) -> bool {
    let Some(words) = length.checked_sub(HEADER_LEN) else {
        return false;
    };
    words.is_multiple_of(4)
        && content
            .get(COUNT_AT)
            .is_none_or(|count| usize::from(*count) == words / 4)
}

/// Reads the message; `sig_id` is 0 in version 1 of it, which has none.
///
/// # Errors
/// [`PayloadError`]
pub fn parse(payload: &[u8]) -> Result<Subframe<'_>, PayloadError> {
    let (head, words) = payload
        .split_first_chunk::<HEADER_LEN>()
        .ok_or(PayloadError::Length)?;
    let &[
        gnss_id,
        sv_id,
        sig_id,
        _freq_id,
        count,
        _channel,
        version,
        _,
    ] = head;
    if !(1..=2).contains(&version) {
        return Err(PayloadError::Version { version });
    }
    if words.len() != usize::from(count) * 4 {
        return Err(PayloadError::Length);
    }
    Ok(Subframe {
        gnss_id,
        sv_id,
        sig_id: if version >= 2 { sig_id } else { 0 },
        words,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_to_agree_and_the_version_to_be_known() {
        let mut bytes = std::vec![3, 11, 4, 0, 2, 7, 2, 0];
        bytes.extend([4, 3, 2, 1, 8, 7, 6, 5]);
        let subframe = parse(&bytes).unwrap();
        assert_eq!(
            (subframe.gnss_id, subframe.sv_id, subframe.sig_id),
            (3, 11, 4)
        );
        assert_eq!(subframe.words, [4, 3, 2, 1, 8, 7, 6, 5]);
        assert_eq!(parse(&bytes[..12]), Err(PayloadError::Length));
        bytes[6] = 1;
        assert_eq!(parse(&bytes).unwrap().sig_id, 0);
        bytes[6] = 3;
        assert_eq!(parse(&bytes), Err(PayloadError::Version { version: 3 }));
        assert_eq!(parse(&[0; 7]), Err(PayloadError::Length));
    }
}
