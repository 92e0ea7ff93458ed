//! Drivers of sensors against the register models of their parts: every fault of a part and of its wires
//! is a typed, counted fault, and no reading is ever invented.

#[path = "drivers/adis.rs"]
mod adis;
#[path = "drivers/bmp390.rs"]
mod bmp390;
#[path = "drivers/icm42688.rs"]
mod icm42688;
#[path = "drivers/lis3mdl.rs"]
mod lis3mdl;
#[path = "drivers/rig.rs"]
mod rig;
#[path = "drivers/supervision.rs"]
mod supervision;
