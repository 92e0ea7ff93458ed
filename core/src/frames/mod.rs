//! Frames of reference and geodesy.
