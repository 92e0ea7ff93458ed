//! RXM-SFRBX: the words of one subframe, page or string as the receiver decoded them.
//! [UBX-F9-HPG] 3.17.9

use super::PayloadError;

/// Bytes before the first word.
pub const HEADER_LEN: usize = 8;
/// Most words of a message that is used: GPS and BDS send 10, Galileo 8 (9 by some receivers).
pub const MAX_WORDS: usize = 10;

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

/// The message, its words in the order of transmission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sfrbx {
    /// gnssId, as in RXM-RAWX.
    pub gnss_id: u8,
    /// svId, as in RXM-RAWX.
    pub sv_id: u8,
    /// sigId; 0 in version 1 of the message, which does not have it.
    pub sig_id: u8,
    words: [u32; MAX_WORDS],
    count: usize,
}

impl Sfrbx {
    /// Reads the message.
    ///
    /// # Errors
    /// [`PayloadError`]; `TooManyWords` for a navigation message that is none of those used here.
    pub fn parse(payload: &[u8]) -> Result<Self, PayloadError> {
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
        let (sent, rest) = words.as_chunks::<4>();
        if !(1..=2).contains(&version) {
            return Err(PayloadError::Version { version });
        }
        if sent.len() != usize::from(count) || !rest.is_empty() {
            return Err(PayloadError::Length);
        }
        if sent.len() > MAX_WORDS {
            return Err(PayloadError::TooManyWords { count });
        }
        let mut sfrbx = Self {
            gnss_id,
            sv_id,
            sig_id: if version >= 2 { sig_id } else { 0 },
            words: [0; MAX_WORDS],
            count: sent.len(),
        };
        for (word, bytes) in sfrbx.words.iter_mut().zip(sent) {
            *word = u32::from_le_bytes(*bytes);
        }
        Ok(sfrbx)
    }

    /// The words as sent.
    pub fn words(&self) -> &[u32] {
        self.words.get(..self.count).unwrap_or(&[])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_come_out_in_order_and_lengths_have_to_agree() {
        let mut bytes = std::vec![2, 11, 1, 0, 2, 7, 2, 0];
        bytes.extend([4, 3, 2, 1, 8, 7, 6, 5]);
        let sfrbx = Sfrbx::parse(&bytes).unwrap();
        assert_eq!((sfrbx.gnss_id, sfrbx.sv_id, sfrbx.sig_id), (2, 11, 1));
        assert_eq!(sfrbx.words(), [0x0102_0304, 0x0506_0708]);
        assert_eq!(Sfrbx::parse(&bytes[..12]), Err(PayloadError::Length));
        bytes[6] = 3;
        assert_eq!(
            Sfrbx::parse(&bytes),
            Err(PayloadError::Version { version: 3 })
        );
        assert_eq!(Sfrbx::parse(&[0; 7]), Err(PayloadError::Length));
        let mut long = std::vec![2, 11, 8, 0, 16, 7, 2, 0];
        long.extend([0; 64]);
        assert_eq!(
            Sfrbx::parse(&long),
            Err(PayloadError::TooManyWords { count: 16 })
        );
    }
}
