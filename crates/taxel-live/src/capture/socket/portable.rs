//! The portable socket: a call for each datagram. What the kernel drops is unknown, and a datagram's arrival is when it was
//! read.

use std::io::{self, ErrorKind};
use std::net::SocketAddr;
use std::time::Duration;

use mio::net::UdpSocket;
use mio::{Events, Interest, Poll, Token};
use socket2::SockRef;

use super::senders::Senders;
use crate::capture::counts::Totals;
use crate::capture::options::ReceiverOptions;
use crate::capture::queue::Batch;
use crate::kernel_drops::KernelDrops;
use crate::recording::now_ns;

#[derive(Debug)]
pub(crate) struct PortableSocket {
    socket: UdpSocket,
    poll: Poll,
    events: Events,
    totals: Totals,
    senders: Senders<SocketAddr>,
    kernel_buffer_bytes: u64,
    /// Number of bytes that were read since the end was requested.
    read_since_stop: u64,
}

impl PortableSocket {
    pub(super) fn bind(address: SocketAddr, options: &ReceiverOptions) -> io::Result<Self> {
        let mut socket = UdpSocket::bind(address)?;
        let about = SockRef::from(&socket);
        // A system that limits the size may refuse a larger one, or grant less of it.
        let granted =
            about.set_recv_buffer_size(options.kernel_buffer_bytes).and_then(|()| about.recv_buffer_size())?;
        let poll = Poll::new()?;
        poll.registry().register(&mut socket, Token(0), Interest::READABLE)?;
        Ok(Self {
            socket,
            poll,
            events: Events::with_capacity(1),
            totals: Totals { dropped_by_kernel: KernelDrops::UNKNOWN, ..Totals::default() },
            senders: Senders::default(),
            kernel_buffer_bytes: granted as u64,
            read_since_stop: 0,
        })
    }

    pub(super) fn address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    pub(super) fn totals(&self) -> Totals {
        self.totals
    }

    pub(super) fn kernel_buffer_bytes(&self) -> u64 {
        self.kernel_buffer_bytes
    }

    /// Waits for a datagram that arrives after the last call of `receive` found none.
    pub(super) fn wait(&mut self, timeout: Duration) -> io::Result<bool> {
        match self.poll.poll(&mut self.events, Some(timeout)) {
            Err(error) if error.kind() == ErrorKind::Interrupted => Ok(false),
            waited => waited.map(|()| !self.events.is_empty()),
        }
    }

    pub(super) fn receive(&mut self, batch: &mut Batch, ask: bool) -> io::Result<bool> {
        let start = batch.bytes.len();
        let room = batch.bytes.spare_capacity_mut();
        let socket = &self.socket;
        let (length, sender) = match socket.try_io(|| SockRef::from(socket).recv_from(room)) {
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => return Ok(false),
            received => received?,
        };
        // SAFETY: the system wrote `length` bytes into the spare capacity, which is at least as long.
        unsafe { batch.bytes.set_len(start + length) };
        if ask && let Some(sender) = sender.as_socket() {
            self.senders.note(sender, &mut self.totals);
        }
        batch.note_message(start, 0, now_ns());
        Ok(true)
    }

    /// Whether all that waited in the kernel when the end was requested was read, if `batch` was read since: none waits, or as
    /// much was read as the kernel can hold.
    pub(super) fn has_read_until(&mut self, _stopped_ns: i64, batch: &Batch) -> bool {
        self.read_since_stop += batch.bytes.len() as u64;
        batch.is_empty() || self.read_since_stop >= self.kernel_buffer_bytes
    }
}
