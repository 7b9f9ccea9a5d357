//! Receives and counts UDP datagrams: in the caller's thread, or in a separate thread between the socket and a bounded
//! queue. Messages that a program makes ([`MessageFeed`]) pass through the same queue.
//!
//! By default the caller receives in its own thread, which saves a wake-up and a copy. A caller that may wait for a disk requests a
//! separate thread ([`Receiver::receive_in_thread`]), which receives in the meantime.
//!
//! All datagrams are accounted for. At the socket: arrived messages = [`CaptureCounts::messages`] + [`CaptureCounts::dropped_by_kernel`]. Behind it:
//! [`CaptureCounts::datagrams`] = datagrams read + datagrams waiting + [`CaptureCounts::dropped_by_queue`].
//!
//! A *message* is what one receive call returns: a datagram, or, with `UDP_GRO`, a train of datagrams that the kernel
//! merged. The kernel counts its drops in messages, so a datagram-exact count of what it dropped needs `gro` off.
//!
//! Linux counts its drops and stamps arrivals. By the portable calls the drops are unknown, and a datagram's arrival is when
//! it was read; on Linux `TAXEL_CAPTURE=portable` selects these calls.

mod counts;
mod messages;
mod options;
mod queue;
mod sender;
mod socket;
mod system_calls;

use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::locked::lock;
use crate::recording::now_ns;
use crate::{Error, Result};
pub use counts::CaptureCounts;
pub use messages::MessageFeed;
pub use options::ReceiverOptions;
use queue::BatchQueue;
pub use queue::{Batch, Datagram};
pub use sender::{SendCounts, Sender};
use socket::Socket;
use system_calls::SystemCalls;

/// Interval at which the thread checks whether it must stop.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// Number of messages of a batch whose sender is read. Reading it costs 9 % of receiving a message; for batches as full as those
/// at the highest rates, 140 messages of 1400 bytes, less than 1 %. At other rates it is every message.
const SENDERS_READ: u64 = 12;

/// Largest amount received at a time, bytes.
const AT_ONCE: usize = 4 * socket::LARGEST;

/// What else may keep datagrams from a program of this system, to be added to why none arrived.
pub const FIREWALL: &str = if cfg!(windows) { " (Windows' firewall may block datagrams to Python)" } else { "" };

/// Where datagrams come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// A board sends to this address.
    Udp(SocketAddr),
    /// Frames of numbers are read from this place.
    Frames(String),
}

impl std::fmt::Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Udp(address) => write!(f, "UDP {address}"),
            Self::Frames(name) => f.write_str(name),
        }
    }
}

/// Receives datagrams, from [`Receiver::bind`] or [`Receiver::of_messages`] until it is dropped.
#[derive(Debug)]
pub struct Receiver {
    queue: Arc<BatchQueue>,
    origin: Origin,
    input: Input,
}

#[derive(Debug)]
enum Input {
    /// The socket, locked by a caller while it waits for datagrams, or `None` after it was moved into the thread; and
    /// the thread.
    Socket(Box<Mutex<Option<Socket>>>, Mutex<Option<JoinHandle<()>>>),
    /// The messages of a [`MessageFeed`].
    Messages,
}

impl Receiver {
    /// Opens `address`; from then on the kernel queues what arrives.
    ///
    /// # Errors
    ///
    /// `Socket` if the address cannot be bound (taken, not ours), `Core(Problem)` if the queue is smaller than
    /// the largest datagram, or `TAXEL_CAPTURE` has a value that it cannot have.
    pub fn bind(address: SocketAddr, options: ReceiverOptions) -> Result<Self> {
        if options.queue_bytes < socket::LARGEST {
            return Err(taxel_core::problem!(
                "queue_bytes"; " is {}: must be {} or more, the largest datagram",
                options.queue_bytes,
                socket::LARGEST
            )
            .into());
        }
        let name = format!("UDP {address}");
        let socket = Socket::bind(address, &options, SystemCalls::selected()?).map_err(Error::socket(&name))?;
        let address = socket.address().map_err(Error::socket(&name))?;
        let counts = CaptureCounts {
            kernel_buffer_bytes: socket.kernel_buffer_bytes(),
            gro: socket.gro(),
            stamped_when_read: socket.stamps_when_read(),
            dropped_by_kernel: socket.totals().dropped_by_kernel,
            ..CaptureCounts::default()
        };
        let queue = Arc::new(BatchQueue::new(options.queue_bytes, counts));
        let input = Input::Socket(Box::new(Mutex::new(Some(socket))), Mutex::default());
        Ok(Self { queue, origin: Origin::Udp(address), input })
    }

    /// Receives in a separate thread from now on; a feed always has one. If no readout waits for events, the thread
    /// pauses for `gather` after each message, which saves wake-ups; the kernel queues and stamps what arrives in the
    /// meantime.
    ///
    /// # Errors
    ///
    /// `Socket` if the system cannot create a thread.
    pub fn receive_in_thread(&self, gather: Duration) -> Result<()> {
        let Input::Socket(socket, thread) = &self.input else { return Ok(()) };
        let Some(socket) = lock(socket).take() else { return Ok(()) };
        let queue = Arc::clone(&self.queue);
        let begun = std::thread::Builder::new()
            .name("taxel-receive".to_owned())
            .spawn(move || receive(socket, &queue, gather))
            .map_err(|error| {
                // The socket was moved into the thread that could not start, so nothing can be received any more.
                self.queue.close(None);
                Error::socket(&self.origin)(error)
            })?;
        *lock(thread) = Some(begun);
        Ok(())
    }

    /// Receives the messages that the caller passes to the [`MessageFeed`].
    #[must_use]
    pub fn of_messages(origin: Origin) -> (Self, MessageFeed) {
        let limit = ReceiverOptions::default().queue_bytes;
        let queue = Arc::new(BatchQueue::new(limit, CaptureCounts::default()));
        let feed = MessageFeed::new(Arc::clone(&queue));
        (Self { queue, origin, input: Input::Messages }, feed)
    }

    /// Where datagrams come from, with the actual port if 0 was requested.
    #[must_use]
    pub fn origin(&self) -> &Origin {
        &self.origin
    }

    /// The address of the socket; unspecified, with port 0, if there is no socket.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        match self.origin {
            Origin::Udp(address) => address,
            Origin::Frames(_) => (Ipv4Addr::UNSPECIFIED, 0).into(),
        }
    }

    /// If the queue is empty: the time before which every arrived datagram was read, ns of this computer's clock.
    #[must_use]
    pub fn silent_until(&self) -> Option<i64> {
        match &self.input {
            Input::Socket(..) => Some(now_ns()),
            Input::Messages => self.queue.silent_until(),
        }
    }

    /// Waits for datagrams and moves them into `batch`, whose memory is reused; false after `timeout` without any, or at once
    /// when everything was read after [`Receiver::stop`].
    ///
    /// # Errors
    ///
    /// `Socket` if receiving ended because the socket failed.
    pub fn receive(&self, batch: &mut Batch, timeout: Duration) -> Result<bool> {
        let received = match &self.input {
            Input::Socket(socket, _) => {
                let mut socket = lock(socket);
                match &mut *socket {
                    Some(open) => {
                        let received = self.receive_here(open, batch, timeout);
                        if self.queue.is_done() {
                            // Closing the socket lets another receiver bind the address while the counts are still
                            // read.
                            *socket = None;
                        }
                        received
                    }
                    None => self.queue.pop(batch, timeout),
                }
            }
            Input::Messages => self.queue.pop(batch, timeout),
        };
        received.map_err(Error::socket(&self.origin))
    }

    /// Receives in the caller's thread.
    fn receive_here(&self, socket: &mut Socket, batch: &mut Batch, timeout: Duration) -> io::Result<bool> {
        batch.begin(AT_ONCE);
        if self.queue.is_done() {
            return Ok(false);
        }
        let stopped_ns = self.queue.stopped_ns();
        let filled = fill(socket, batch, stopped_ns.map_or(Some(timeout), |_| None));
        if let Ok(messages) = filled {
            self.queue.count(batch, messages, socket.totals());
        }
        if filled.is_err() || stopped_ns.is_some_and(|stopped_ns| socket.has_read_until(stopped_ns, batch)) {
            self.queue.close(None);
        }
        filled.map(|messages| messages > 0)
    }

    /// Counts of what arrived and what was lost.
    #[must_use]
    pub fn counts(&self) -> CaptureCounts {
        self.queue.counts()
    }

    /// Whether receiving has ended and everything was read.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.queue.is_done()
    }

    /// Requests the end: what has arrived so far is received, then nothing more.
    pub fn stop(&self) {
        self.queue.stop();
        if let Input::Messages = self.input {
            self.queue.close(None);
        }
    }
}

impl Drop for Receiver {
    fn drop(&mut self) {
        self.stop();
        if let Input::Socket(_, thread) = &self.input
            && let Some(thread) = lock(thread).take()
        {
            let _ = thread.join();
        }
    }
}

/// The receiving thread: receives from the socket into the queue, until it must stop or the socket fails.
fn receive(mut socket: Socket, queue: &BatchQueue, gather: Duration) {
    let mut scratch = Batch::new();
    let ended = loop {
        scratch.begin(AT_ONCE);
        let stopped_ns = queue.stopped_ns();
        match fill(&mut socket, &mut scratch, stopped_ns.map_or(Some(LOOK_EVERY), |_| None)) {
            Ok(messages) => {
                let ended = stopped_ns.is_some_and(|stopped_ns| socket.has_read_until(stopped_ns, &scratch));
                let full = scratch.room() < socket::LARGEST;
                queue.put(&mut scratch, messages, socket.totals());
                if ended {
                    break Ok(());
                }
                // After a full batch more messages are already waiting.
                if messages > 0 && !full && stopped_ns.is_none() && !gather.is_zero() {
                    std::thread::sleep(gather);
                }
            }
            Err(error) => break Err(error),
        }
    };
    // Closed first, so that the address is free when callers see the end of the queue.
    drop(socket);
    queue.close(ended.err());
}

/// Receives until no message is waiting or the batch is full; waits at most `wait` for the first message.
fn fill(socket: &mut Socket, batch: &mut Batch, wait: Option<Duration>) -> io::Result<u64> {
    let mut messages = 0;
    while batch.room() >= socket::LARGEST {
        if socket.receive(batch, messages < SENDERS_READ)? {
            messages += 1;
        } else if messages > 0 || !wait.map_or(Ok(false), |timeout| socket.wait(timeout))? {
            break;
        }
    }
    if messages == 0 {
        socket.ask_dropped()?;
    }
    Ok(messages)
}
