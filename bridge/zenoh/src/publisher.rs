//! Publisher: the computer that the board sends to.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, RwLock};
use std::thread::JoinHandle;

use crossbeam_channel as channel;
use pyo3::exceptions::{PyConnectionError, PyValueError};
use pyo3::prelude::*;
use zenoh::bytes::ZBytes;
use zenoh::qos::{CongestionControl, Priority};
use zenoh::query::Query;
use zenoh::{Session, Wait};

use crate::keys::{self, is_name, key};
use crate::session::{first_line, open};
use crate::skew::Skew;

/// Largest number of parcels in the queue of a lane: 64 MiB.
const WAITING: usize = 1 << 8;

/// The queue and thread for one kind of subscriber (recorders or viewers).
struct Lane {
    parcels: Option<channel::Sender<ZBytes>>,
    sent: Arc<AtomicU64>,
    dropped: u64,
    listened: zenoh::pubsub::Publisher<'static>,
    thread: Option<JoinHandle<()>>,
}

impl Lane {
    fn begin(session: &Session, key: String, congestion: CongestionControl, priority: Priority) -> zenoh::Result<Self> {
        let declare = |key: String| {
            session.declare_publisher(key).congestion_control(congestion).priority(priority).express(true).wait()
        };
        let (publisher, listened) = (declare(key.clone())?, declare(key)?);
        let (parcels, waiting) = channel::bounded::<ZBytes>(WAITING);
        let sent = Arc::new(AtomicU64::new(0));
        let counted = Arc::clone(&sent);
        // A lane that waits for a slow subscriber blocks neither the other lane nor the caller.
        let thread = std::thread::Builder::new().name("taxel-lane".to_owned()).spawn(move || {
            for parcel in waiting {
                // The numbers of later parcels reveal lost ones.
                if publisher.put(parcel).wait().is_ok() {
                    counted.fetch_add(1, Ordering::Relaxed);
                }
            }
        })?;
        Ok(Self { parcels: Some(parcels), sent, dropped: 0, listened, thread: Some(thread) })
    }

    /// Whether there is a subscriber.
    fn has_subscriber(&self) -> bool {
        self.listened.matching_status().wait().is_ok_and(|status| status.matching())
    }

    fn put(&mut self, parcel: &ZBytes) {
        if self.has_subscriber()
            && let Some(parcels) = &self.parcels
            && parcels.try_send(parcel.clone()).is_err()
        {
            self.dropped += 1;
        }
    }

    fn end(&mut self) {
        self.parcels = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Open {
    session: Session,
    block: Lane,
    drop: Lane,
    frames: zenoh::pubsub::Publisher<'static>,
    detections: zenoh::pubsub::Publisher<'static>,
}

/// Publishes what a board sends to this computer.
#[pyclass(frozen)]
pub(crate) struct Publisher {
    open: Mutex<Option<Open>>,
    about: Arc<RwLock<String>>,
    skew: Skew,
}

impl Publisher {
    fn with<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut Open) -> zenoh::Result<T> + Send) -> PyResult<T> {
        py.detach(|| match &mut *self.open.lock().unwrap_or_else(PoisonError::into_inner) {
            Some(open) => work(open).map_err(|e| PyConnectionError::new_err(first_line(&e))),
            None => Err(PyValueError::new_err("publisher: has been closed")),
        })
    }
}

#[pymethods]
impl Publisher {
    /// Starts to publish as `name`: listens on and connects to HOST:PORT. `about` describes the sensor, for queries.
    /// For tests the published clock is ahead by `ahead_ns`, and runs faster by `drift_ppm`.
    #[new]
    #[pyo3(signature = (name, listen, connect, about, ahead_ns = 0, drift_ppm = 0.0))]
    fn new(
        py: Python<'_>,
        name: &str,
        listen: Vec<String>,
        connect: Vec<String>,
        about: String,
        ahead_ns: i64,
        drift_ppm: f64,
    ) -> PyResult<Self> {
        if !is_name(name) {
            return Err(PyValueError::new_err(format!("name is {name:?}: must be 1 to 64 letters, digits, - _ or .")));
        }
        let (about, skew) = (Arc::new(RwLock::new(about)), Skew::new(ahead_ns, drift_ppm));
        let described = Arc::clone(&about);
        let open = py.detach(|| {
            let session = open(&listen, &connect)?;
            begin(session, name, described, skew).map_err(|e| PyConnectionError::new_err(first_line(&e)))
        })?;
        Ok(Self { open: Mutex::new(Some(open)), about, skew })
    }

    /// Sends a parcel to the subscribers; never waits.
    fn parcel(&self, py: Python<'_>, parcel: Vec<u8>) -> PyResult<()> {
        self.with(py, |open| {
            let mut parcel = parcel;
            self.skew.stamp(&mut parcel);
            let parcel = ZBytes::from(parcel);
            open.block.put(&parcel);
            open.drop.put(&parcel);
            Ok(())
        })
    }

    /// Sends a frame.
    fn frame(&self, py: Python<'_>, frame: Vec<u8>) -> PyResult<()> {
        self.with(py, |open| open.frames.put(frame).wait())
    }

    /// Sends a detection.
    fn detection(&self, py: Python<'_>, line: Vec<u8>) -> PyResult<()> {
        self.with(py, |open| open.detections.put(line).wait())
    }

    /// Replaces the description of the sensor.
    fn tell(&self, about: String) {
        *self.about.write().unwrap_or_else(PoisonError::into_inner) = about;
    }

    /// For recorders and viewers: parcels sent, parcels dropped because the queue was full, whether there is a subscriber.
    #[allow(clippy::type_complexity)]
    fn counts(&self, py: Python<'_>) -> PyResult<((u64, u64, bool), (u64, u64, bool))> {
        self.with(py, |open| {
            let of = |lane: &Lane| (lane.sent.load(Ordering::Relaxed), lane.dropped, lane.has_subscriber());
            Ok((of(&open.block), of(&open.drop)))
        })
    }

    /// Sends the parcels in the queues, and closes the session.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        py.detach(|| {
            let Some(mut open) = self.open.lock().unwrap_or_else(PoisonError::into_inner).take() else { return Ok(()) };
            open.block.end();
            open.drop.end();
            open.session.close().wait().map_err(|e| PyConnectionError::new_err(first_line(&e)))
        })
    }
}

fn begin(session: Session, name: &str, about: Arc<RwLock<String>>, skew: Skew) -> zenoh::Result<Open> {
    let clock = move |query: Query| {
        let came = skew.now_ns();
        let mut answer = came.to_le_bytes().to_vec();
        answer.extend_from_slice(&skew.now_ns().to_le_bytes());
        // The client that queried may have disconnected.
        let _ = query.reply(query.key_expr().clone(), answer).express(true).wait();
    };
    session.declare_queryable(key(name, keys::CLOCK)).callback(clock).background().wait()?;
    let about_key = key(name, keys::ABOUT);
    let tell = move |query: Query| {
        let about = about.read().unwrap_or_else(PoisonError::into_inner).clone();
        let _ = query.reply(about_key.clone(), about).wait();
    };
    session.declare_queryable(key(name, keys::ABOUT)).callback(tell).background().wait()?;
    let block = Lane::begin(&session, key(name, keys::BLOCK), CongestionControl::Block, Priority::Data)?;
    let drop = Lane::begin(&session, key(name, keys::DROP), CongestionControl::Drop, Priority::DataHigh)?;
    let declare = |what: &str, priority| {
        session
            .declare_publisher(key(name, what))
            .congestion_control(CongestionControl::Drop)
            .priority(priority)
            .express(true)
            .wait()
    };
    let frames = declare(keys::FRAME, Priority::DataLow)?;
    let detections = declare(keys::DETECTION, Priority::InteractiveHigh)?;
    Ok(Open { session, block, drop, frames, detections })
}
