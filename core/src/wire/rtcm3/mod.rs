//! RTCM 3.
