//! Frames of any other sensor, from a pipe: 16-bit numbers, little-endian, frame after frame.

use std::fs::File;
use std::io::{ErrorKind, Read};
use std::os::fd::AsRawFd;

use taxel_core::Stop;

use super::Touch;
use crate::{Error, Result};

/// How long to wait for more before looking whether to stop, ms.
const LOOK_EVERY_MS: i32 = 50;

/// A pipe as a touch. The board's time is the pipe's: a frame a frame.
#[derive(Debug)]
pub struct Feed {
    from: File,
    /// What was read ahead of the frames, as the line before them was looked for.
    bytes: Vec<u8>,
    /// A value is divided by 2 so often, so that it fits the ramp.
    shift: u32,
    most: u16,
    frames: u64,
}

impl Feed {
    /// Reads frames from a file or pipe, after some bytes of theirs that were read already. Values are shifted right by
    /// `shift` and end at `most`.
    #[must_use]
    pub fn new(from: File, ahead: Vec<u8>, shift: u32, most: u16) -> Self {
        Self { from, bytes: ahead, shift, most, frames: 0 }
    }
}

impl Touch for Feed {
    fn frame(&mut self, ticks: &mut [u16], stop: Stop<'_>) -> Result<bool> {
        let (wanted, mut piece) = (2 * ticks.len(), [0; 1 << 16]);
        while self.bytes.len() < wanted {
            if stop.asked() {
                return Ok(false);
            }
            let mut poll = libc::pollfd { fd: self.from.as_raw_fd(), events: libc::POLLIN, revents: 0 };
            // SAFETY: one entry, on our stack, of a descriptor that is ours.
            if unsafe { libc::poll(&raw mut poll, 1, LOOK_EVERY_MS) } == 0 {
                continue;
            }
            let room = (wanted - self.bytes.len()).min(piece.len());
            match self.from.read(&mut piece[..room]) {
                Ok(0) if self.bytes.is_empty() => return Ok(false),
                Ok(0) => {
                    let (n, frame) = (self.bytes.len(), self.frames);
                    let said = format!("frame {frame}: ends after {n} bytes, must be {wanted}");
                    return Err(taxel_core::Error::Format(format!("standard input, {said}")).into());
                }
                Ok(n) => self.bytes.extend_from_slice(&piece[..n]),
                Err(error) if matches!(error.kind(), ErrorKind::Interrupted | ErrorKind::WouldBlock) => {}
                Err(error) => return Err(Error::socket("standard input")(error)),
            }
        }
        for (value, bytes) in ticks.iter_mut().zip(self.bytes.chunks_exact(2)) {
            *value = (u16::from_le_bytes([bytes[0], bytes[1]]) >> self.shift).min(self.most);
        }
        self.bytes.drain(..wanted);
        self.frames += 1;
        Ok(true)
    }
}
