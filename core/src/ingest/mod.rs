//! Checked messages to domain types with units. After this line raw integers do not exist.

mod payload;

pub use payload::{
    MAX_EPOCH_BYTES, ObservationGroup, PayloadError, decode_configuration, decode_ephemeris,
    decode_klobuchar, encode_configuration, encode_end_of_stream, encode_ephemeris,
    encode_klobuchar, encode_observations,
};
