//! Reads frames of any other sensor from a pipe: 16-bit numbers, little-endian, frame after frame.

use std::fs::File;
use std::time::Duration;

use taxel_core::Stop;

use super::Touch;
use crate::readable_file::ReadableFile;
use crate::{Error, Result};

/// Longest wait for data before the board reads commands again.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// Frames from a pipe as the input of a board. The pipe determines the pace: the board scans a frame whenever one is
/// complete.
#[derive(Debug)]
pub struct PipedFrames {
    from: ReadableFile,
    /// Bytes of frames that were already read together with the preceding header line.
    bytes: Vec<u8>,
    /// Number of bits by which values are shifted right, so that they fit the ramp.
    shift: u32,
    most: u16,
    /// Size of a frame, bytes.
    wanted: usize,
    frames: u64,
    ended: bool,
}

impl PipedFrames {
    /// Reads frames of `taxels` taxels from a file or pipe, preceded by bytes that were read already. Values are
    /// shifted right by `shift` and limited to `most`.
    #[must_use]
    pub fn new(taxels: usize, from: File, ahead: Vec<u8>, shift: u32, most: u16) -> Self {
        Self { from: ReadableFile::new(from), bytes: ahead, shift, most, wanted: 2 * taxels, frames: 0, ended: false }
    }
}

impl Touch for PipedFrames {
    fn has_frame(&mut self) -> Result<bool> {
        let mut piece = [0; 1 << 16];
        while !self.ended && self.bytes.len() < self.wanted {
            let room = (self.wanted - self.bytes.len()).min(piece.len());
            match self.from.read(&mut piece[..room], LOOK_EVERY).map_err(Error::socket("standard input"))? {
                None => return Ok(false),
                Some(0) => self.ended = true,
                Some(n) => self.bytes.extend_from_slice(&piece[..n]),
            }
        }
        Ok(true)
    }

    fn frame(&mut self, ticks: &mut [u16], stop: Stop<'_>) -> Result<bool> {
        while !self.has_frame()? {
            if stop.asked() {
                return Ok(false);
            }
        }
        if self.bytes.len() < self.wanted {
            let (n, wanted, frame) = (self.bytes.len(), self.wanted, self.frames);
            if n == 0 {
                return Ok(false);
            }
            let reason = format!("frame {frame}: ends after {n} bytes; must have {wanted}");
            return Err(taxel_core::Error::format(format!("standard input, {reason}")).into());
        }
        for (value, bytes) in ticks.iter_mut().zip(self.bytes.chunks_exact(2)) {
            *value = (u16::from_le_bytes([bytes[0], bytes[1]]) >> self.shift).min(self.most);
        }
        self.bytes.drain(..self.wanted);
        self.frames += 1;
        Ok(true)
    }
}
