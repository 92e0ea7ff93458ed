//! Payload of the receiver's latency. Layout: docs/native-frame.md.

use super::payload::{PayloadError, end};
use crate::ins::MAX_LATENCY_NS;
use crate::wire::native::{self, Full, Kind, Reader};

/// Writes how long after its instant an epoch arrives at the least, ns, as a frame. A latency that is too
/// long is written and refused when read.
///
/// # Errors
/// [`Full`] when `out` is too short.
pub fn encode_receiver_latency(latency_ns: u32, out: &mut [u8]) -> Result<usize, Full> {
    native::encode(Kind::ReceiverLatency, out, |w| w.put_u32(latency_ns))
}

/// Reads how long after its instant an epoch arrives at the least, ns.
///
/// # Errors
/// [`PayloadError`]: wrong length, or more than [`MAX_LATENCY_NS`].
pub fn decode_receiver_latency(payload: &[u8]) -> Result<u32, PayloadError> {
    let mut r = Reader::new(payload);
    let latency_ns = r.u32()?;
    end(&r)?;
    if i64::from(latency_ns) > MAX_LATENCY_NS {
        let value = latency_ns.into();
        return Err(PayloadError::OutOfRange { value });
    }
    Ok(latency_ns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::native::Frame;

    fn read(latency_ns: u32) -> Result<u32, PayloadError> {
        let mut out = [0; 32];
        let length = encode_receiver_latency(latency_ns, &mut out).unwrap();
        let (frame, _) = Frame::parse(&out[..length]).unwrap();
        decode_receiver_latency(frame.payload())
    }

    /// INT-123.
    #[test]
    fn int_123_a_latency_beyond_the_history_is_refused() {
        for latency_ns in [0, 1, 120_000_000, 400_000_000] {
            assert_eq!(read(latency_ns), Ok(latency_ns));
        }
        for latency_ns in [400_000_001, u32::MAX] {
            let value = latency_ns.into();
            assert_eq!(read(latency_ns), Err(PayloadError::OutOfRange { value }));
        }
        for length in [0, 3, 5] {
            assert!(decode_receiver_latency(&[0; 5][..length]).is_err());
        }
    }
}
