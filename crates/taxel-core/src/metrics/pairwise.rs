//! Matrices of many pairs: threads, progress and stopping.

use std::num::NonZero;
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering::Relaxed};
use std::thread;
use std::time::Duration;

use crate::vectors::Instructions;
use crate::{Error, Result, Stop};

/// The interval at which the caller's thread checks for a stop while only other threads work.
const ASK_EVERY: Duration = Duration::from_millis(20);

/// How a matrix is computed.
pub struct Work<'a> {
    /// The number of threads; the caller's thread is one of them and the only one that checks `stop` and calls
    /// `progress`.
    pub threads: usize,
    /// The instructions for matrices of Victor-Purpura distances; the machine must have them.
    pub instructions: Instructions,
    /// The caller's request to stop.
    pub stop: Stop<'a>,
    /// Called from time to time with the number of finished pairs and of all pairs.
    pub progress: &'a mut dyn FnMut(usize, usize),
}

impl<'a> Work<'a> {
    /// Work on `threads` threads, by default one for each core.
    #[must_use]
    pub fn new(threads: Option<NonZero<usize>>, stop: Stop<'a>, progress: &'a mut dyn FnMut(usize, usize)) -> Self {
        let threads = threads.or_else(|| thread::available_parallelism().ok()).map_or(1, NonZero::get);
        Self { threads, instructions: Instructions::best(), stop, progress }
    }

    /// Like [`Self::each`], but without reports of progress.
    pub(super) fn quietly(&mut self, tasks: usize, task: impl Fn(usize, Stop<'_>) -> Result<()> + Sync) -> Result<()> {
        Work { progress: &mut |_, _| (), ..*self }.each(tasks, &|_| (0, 0), task)
    }

    /// Runs `tasks` tasks, each on one thread, in order if there is one thread.
    ///
    /// Each task gets the stop of its thread. `report` converts a number of finished tasks to numbers of finished and of
    /// all pairs.
    pub(super) fn each(
        &mut self,
        tasks: usize,
        report: &dyn Fn(usize) -> (usize, usize),
        task: impl Fn(usize, Stop<'_>) -> Result<()> + Sync,
    ) -> Result<()> {
        let (next, done, halt) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicBool::new(false));
        let run = |stop: Stop<'_>, tell: &mut dyn FnMut(usize)| -> Result<()> {
            loop {
                let k = next.fetch_add(1, Relaxed);
                if k >= tasks {
                    return Ok(());
                }
                let outcome = stop.check().and_then(|()| task(k, stop));
                if outcome.is_err() {
                    halt.store(true, Relaxed);
                    return outcome;
                }
                tell(done.fetch_add(1, Relaxed) + 1);
            }
        };
        let (stop, progress) = (self.stop, &mut self.progress);
        let mut tell = |done| {
            let (now, all) = report(done);
            progress(now, all);
        };
        let asked = || stop.asked() || halt.load(Relaxed);
        let halted = || halt.load(Relaxed);
        let helpers = self.threads.min(tasks).saturating_sub(1);
        let (caller, working) = (thread::current(), AtomicUsize::new(helpers));
        thread::scope(|scope| {
            let help = || {
                let outcome = run(Stop::when(&halted), &mut |_| ());
                working.fetch_sub(1, Relaxed);
                caller.unpark();
                outcome
            };
            let handles: Vec<_> = (0..helpers).map(|_| scope.spawn(help)).collect();
            let mut outcome = run(Stop::when(&asked), &mut tell);
            // The caller's thread keeps checking for Ctrl-C while other threads work.
            while working.load(Relaxed) > 0 && handles.iter().any(|h| !h.is_finished()) {
                if stop.asked() {
                    halt.store(true, Relaxed);
                    outcome = Err(Error::Interrupted);
                }
                thread::park_timeout(ASK_EVERY);
            }
            for handle in handles {
                match handle.join() {
                    Ok(Ok(())) => {}
                    // An error of one thread interrupts the others; that error is returned.
                    Ok(Err(error)) if outcome == Ok(()) || outcome == Err(Error::Interrupted) => outcome = Err(error),
                    Ok(Err(_)) => {}
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
            outcome
        })
    }
}

/// The distances of all pairs while they are computed.
///
/// The cells are atomic so that any thread may write any cell; no two threads write the same cell at once.
pub(super) struct DistanceMatrix {
    rows: usize,
    columns: usize,
    /// Whether rows and columns are the same patterns: then only cells above the diagonal are computed, and mirrored.
    symmetric: bool,
    cells: Vec<AtomicU64>,
}

impl DistanceMatrix {
    /// A matrix of zeros for `rows` patterns against `columns` others, or against each other.
    pub(super) fn new(rows: usize, columns: Option<usize>) -> Self {
        let width = columns.unwrap_or(rows);
        let cells = (0..rows * width).map(|_| AtomicU64::new(0)).collect();
        Self { rows, columns: width, symmetric: columns.is_none(), cells }
    }

    /// The number of pairs, without mirrored ones and the diagonal.
    pub(super) fn pairs(&self) -> usize {
        if self.symmetric { self.rows * self.rows.saturating_sub(1) / 2 } else { self.rows * self.columns }
    }

    /// The first column of row `i` to be computed.
    pub(super) fn first(&self, i: usize) -> usize {
        if self.symmetric { i + 1 } else { 0 }
    }

    /// Adds to the distance of patterns `i` and `j`, in either order if the matrix is symmetric.
    #[inline]
    pub(super) fn add(&self, i: usize, j: usize, value: f64) {
        let (i, j) = if self.symmetric && j < i { (j, i) } else { (i, j) };
        let cell = &self.cells[i * self.columns + j];
        cell.store((f64::from_bits(cell.load(Relaxed)) + value).to_bits(), Relaxed);
    }

    /// Computes every cell by `between`, row after row.
    pub(super) fn each_pair(
        &self,
        work: &mut Work<'_>,
        between: impl Fn(usize, usize, Stop<'_>) -> Result<f64> + Sync,
    ) -> Result<()> {
        let share = |rows: usize| (self.pairs() * rows / self.rows.max(1), self.pairs());
        work.each(self.rows, &share, |i, stop| {
            for j in self.first(i)..self.columns {
                stop.check()?;
                self.add(i, j, between(i, j, stop)?);
            }
            Ok(())
        })
    }

    /// The distances, row after row.
    pub(super) fn finish(self) -> Vec<f64> {
        let mut out: Vec<f64> = self.cells.into_iter().map(|c| f64::from_bits(c.into_inner())).collect();
        if self.symmetric {
            for i in 0..self.rows {
                for j in 0..i {
                    out[i * self.columns + j] = out[j * self.columns + i];
                }
            }
        }
        out
    }
}
