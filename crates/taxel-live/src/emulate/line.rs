//! An emulated serial line: a pseudo-terminal with a stable name, limited to the throughput of its baud rate.

#[cfg(target_os = "linux")]
mod linux;
#[cfg(not(target_os = "linux"))]
mod portable;

use std::collections::VecDeque;
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::Result;
#[cfg(target_os = "linux")]
use linux as terminal;
#[cfg(not(target_os = "linux"))]
use portable as terminal;

/// Number of bits on the line per byte: start, 8 of data, stop.
const BITS_A_BYTE: f64 = 10.0;

/// Size of the buffer of a UART, bytes: the most that can pass at once after a pause.
const GATHERS: f64 = 64.0;

/// Capacity of the send buffer, bytes; more is lost, as on a UART.
const WAITING: usize = 4096;

/// One end of a pseudo-terminal; the other end has a name in the file system, as a serial device has.
#[derive(Debug)]
pub(super) struct PseudoTerminal {
    ours: File,
    /// Kept open, so that the line stays up while no other program has it open.
    _client: File,
    link: PathBuf,
    bytes_per_s: f64,
    /// Number of bytes that may be transferred now, in each direction.
    into: f64,
    out: f64,
    looked: Instant,
    waiting: VecDeque<u8>,
}

impl PseudoTerminal {
    /// Opens a line and creates a link to it at `link`; replaces an earlier link, but not a file.
    ///
    /// # Errors
    ///
    /// `File` if no pseudo-terminal is available, or something other than a link exists at `link`; `Core(Problem)` if the
    /// system has none.
    pub(super) fn open(link: &Path, baud: u32) -> Result<Self> {
        let (ours, client) = terminal::open(link)?;
        let (link, bytes_per_s) = (link.to_owned(), f64::from(baud) / BITS_A_BYTE);
        let (looked, waiting) = (Instant::now(), VecDeque::new());
        Ok(Self { ours, _client: client, link, bytes_per_s, into: 0.0, out: 0.0, looked, waiting })
    }

    /// The bytes received since the last call, limited by the rate of the line.
    pub(super) fn read(&mut self) -> Vec<u8> {
        self.pass();
        let mut bytes = vec![0; self.into as usize];
        let n = loop {
            match self.ours.read(&mut bytes) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                came => break came.unwrap_or(0),
            }
        };
        self.into -= n as f64;
        bytes.truncate(n);
        bytes
    }

    /// Sends bytes, limited by the rate of the line.
    pub(super) fn send(&mut self, lines: &str) {
        let room = WAITING - self.waiting.len();
        self.waiting.extend(lines.bytes().take(room));
        self.pass();
        let now: Vec<u8> = self.waiting.iter().take(self.out as usize).copied().collect();
        if !now.is_empty() {
            let n = match self.ours.write(&now) {
                Ok(n) => n,
                Err(error) if error.kind() == ErrorKind::Interrupted => 0,
                // The terminal's buffer is full because nothing reads it: the bytes are lost, as on a UART.
                Err(_) => now.len(),
            };
            self.out -= n as f64;
            self.waiting.drain(..n);
        }
    }

    fn pass(&mut self) {
        let passed = self.looked.elapsed().as_secs_f64() * self.bytes_per_s;
        self.looked = Instant::now();
        // The limit grows with the time since the last call, so that late polling does not slow the line down
        // permanently.
        let most = GATHERS.max(passed);
        (self.into, self.out) = ((self.into + passed).min(most), (self.out + passed).min(most));
    }
}

impl Drop for PseudoTerminal {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.link);
    }
}

#[cfg(target_os = "linux")]
#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    fn until(line: &mut PseudoTerminal, mut enough: impl FnMut(&mut PseudoTerminal) -> bool) {
        let begun = Instant::now();
        while !enough(line) {
            assert!(begun.elapsed() < Duration::from_secs(30), "never came");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn a_line_has_a_name_and_carries_bytes_no_faster_than_its_rate() {
        let link = std::env::temp_dir().join(format!("taxel-{}-line", std::process::id()));
        let begun = Instant::now();
        let mut line = PseudoTerminal::open(&link, 9600).expect("a pseudo-terminal");
        let mut host = File::options().read(true).write(true).open(&link).expect("the other end");
        host.write_all(&[7; 480]).expect("room");
        let mut came = vec![];
        until(&mut line, |line| {
            came.extend(line.read());
            came.len() == 480
        });
        assert!(begun.elapsed() >= Duration::from_millis(400), "960 bytes a second, 64 at once: {:?}", begun.elapsed());
        assert!(came.iter().all(|&byte| byte == 7));
        line.send("ok REG4=0x000000A0\n");
        until(&mut line, |line| {
            line.send("");
            line.waiting.is_empty()
        });
        let mut received = [0; 64];
        let n = host.read(&mut received).expect("an answer");
        assert!("ok REG4=0x000000A0\n".as_bytes().starts_with(&received[..n]) && n > 0);
        drop(line);
        assert!(!link.exists());
    }

    #[test]
    fn a_file_is_not_replaced_by_a_line() {
        let path = std::env::temp_dir().join(format!("taxel-{}-no-line", std::process::id()));
        std::fs::write(&path, "kept").expect("room");
        assert!(PseudoTerminal::open(&path, 115_200).is_err());
        assert_eq!(std::fs::read_to_string(&path).expect("still there"), "kept");
        std::fs::remove_file(&path).expect("ours");
    }
}
