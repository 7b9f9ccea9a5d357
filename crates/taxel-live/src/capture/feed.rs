//! What another computer received, instead of a socket: parcels in, by this computer's clock, and every loss counted.

use std::io;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::parcel::Parcel;
use super::queue::{Batch, Queue};
use crate::host_clock::{HostClock, HostOffset, RoundTrip};
use crate::locked::lock;

/// A bridge sends something each 10 ms: one that was not heard for so long is gone, or the way to it.
const SILENT: Duration = Duration::from_secs(1);

/// What came over a bridge, and what was lost on the way.
///
/// Between the first and the last parcel of a session, datagrams that the other computer received = those that came +
/// [`Bridged::missing`] + [`Bridged::dropped`].
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Bridged {
    /// Parcels that came, the empty ones that say "still here" among them.
    pub parcels: u64,
    /// Datagrams that were sent over the bridge and never came.
    pub missing: u64,
    /// Datagrams that the other computer dropped, its queues being full.
    pub dropped: u64,
    /// Messages that the other computer's kernel dropped.
    pub dropped_by_kernel: u64,
    /// Parcels that came again; they were left out.
    pub repeated: u64,
    /// Parcels that could not be read.
    pub refused: u64,
    /// How often the bridge was begun anew while it was listened to.
    pub restarts: u64,
    /// How often nothing was heard for a second or more.
    pub silences: u64,
    /// Whether something was heard within the last second.
    pub heard: bool,
    /// Whether the bridge said that it ends.
    pub ended: bool,
    /// The other computer's clock against this one's.
    pub clock: Option<HostOffset>,
}

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
struct State {
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
    state: Arc<Mutex<State>>,
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
        let State { bridged, session, heard, batch, clock } = &mut *state;
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
        // What is promised holds for those who find the queue empty afterwards.
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

    /// Whether nobody takes any more.
    #[must_use]
    pub fn is_over(&self) -> bool {
        self.queue.stop_asked()
    }
}
