//! Files of the host by semihosting. ARM DUI 0471 (Semihosting for AArch32 and AArch64) SYS_OPEN, SYS_READ,
//! SYS_WRITE.

use core::ffi::CStr;
use cortex_m_semihosting::{nr, syscall};

/// An open file.
pub struct File {
    handle: usize,
}

impl File {
    /// For reading.
    pub fn open(name: &CStr) -> Option<Self> {
        Self::with_mode(name, nr::open::R_BINARY)
    }

    /// For writing, emptied.
    pub fn create(name: &CStr) -> Option<Self> {
        Self::with_mode(name, nr::open::W_TRUNC_BINARY)
    }

    fn with_mode(name: &CStr, mode: usize) -> Option<Self> {
        let length = name.to_bytes().len();
        // SAFETY: the block of SYS_OPEN: a string with its NUL, a mode, the length without the NUL.
        let handle = unsafe { syscall!(OPEN, name.as_ptr(), mode, length) };
        (handle != usize::MAX).then_some(Self { handle })
    }

    /// Writes all; false when the host did not take it.
    pub fn write(&mut self, bytes: &[u8]) -> bool {
        // SAFETY: the block of SYS_WRITE; the host reads the bytes before the call returns.
        let left = unsafe { syscall!(WRITE, self.handle, bytes.as_ptr(), bytes.len()) };
        left == 0
    }

    /// Fills `bytes`; false at the end of the file.
    pub fn read(&mut self, bytes: &mut [u8]) -> bool {
        let mut done = 0;
        while let Some(rest @ [_, ..]) = bytes.get_mut(done..) {
            let length = rest.len();
            // SAFETY: the block of SYS_READ; the host writes at most that many bytes before the call returns.
            let left = unsafe { syscall!(READ, self.handle, rest.as_mut_ptr(), length) };
            if left >= length {
                return false;
            }
            done += length - left;
        }
        true
    }
}
