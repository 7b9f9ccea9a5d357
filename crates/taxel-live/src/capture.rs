//! UDP datagrams in, counted: a thread between the socket and a bounded queue; or what another computer received
//! ([`Feed`]), into the same queue.
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
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use crate::bridged::Bridged;
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

/// After a stop the socket is emptied for no longer than this, even when a sender never pauses.
const EMPTY_FOR: Duration = Duration::from_millis(50);

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
    /// A thread of its own reads the socket.
    Socket(Option<JoinHandle<()>>),
    Feed(Feed),
}

impl Receiver {
    /// Opens `address` and begins to receive.
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
        let theirs = Arc::clone(&queue);
        let thread = std::thread::Builder::new()
            .name("taxel-receive".to_owned())
            .spawn(move || receive(socket, &theirs))
            .map_err(Error::socket(&place))?;
        Ok(Self { queue, place: Origin::Udp(address), from: From::Socket(Some(thread)) })
    }

    /// Hears what another computer receives; parcels go into the [`Feed`].
    #[must_use]
    pub fn fed(name: &str, options: ReceiverOptions) -> (Self, Feed) {
        let queue = Arc::new(Queue::new(options.queue_bytes, Counts::default()));
        let feed = Feed::new(Arc::clone(&queue));
        (Self { queue, place: Origin::Bridge(name.to_owned()), from: From::Feed(feed.clone()) }, feed)
    }

    /// Where it listens; the port that was found where 0 was asked for.
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
            From::Socket(_) => None,
            From::Feed(feed) => Some(feed.bridged()),
        }
    }

    /// While nothing waits: all that arrived before this was taken, ns of this computer's clock.
    #[must_use]
    pub fn silent_until(&self) -> Option<i64> {
        match &self.from {
            From::Socket(_) => Some(now_ns()),
            From::Feed(_) => self.queue.silent_until(),
        }
    }

    /// Waits until something is there and takes all of it into `batch`, whose memory is reused; false after `timeout`
    /// with nothing, or at once when everything was taken after [`Receiver::stop`].
    ///
    /// # Errors
    ///
    /// `Socket` where the receiving thread ended because the socket failed.
    pub fn take(&self, batch: &mut Batch, timeout: Duration) -> Result<bool> {
        self.queue.take(batch, timeout).map_err(Error::socket(&self.place))
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

    /// Asks the thread to end: it takes in what the kernel still holds, then lets go of the socket.
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
        if let From::Socket(thread) = &mut self.from
            && let Some(thread) = thread.take()
        {
            let _ = thread.join();
        }
    }
}

/// The thread's one job: from the socket into the queue, until told to stop or the socket fails.
fn receive(mut socket: Socket, queue: &Queue) {
    let mut scratch = Batch::with_room(4 * socket::LARGEST);
    let ended = loop {
        if queue.stop_asked() {
            break empty(&mut socket, &mut scratch, queue);
        }
        match fill(&mut socket, &mut scratch, true) {
            Ok(messages) => queue.put(&mut scratch, messages, socket.dropped()),
            Err(error) => break Err(error),
        }
    };
    queue.close(ended.err());
}

/// Takes in what the kernel still holds.
fn empty(socket: &mut Socket, scratch: &mut Batch, queue: &Queue) -> io::Result<()> {
    let begun = Instant::now();
    loop {
        let messages = fill(socket, scratch, false)?;
        socket.ask_dropped()?;
        queue.put(scratch, messages, socket.dropped());
        if messages == 0 || begun.elapsed() > EMPTY_FOR {
            return Ok(());
        }
    }
}

/// Receives until nothing waits or the batch is full; `wait`s for the first message no longer than [`socket::LOOK_EVERY`].
fn fill(socket: &mut Socket, batch: &mut Batch, wait: bool) -> io::Result<u64> {
    let mut messages = 0;
    while batch.room() >= socket::LARGEST && socket.receive(batch, wait && messages == 0)? {
        messages += 1;
    }
    if messages == 0 {
        socket.ask_dropped()?;
    }
    Ok(messages)
}
