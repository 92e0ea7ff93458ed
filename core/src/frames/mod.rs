//! Frames of reference, rotations between them, and geodesy.
//!
//! e is the Earth-centred, Earth-fixed frame (ECEF: x to latitude 0 longitude 0, z to the north pole);
//! enu is east, north, up at a point of the WGS-84 ellipsoid, n is north, east, down there; b is
//! forward, right, down of a vehicle.

pub mod geodesy;
pub mod rotation;
