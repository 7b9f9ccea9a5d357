//! Datagrams that another computer received, in place of a socket: reads parcels, converts their times to this computer's clock, and
//! counts every loss.

use std::io;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use super::counts::Totals;
use super::parcel::Parcel;
use super::queue::{Batch, BatchQueue};
use crate::bridged::Bridged;
use crate::host_clock::{HostClock, RoundTrip};
use crate::kernel_drops::KernelDrops;
use crate::locked::lock;

/// A bridge sends a parcel every 10 ms: after this long without one the bridge or the network is down.
const SILENT: Duration = Duration::from_secs(1);

#[derive(Debug, Clone, Copy)]
struct FeedSession {
    session: u64,
    number: u64,
    /// The number of the next datagram if none is missing.
    next: u64,
    dropped: u64,
    dropped_by_kernel: KernelDrops,
}

#[derive(Debug, Default)]
struct FeedState {
    bridged: Bridged,
    clock: HostClock,
    session: Option<FeedSession>,
    received: Option<Instant>,
    batch: Batch,
}

/// Accepts the parcels of another computer; clones accept them for the same queue.
#[derive(Debug, Clone)]
pub struct ParcelFeed {
    queue: Arc<BatchQueue>,
    state: Arc<Mutex<FeedState>>,
}

impl ParcelFeed {
    pub(super) fn new(queue: Arc<BatchQueue>) -> Self {
        Self { queue, state: Arc::default() }
    }

    /// Queues the datagrams of a parcel. Returns false without any effect if the parcel begins a session and
    /// [`ParcelFeed::begin_session`] was not called for it.
    ///
    /// Parcels that cannot be read, and repeated ones, are counted and ignored.
    pub fn push(&self, parcel: &[u8]) -> bool {
        let mut state = lock(&self.state);
        let FeedState { bridged, session, received, batch, clock } = &mut *state;
        let Some(parcel) = Parcel::read(parcel) else {
            bridged.refused += 1;
            return true;
        };
        let Some(offset) = clock.offset() else { return false };
        if received.replace(Instant::now()).is_some_and(|before| before.elapsed() >= SILENT) {
            bridged.silences += 1;
        }
        if session.is_some_and(|known| known.session != parcel.session) {
            return false;
        }
        match session {
            Some(known) if parcel.number <= known.number => {
                bridged.repeated += 1;
                return true;
            }
            Some(known) => {
                let dropped = parcel.dropped.saturating_sub(known.dropped);
                bridged.dropped += dropped;
                bridged.missing += parcel.before.saturating_sub(known.next).saturating_sub(dropped);
                let by_kernel = parcel.dropped_by_kernel.since(known.dropped_by_kernel);
                bridged.dropped_by_kernel = bridged.dropped_by_kernel.plus(by_kernel);
            }
            None if !parcel.dropped_by_kernel.are_known() => bridged.dropped_by_kernel = KernelDrops::UNKNOWN,
            None => {}
        }
        *session = Some(FeedSession {
            session: parcel.session,
            number: parcel.number,
            next: parcel.before.saturating_add(u64::from(parcel.count)),
            dropped: parcel.dropped,
            dropped_by_kernel: parcel.dropped_by_kernel,
        });
        bridged.parcels += 1;
        bridged.ended = parcel.last;
        for (arrived_ns, bytes) in parcel.datagrams() {
            batch.push_arrived(offset.here_ns(arrived_ns), bytes);
        }
        // The promise must be set after the datagrams are in the queue: callers that find it empty rely on it.
        self.queue.put(batch, u64::from(parcel.count > 0), Totals::default());
        self.queue.promise(offset.here_ns(parcel.until_ns()));
        true
    }

    /// Starts a session: the first one, or one after the bridge was restarted. The comparison of the clocks starts
    /// again.
    pub fn begin_session(&self) {
        let mut state = lock(&self.state);
        if state.session.take().is_some() {
            state.bridged.restarts += 1;
        }
        state.clock = HostClock::default();
    }

    /// Adds a round trip to the other computer.
    pub fn compare(&self, trip: RoundTrip) {
        lock(&self.state).clock.note(trip);
    }

    /// Counts of what was received and lost so far.
    #[must_use]
    pub fn bridged(&self) -> Bridged {
        let state = lock(&self.state);
        let received = state.received.is_some_and(|received| received.elapsed() < SILENT);
        Bridged { received, clock: state.clock.offset(), ..state.bridged }
    }

    /// Ends the pipeline with an error.
    pub fn fail(&self, error: &str) {
        self.queue.close(Some(io::Error::other(error.to_owned())));
    }

    /// Whether the pipeline has ended, so that no parcel is read any more.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.queue.stopped_ns().is_some()
    }
}
