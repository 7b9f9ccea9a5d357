//! What another computer received, instead of a socket: parcels in, by this computer's clock, and every loss counted.

use std::io;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use super::parcel::Parcel;
use super::queue::{Batch, Queue};
use crate::bridged::Bridged;
use crate::host_clock::{HostClock, RoundTrip};
use crate::locked::lock;

/// A bridge sends something each 10 ms: after so long without anything it is gone, or the network between.
const SILENT: Duration = Duration::from_secs(1);

#[derive(Debug, Clone, Copy)]
struct Session {
    session: u64,
    number: u64,
    /// The number of the datagram that comes next if none is missing.
    next: u64,
    dropped: u64,
    dropped_by_kernel: u64,
}

#[derive(Debug, Default)]
struct FeedState {
    bridged: Bridged,
    clock: HostClock,
    session: Option<Session>,
    heard: Option<Instant>,
    batch: Batch,
}

/// Where parcels of another computer go in; clones go to the same place.
#[derive(Debug, Clone)]
pub struct Feed {
    queue: Arc<Queue>,
    state: Arc<Mutex<FeedState>>,
}

impl Feed {
    pub(super) fn new(queue: Arc<Queue>) -> Self {
        Self { queue, state: Arc::default() }
    }

    /// Takes a parcel. False where it begins a session and [`Feed::meet`] was not called: nothing was taken then.
    ///
    /// What cannot be read, or came before, is counted and left out.
    pub fn take(&self, parcel: &[u8]) -> bool {
        let mut state = lock(&self.state);
        let FeedState { bridged, session, heard, batch, clock } = &mut *state;
        let Some(parcel) = Parcel::read(parcel) else {
            bridged.refused += 1;
            return true;
        };
        let Some(offset) = clock.offset() else { return false };
        if heard.replace(Instant::now()).is_some_and(|before| before.elapsed() >= SILENT) {
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
                bridged.dropped_by_kernel += parcel.dropped_by_kernel.saturating_sub(known.dropped_by_kernel);
            }
            None => {}
        }
        *session = Some(Session {
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
        // The promise holds for a caller who finds the queue empty afterwards.
        self.queue.put(batch, u64::from(parcel.count > 0), 0);
        self.queue.promise(offset.here_ns(parcel.until_ns()));
        true
    }

    /// Another session begins: a first one, or one after the bridge was begun anew. The clocks are compared anew.
    pub fn meet(&self) {
        let mut state = lock(&self.state);
        if state.session.take().is_some() {
            state.bridged.restarts += 1;
        }
        state.clock = HostClock::default();
    }

    /// Takes a round trip to the other computer.
    pub fn compare(&self, trip: RoundTrip) {
        lock(&self.state).clock.note(trip);
    }

    /// What came and what was lost up to now.
    #[must_use]
    pub fn bridged(&self) -> Bridged {
        let state = lock(&self.state);
        let heard = state.heard.is_some_and(|heard| heard.elapsed() < SILENT);
        Bridged { heard, clock: state.clock.offset(), ..state.bridged }
    }

    /// Ends it all because of an error.
    pub fn fail(&self, said: &str) {
        self.queue.close(Some(io::Error::other(said.to_owned())));
    }

    /// Whether the pipeline has ended, and takes no more.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.queue.stopped_ns().is_some()
    }
}
