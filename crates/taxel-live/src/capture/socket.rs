//! A UDP socket that datagrams are received from, by the system's calls that are selected.

#[cfg(target_os = "linux")]
mod linux;
mod portable;
mod senders;

use std::io;
use std::net::SocketAddr;
use std::time::Duration;

#[cfg(target_os = "linux")]
pub(super) use linux::set;

use super::counts::Totals;
use super::options::ReceiverOptions;
use super::queue::Batch;
use super::system_calls::SystemCalls;
#[cfg(target_os = "linux")]
use linux::LinuxSocket;
use portable::PortableSocket;

/// Largest UDP message, single or train, bytes.
pub(super) const LARGEST: usize = 1 << 16;

#[derive(Debug)]
pub(super) enum Socket {
    #[cfg(target_os = "linux")]
    Linux(LinuxSocket),
    Portable(PortableSocket),
}

/// Calls the method of the socket that is open.
macro_rules! of_either {
    ($socket:expr, $open:ident => $call:expr) => {
        match $socket {
            #[cfg(target_os = "linux")]
            Socket::Linux($open) => $call,
            Socket::Portable($open) => $call,
        }
    };
}

impl Socket {
    pub(super) fn bind(address: SocketAddr, options: &ReceiverOptions, calls: SystemCalls) -> io::Result<Self> {
        match calls {
            #[cfg(target_os = "linux")]
            SystemCalls::Linux => LinuxSocket::bind(address, options).map(Self::Linux),
            SystemCalls::Portable => PortableSocket::bind(address, options).map(Self::Portable),
        }
    }

    pub(super) fn address(&self) -> io::Result<SocketAddr> {
        of_either!(self, open => open.address())
    }

    /// Whether one call can return several datagrams.
    pub(super) fn gro(&self) -> bool {
        match self {
            #[cfg(target_os = "linux")]
            Self::Linux(open) => open.gro(),
            Self::Portable(_) => false,
        }
    }

    /// Whether a datagram's arrival is when it was read, as the kernel does not stamp it.
    pub(super) fn stamps_when_read(&self) -> bool {
        matches!(self, Self::Portable(_))
    }

    /// What it counted so far; the messages that the kernel has dropped as last read.
    pub(super) fn totals(&self) -> Totals {
        of_either!(self, open => open.totals())
    }

    /// Size of the kernel's queue, bytes.
    pub(super) fn kernel_buffer_bytes(&self) -> u64 {
        of_either!(self, open => open.kernel_buffer_bytes())
    }

    /// Waits for a message, at most for `timeout`; returns false if none arrived.
    pub(super) fn wait(&mut self, timeout: Duration) -> io::Result<bool> {
        of_either!(self, open => open.wait(timeout))
    }

    /// Appends the next message to `batch`, which must have room for [`LARGEST`] bytes; returns false if there is none. With
    /// `ask` its sender is compared with those before.
    #[inline]
    pub(super) fn receive(&mut self, batch: &mut Batch, ask: bool) -> io::Result<bool> {
        of_either!(self, open => open.receive(batch, ask))
    }

    /// Reads the drop count from the kernel: the count in a message only includes drops before that message.
    pub(super) fn ask_dropped(&mut self) -> io::Result<()> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Linux(open) => open.ask_dropped(),
            Self::Portable(_) => Ok(()),
        }
    }

    /// Whether all that had arrived by `stopped_ns`, when the end was requested, was read; `batch` is what was read last, since
    /// then.
    pub(super) fn has_read_until(&mut self, stopped_ns: i64, batch: &Batch) -> bool {
        of_either!(self, open => open.has_read_until(stopped_ns, batch))
    }
}
