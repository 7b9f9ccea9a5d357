//! UDP datagrams in, counted: received by the caller, or by a thread of its own between the socket and a bounded queue; or by
//! another computer ([`Feed`]), into the same queue.
//!
//! A caller who takes datagrams receives them in its own thread, which saves a wake-up and a copy. A caller that a disk may hold up
//! asks for a thread ([`Receiver::apart`]), which receives meanwhile.
//!
//! The sums close. At the socket: messages that came = [`Counts::messages`] + [`Counts::dropped_by_kernel`]. Behind it:
//! [`Counts::datagrams`] = those taken + those waiting + [`Counts::dropped_by_queue`].
//!
//! A *message* is what one receive call gives: a datagram, or, with `UDP_GRO`, a train of datagrams that travelled as
//! one. The kernel counts its drops in messages, so a datagram-exact count of what it dropped needs `gro` off.

mod counts;
mod feed;
mod options;
mod parcel;
mod queue;
mod sender;
mod socket;

use std::io;
use std::net::{Ipv4Addr, SocketAddr};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::bridged::Bridged;
use crate::locked::lock;
use crate::recording::now_ns;
use crate::{Error, Result};
pub use counts::Counts;
pub use feed::Feed;
pub use options::ReceiverOptions;
pub use parcel::{LONGEST, Packer};
use queue::Queue;
pub use queue::{Batch, Datagram};
pub use sender::{SendCounts, Sender};
use socket::Socket;

/// How often the thread checks whether it is to stop.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// What is received at once at most, bytes.
const AT_ONCE: usize = 4 * socket::LARGEST;

/// Where datagrams come from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Origin {
    /// A board sends to this address.
    Udp(SocketAddr),
    /// Another computer receives them, and bridges them to this one: its address and the board's name there.
    Bridge(String),
}

impl std::fmt::Display for Origin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Udp(address) => write!(f, "UDP {address}"),
            Self::Bridge(name) => f.write_str(name),
        }
    }
}

/// Receives datagrams, from [`Receiver::bind`] or [`Receiver::fed`] until it is dropped.
#[derive(Debug)]
pub struct Receiver {
    queue: Arc<Queue>,
    place: Origin,
    from: From,
}

#[derive(Debug)]
enum From {
    /// The socket as long as no thread has it, locked by the caller who takes datagrams while it waits; and the thread.
    Socket(Mutex<Option<Socket>>, Mutex<Option<JoinHandle<()>>>),
    Feed(Feed),
}

impl Receiver {
    /// Opens `address`; from then on the kernel keeps what comes.
    ///
    /// # Errors
    ///
    /// `Socket` where the address cannot be bound (taken, not ours), `Core(Problem)` where the queue is smaller than
    /// the largest datagram.
    pub fn bind(address: SocketAddr, options: ReceiverOptions) -> Result<Self> {
        if options.queue_bytes < socket::LARGEST {
            return Err(taxel_core::problem!(
                "queue_bytes is {}: must be {} or more, the largest datagram",
                options.queue_bytes,
                socket::LARGEST
            )
            .into());
        }
        let place = format!("UDP {address}");
        let socket = Socket::bind(address, &options).map_err(Error::socket(&place))?;
        let address = socket.address().map_err(Error::socket(&place))?;
        let counts =
            Counts { kernel_buffer_bytes: socket.kernel_buffer_bytes(), gro: socket.gro(), ..Counts::default() };
        let queue = Arc::new(Queue::new(options.queue_bytes, counts));
        let from = From::Socket(Mutex::new(Some(socket)), Mutex::default());
        Ok(Self { queue, place: Origin::Udp(address), from })
    }

    /// From now on a thread of its own receives, until the end; a feed has one anyway. Where no readout waits for events it may
    /// `gather` for so long after each time: fewer wake-ups, the kernel keeps and stamps what comes meanwhile.
    ///
    /// # Errors
    ///
    /// `Socket` where the system has no thread left.
    pub fn apart(&self, gather: Duration) -> Result<()> {
        let From::Socket(socket, thread) = &self.from else { return Ok(()) };
        let Some(socket) = lock(socket).take() else { return Ok(()) };
        let queue = Arc::clone(&self.queue);
        let begun = std::thread::Builder::new()
            .name("taxel-receive".to_owned())
            .spawn(move || receive(socket, &queue, gather))
            .map_err(|error| {
                // The socket went with the thread that did not begin: nothing can come any more.
                self.queue.close(None);
                Error::socket(&self.place)(error)
            })?;
        *lock(thread) = Some(begun);
        Ok(())
    }

    /// Receives what another computer received; parcels go into the [`Feed`].
    #[must_use]
    pub fn fed(name: &str, options: ReceiverOptions) -> (Self, Feed) {
        let queue = Arc::new(Queue::new(options.queue_bytes, Counts::default()));
        let feed = Feed::new(Arc::clone(&queue));
        (Self { queue, place: Origin::Bridge(name.to_owned()), from: From::Feed(feed.clone()) }, feed)
    }

    /// Where datagrams come from, with the port that was found where 0 was asked for.
    #[must_use]
    pub fn place(&self) -> &Origin {
        &self.place
    }

    /// The address of a socket; unspecified, with port 0, where there is none.
    #[must_use]
    pub fn address(&self) -> SocketAddr {
        match self.place {
            Origin::Udp(address) => address,
            Origin::Bridge(_) => (Ipv4Addr::UNSPECIFIED, 0).into(),
        }
    }

    /// What came over the bridge, where it is one.
    #[must_use]
    pub fn bridged(&self) -> Option<Bridged> {
        match &self.from {
            From::Socket(..) => None,
            From::Feed(feed) => Some(feed.bridged()),
        }
    }

    /// While nothing waits: all that arrived before this was taken, ns of this computer's clock.
    #[must_use]
    pub fn silent_until(&self) -> Option<i64> {
        match &self.from {
            From::Socket(..) => Some(now_ns()),
            From::Feed(_) => self.queue.silent_until(),
        }
    }

    /// Waits until something is there and takes it into `batch`, whose memory is reused; false after `timeout` with nothing,
    /// or at once when everything was taken after [`Receiver::stop`].
    ///
    /// # Errors
    ///
    /// `Socket` where receiving ended because the socket failed.
    pub fn take(&self, batch: &mut Batch, timeout: Duration) -> Result<bool> {
        let taken = match &self.from {
            From::Socket(socket, _) => {
                let mut socket = lock(socket);
                match &mut *socket {
                    Some(own) => {
                        let taken = self.receive(own, batch, timeout);
                        if self.queue.is_done() {
                            // The address is free for the next one, also while the counts are still read.
                            *socket = None;
                        }
                        taken
                    }
                    None => self.queue.take(batch, timeout),
                }
            }
            From::Feed(_) => self.queue.take(batch, timeout),
        };
        taken.map_err(Error::socket(&self.place))
    }

    /// Receives in the caller's thread.
    fn receive(&self, socket: &mut Socket, batch: &mut Batch, timeout: Duration) -> io::Result<bool> {
        batch.begin(AT_ONCE);
        if self.queue.is_done() {
            return Ok(false);
        }
        let stopped_ns = self.queue.stopped_ns();
        let filled = fill(socket, batch, stopped_ns.map_or(Some(timeout), |_| None));
        if let Ok(messages) = filled {
            self.queue.count(batch, messages, socket.dropped());
        }
        if filled.is_err() || stopped_ns.is_some_and(|stopped_ns| batch.ends_after(stopped_ns)) {
            self.queue.close(None);
        }
        filled.map(|messages| messages > 0)
    }

    /// What came and what was lost.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.queue.counts()
    }

    /// Whether receiving has ended and everything was taken.
    #[must_use]
    pub fn is_done(&self) -> bool {
        self.queue.is_done()
    }

    /// Asks for the end: what has come by now is received, then nothing more.
    pub fn stop(&self) {
        self.queue.stop();
        if let From::Feed(_) = self.from {
            self.queue.close(None);
        }
    }
}

impl Drop for Receiver {
    fn drop(&mut self) {
        self.stop();
        if let From::Socket(_, thread) = &self.from
            && let Some(thread) = lock(thread).take()
        {
            let _ = thread.join();
        }
    }
}

/// The thread: receives from the socket into the queue, until it is to stop or the socket fails.
fn receive(mut socket: Socket, queue: &Queue, gather: Duration) {
    let mut scratch = Batch::new();
    let ended = loop {
        scratch.begin(AT_ONCE);
        let stopped_ns = queue.stopped_ns();
        match fill(&mut socket, &mut scratch, stopped_ns.map_or(Some(LOOK_EVERY), |_| None)) {
            Ok(messages) => {
                let ended = stopped_ns.is_some_and(|stopped_ns| scratch.ends_after(stopped_ns));
                let full = scratch.room() < socket::LARGEST;
                queue.put(&mut scratch, messages, socket.dropped());
                if ended {
                    break Ok(());
                }
                // Of a full batch the rest waits already.
                if messages > 0 && !full && stopped_ns.is_none() && !gather.is_zero() {
                    std::thread::sleep(gather);
                }
            }
            Err(error) => break Err(error),
        }
    };
    // The address is free before the queue is closed.
    drop(socket);
    queue.close(ended.err());
}

/// Receives until nothing waits or the batch is full; waits for the first message no longer than `wait`.
fn fill(socket: &mut Socket, batch: &mut Batch, wait: Option<Duration>) -> io::Result<u64> {
    let mut messages = 0;
    while batch.room() >= socket::LARGEST {
        if socket.receive(batch)? {
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
