//! Sends and counts UDP datagrams, for the emulated board and the benchmarks.

#[cfg(target_os = "linux")]
mod linux;

use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use serde::Serialize;
use taxel_core::{Stop, problem};

use super::system_calls::SystemCalls;
use crate::{Error, Result};

/// Largest datagram or train, bytes: it must fit in one IPv4 packet with its headers.
const LARGEST: usize = 65_507;

/// Largest train that the kernel accepts (`UDP_MAX_SEGMENTS` of linux/udp.h before 6.9; later kernels accept twice
/// that).
const TRAIN_DATAGRAMS: usize = 64;

/// Counts of what was sent, whether it was received or not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
pub struct SendCounts {
    /// Send calls: trains of datagrams, or single ones.
    pub messages: u64,
    /// Number of datagrams sent.
    pub datagrams: u64,
    /// Number of payload bytes sent.
    pub bytes: u64,
    /// Whether the kernel splits trains into datagrams (`UDP_SEGMENT`).
    pub segmenting: bool,
}

/// Sends datagrams to one address, in trains if the kernel can split them.
///
/// A datagram is sent when the next one does not fit its train, or with [`Sender::flush`]; a board flushes at the end
/// of each frame.
#[derive(Debug)]
pub struct Sender {
    calls: SystemCalls,
    socket: UdpSocket,
    to: SocketAddr,
    train: Vec<u8>,
    /// Length of each datagram of the train except the last, bytes.
    segment: usize,
    datagrams: usize,
    counts: SendCounts,
}

/// The unspecified address of the same family (IPv4 or IPv6).
fn unspecified(to: SocketAddr) -> SocketAddr {
    match to {
        SocketAddr::V4(_) => (Ipv4Addr::UNSPECIFIED, 0).into(),
        SocketAddr::V6(_) => (Ipv6Addr::UNSPECIFIED, 0).into(),
    }
}

impl Sender {
    /// Prepares to send to `to`; with `segment`, in trains if the kernel can split them.
    ///
    /// # Errors
    ///
    /// `Socket` if no socket can be opened, `Core(Problem)` if `TAXEL_CAPTURE` has a value that it cannot have.
    pub fn open(to: SocketAddr, segment: bool) -> Result<Self> {
        Self::open_from(0, to, segment)
    }

    /// As [`Sender::open`], from a given local port; 0 selects a free one.
    ///
    /// # Errors
    ///
    /// As [`Sender::open`], and if the port is in use.
    pub fn open_from(port: u16, to: SocketAddr, segment: bool) -> Result<Self> {
        let mut from = unspecified(to);
        from.set_port(port);
        let socket = UdpSocket::bind(from).map_err(Error::socket(format!("UDP from port {port} to {to}")))?;
        // The socket is not connected: a connected socket returns errors while there is no receiver, and a board sends
        // regardless.
        let calls = SystemCalls::selected()?;
        let segmenting = segment
            && match calls {
                #[cfg(target_os = "linux")]
                SystemCalls::Linux => linux::splits_trains(&socket),
                SystemCalls::Portable => false,
            };
        let counts = SendCounts { segmenting, ..SendCounts::default() };
        Ok(Self { calls, socket, to, train: Vec::with_capacity(LARGEST), segment: 0, datagrams: 0, counts })
    }

    /// Counts of what was sent.
    #[must_use]
    pub fn counts(&self) -> SendCounts {
        self.counts
    }

    /// Adds a datagram.
    ///
    /// # Errors
    ///
    /// `Socket` if the system refuses to send, for example because a datagram is too long.
    pub fn push(&mut self, datagram: &[u8]) -> Result<()> {
        let joins = self.counts.segmenting
            && self.datagrams > 0
            && self.datagrams < TRAIN_DATAGRAMS
            && !datagram.is_empty()
            && datagram.len() <= self.segment
            && self.train.len() == self.datagrams * self.segment
            && self.train.len() + datagram.len() <= LARGEST;
        if !joins {
            self.flush()?;
            self.segment = datagram.len();
        }
        self.train.extend_from_slice(datagram);
        self.datagrams += 1;
        if self.counts.segmenting { Ok(()) } else { self.flush() }
    }

    /// Sends datagrams repeatedly, `each` of them every `period_us`, for `seconds` or until asked to stop: for
    /// benchmarks.
    ///
    /// # Errors
    ///
    /// `Core(Problem)` if an argument is out of range; otherwise as [`Sender::push`].
    pub fn repeat(
        &mut self,
        datagrams: &[Vec<u8>],
        each: usize,
        period_us: f64,
        seconds: f64,
        stop: Stop<'_>,
    ) -> Result<()> {
        if datagrams.is_empty() || each == 0 {
            return Err(
                problem!("send: the number of datagrams, and how many are sent at a time, must be 1 or more").into()
            );
        }
        for (name, value) in [("period_us", period_us), ("seconds", seconds)] {
            if !(0.0..=1e9).contains(&value) {
                return Err(problem!(name; " is {value}: must be from 0 to 1e9").into());
            }
        }
        let begun = Instant::now();
        let mut next = datagrams.iter().cycle();
        for period in 0_u32.. {
            let due = Duration::from_secs_f64(f64::from(period) * period_us * 1e-6);
            if due.as_secs_f64() >= seconds || begun.elapsed().as_secs_f64() >= seconds || stop.asked() {
                break;
            }
            std::thread::sleep(due.saturating_sub(begun.elapsed()));
            for datagram in next.by_ref().take(each) {
                self.push(datagram)?;
            }
            self.flush()?;
        }
        Ok(())
    }

    /// Sends the datagrams that wait.
    ///
    /// # Errors
    ///
    /// `Socket` if the system refuses to send.
    pub fn flush(&mut self) -> Result<()> {
        if self.datagrams == 0 {
            return Ok(());
        }
        self.send().map_err(Error::socket(format!("UDP to {}", self.to)))?;
        self.counts.messages += 1;
        self.counts.datagrams += self.datagrams as u64;
        self.counts.bytes += self.train.len() as u64;
        self.train.clear();
        self.datagrams = 0;
        Ok(())
    }

    fn send(&mut self) -> io::Result<()> {
        match self.calls {
            #[cfg(target_os = "linux")]
            SystemCalls::Linux if self.datagrams > 1 => {
                linux::send_train(&self.socket, &mut self.train, self.segment, self.to)
            }
            _ => self.socket.send_to(&self.train, self.to).map(drop),
        }
    }
}
