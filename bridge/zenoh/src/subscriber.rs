//! Subscriber: a computer that receives the data of a board connected to another computer.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crossbeam_channel as channel;
use pyo3::exceptions::{PyConnectionError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use zenoh::pubsub;
use zenoh::qos::Priority;
use zenoh::query::{ConsolidationMode, Reply};
use zenoh::sample::Sample;
use zenoh::{Session, Wait};

use crate::keys::{self, is_name, key, name_of, of_all};
use crate::session::{first_line, open};
use crate::skew::now_ns;

/// Largest number of parcels in the queue: 16 MiB. A full queue blocks the link, and the publisher blocks or drops.
const WAITING: usize = 1 << 6;

/// Timeout of a round trip; a longer one does not constrain the clocks.
const PATIENCE: Duration = Duration::from_secs(1);

struct Listening {
    messages: channel::Receiver<Sample>,
    _subscriber: pubsub::Subscriber<()>,
}

/// Receives the publications of another computer.
#[pyclass(frozen)]
pub(crate) struct Subscriber {
    session: Session,
    listening: Mutex<Option<Listening>>,
}

impl Subscriber {
    /// Queries the clock: all four times of the round trip, ns.
    fn ask_clock(&self, name: &str) -> zenoh::Result<Option<(i64, i64, i64, i64)>> {
        let (sender, receiver) = channel::bounded(1);
        let asked = now_ns();
        self.session
            .get(key(name, keys::CLOCK))
            .consolidation(ConsolidationMode::None)
            .priority(Priority::RealTime)
            .express(true)
            .timeout(PATIENCE)
            .callback(move |reply: Reply| {
                // The time is taken in the callback, before another thread has to wake up.
                let back = now_ns();
                let answer = reply.result().ok().map(|sample| sample.payload().to_bytes().into_owned());
                let _ = sender.try_send((answer, back));
            })
            .wait()?;
        let Ok((Some(answer), back)) = receiver.recv_timeout(PATIENCE) else { return Ok(None) };
        let Some((came, answered)) = answer.split_first_chunk::<8>() else { return Ok(None) };
        let Ok(answered) = answered.try_into().map(i64::from_le_bytes) else { return Ok(None) };
        Ok(Some((asked, i64::from_le_bytes(*came), answered, back)))
    }
}

#[pymethods]
impl Subscriber {
    /// Connects to HOST:PORT; connecting is retried.
    #[new]
    fn new(py: Python<'_>, connect: Vec<String>) -> PyResult<Self> {
        let session = py.detach(|| open(&[], &connect))?;
        Ok(Self { session, listening: Mutex::new(None) })
    }

    /// Names and descriptions of the boards whose publishers answer within `timeout` s.
    fn names(&self, py: Python<'_>, timeout: f64) -> PyResult<Vec<(String, String)>> {
        let timeout = Duration::try_from_secs_f64(timeout).map_err(|e| PyValueError::new_err(e.to_string()))?;
        let found = py.detach(|| {
            let replies = self.session.get(of_all(keys::ABOUT)).timeout(timeout).wait()?;
            let mut found = vec![];
            while let Ok(reply) = replies.recv() {
                if let Ok(sample) = reply.result()
                    && let Some(name) = name_of(sample.key_expr().as_str())
                    && let Ok(about) = sample.payload().try_to_string()
                {
                    found.push((name.to_owned(), about.into_owned()));
                }
            }
            Ok::<_, zenoh::Error>(found)
        });
        found.map_err(|e| PyConnectionError::new_err(first_line(&e)))
    }

    /// Subscribes to `name`: to "block", "drop", "frame" or "detection".
    fn listen(&self, py: Python<'_>, name: &str, what: &str) -> PyResult<()> {
        if !is_name(name) {
            return Err(PyValueError::new_err(format!("name is {name:?}: must be 1 to 64 letters, digits, - _ or .")));
        }
        let what = match what {
            "block" => keys::BLOCK,
            "drop" => keys::DROP,
            "frame" => keys::FRAME,
            "detection" => keys::DETECTION,
            _ => return Err(PyValueError::new_err(format!("{what:?}: must be block, drop, frame or detection"))),
        };
        py.detach(|| {
            let (give, messages) = channel::bounded(WAITING);
            let subscriber = self
                .session
                .declare_subscriber(key(name, what))
                .callback(move |sample| {
                    // Waits while the queue is full; the end of the reader ends the wait.
                    let _ = give.send(sample);
                })
                .wait();
            let subscriber = subscriber.map_err(|e| PyConnectionError::new_err(first_line(&e)))?;
            *self.listening.lock().unwrap_or_else(PoisonError::into_inner) =
                Some(Listening { messages, _subscriber: subscriber });
            Ok(())
        })
    }

    /// The next message; None after `timeout` s without one.
    fn take<'py>(&self, py: Python<'py>, timeout: f64) -> PyResult<Option<Bound<'py, PyBytes>>> {
        let timeout = Duration::try_from_secs_f64(timeout).map_err(|e| PyValueError::new_err(e.to_string()))?;
        let message = py.detach(|| {
            let listening = self.listening.lock().unwrap_or_else(PoisonError::into_inner);
            let Some(listening) = &*listening else {
                return Err(PyValueError::new_err("subscriber: listens to nothing yet"));
            };
            Ok(listening.messages.recv_timeout(timeout).ok())
        })?;
        Ok(message.map(|sample| PyBytes::new(py, &sample.payload().to_bytes())))
    }

    /// A round trip to the clock of `name`: times asked, came, answered, back, ns since 1970; None without an answer.
    fn compare(&self, py: Python<'_>, name: &str) -> PyResult<Option<(i64, i64, i64, i64)>> {
        py.detach(|| self.ask_clock(name)).map_err(|e| PyConnectionError::new_err(first_line(&e)))
    }

    /// Closes the session.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        py.detach(|| {
            // The queue is closed first, so that no callback waits for it while it is full; a reader ends by its
            // timeout.
            *self.listening.lock().unwrap_or_else(PoisonError::into_inner) = None;
            self.session.close().wait().map_err(|e| PyConnectionError::new_err(first_line(&e)))
        })
    }
}
