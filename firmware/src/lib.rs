#![cfg_attr(target_os = "none", no_std)]
//! surefix on a Cortex-M7.
