//! How a matrix is computed: threads, progress and stopping.

use std::num::NonZero;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::thread;
use std::time::Duration;

use rayon::ThreadPoolBuilder;

use crate::{Error, Result, Stop, problem};

/// The interval at which the caller's thread checks for a stop and reports progress.
const ASK_EVERY: Duration = Duration::from_millis(20);

/// How a matrix is computed.
pub struct Work<'a> {
    /// The number of threads; one for each core if it is not given.
    pub threads: Option<NonZero<usize>>,
    /// The caller's request to stop; only the caller's thread asks it.
    pub stop: Stop<'a>,
    /// Called from time to time, and at the end, with the number of finished pairs and of all pairs; only the caller's
    /// thread calls it.
    pub progress: &'a mut dyn FnMut(usize, usize),
}

/// What a computation on several threads tells the caller's thread and hears from it.
pub(super) struct Running<'a> {
    /// The number of finished pairs.
    pub(super) done: AtomicUsize,
    /// Whether the caller asked to stop.
    pub(super) stop: Stop<'a>,
}

impl Work<'_> {
    /// Runs `compute` on the threads, while this one checks for a stop and reports how many of the `pairs` are done.
    pub(super) fn run<T: Send>(
        &mut self,
        pairs: usize,
        compute: impl FnOnce(&Running<'_>) -> Result<T> + Send,
    ) -> Result<T> {
        let threads = self.threads.or_else(|| thread::available_parallelism().ok()).map_or(1, NonZero::get);
        let pool = ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|error| problem!("threads"; " is {threads}: {error}"))?;
        let halt = AtomicBool::new(false);
        let halted = || halt.load(Relaxed);
        let running = Running { done: AtomicUsize::new(0), stop: Stop::when(&halted) };
        let (outcome, finished) = mpsc::channel();
        pool.in_place_scope(|scope| {
            scope.spawn(|_| {
                // The receiver waits for this.
                let _ = outcome.send(compute(&running));
            });
            loop {
                let outcome = finished.recv_timeout(ASK_EVERY);
                (self.progress)(running.done.load(Relaxed), pairs);
                match outcome {
                    Ok(outcome) => return outcome,
                    // A panic, which the scope passes on.
                    Err(RecvTimeoutError::Disconnected) => return Err(Error::Interrupted),
                    Err(RecvTimeoutError::Timeout) => {}
                }
                if self.stop.asked() {
                    halt.store(true, Relaxed);
                }
            }
        })
    }
}
