//! The pipeline's threads, in the pattern *leader/followers* (Schmidt et al., Pattern-Oriented Software Architecture 2, 2000): one
//! thread at a time owns the stages. While nothing is recorded it receives, decodes, reads out and outputs detections, so that
//! there is one wake-up between a datagram and a callback. It releases the stages before it calls a callback, and acquires them
//! again afterwards; where a callback takes longer than [`TAKE_OVER`], the other thread acquires them and continues to receive:
//! what arrives in the meantime waits in the kernel's buffer.
//!
//! A disk may delay a recording, and a readout may be slower than the events arrive. In these cases one thread receives
//! (or reads what a third one received), decodes and records, and the other reads out from then on.

use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use super::output::DetectionOutput;
use super::running_readout::RunningReadout;
use super::shared::PipelineShared;
use super::stages::{Stages, StagesOutcome};
use crate::locked::lock;

/// Interval at which the follower checks whether the stages were released: a callback may delay receiving by this time.
const TAKE_OVER: Duration = Duration::from_millis(2);

/// The stages and the output, which one thread at a time owns.
pub(super) struct Threads {
    turn: Mutex<StagesTurn>,
    changed: Condvar,
    output: DetectionOutput,
}

struct StagesTurn {
    /// `None` while a thread, the leader, owns the stages.
    stages: Option<Box<Stages>>,
    /// A readout that must move to its own thread.
    readout: Option<RunningReadout>,
    over: bool,
    /// Number of threads that have not ended.
    left: usize,
}

impl Threads {
    pub(super) fn new(stages: Stages, output: DetectionOutput, threads: usize) -> Self {
        let turn = StagesTurn { stages: Some(Box::new(stages)), readout: None, over: false, left: threads };
        Self { turn: Mutex::new(turn), changed: Condvar::new(), output }
    }

    /// The loop of each thread, until the end.
    pub(super) fn run(&self, shared: &Arc<PipelineShared>) {
        let _leaving = ThreadEndGuard { threads: self, shared };
        loop {
            let nothing = |turn: &mut StagesTurn| turn.stages.is_none() && turn.readout.is_none() && !turn.over;
            let waited = self.changed.wait_timeout_while(lock(&self.turn), TAKE_OVER, nothing);
            let (mut turn, waited) = waited.unwrap_or_else(PoisonError::into_inner);
            if waited.timed_out() {
                continue;
            }
            if let Some(readout) = turn.readout.take() {
                drop(turn);
                readout.run(shared, &self.output);
                return;
            }
            let Some(stages) = turn.stages.take() else { return };
            drop(turn);
            self.run_stages(stages, shared);
        }
    }

    /// Runs the stages until there are detections to output, or the pipeline has ended.
    fn run_stages(&self, mut stages: Box<Stages>, shared: &PipelineShared) {
        loop {
            let next = stages.run();
            let alone = self.output.add(shared, stages.pending_detections());
            match next {
                StagesOutcome::Output if !alone => continue,
                // The follower is not woken for this, because the callback would have to wait for the wake-up.
                StagesOutcome::Output => lock(&self.turn).stages = Some(stages),
                StagesOutcome::MoveReadout(readout) => {
                    lock(&self.turn).readout = Some(*readout);
                    self.changed.notify_one();
                    continue;
                }
                StagesOutcome::Finished => {
                    lock(&self.turn).over = true;
                    self.changed.notify_all();
                }
            }
            self.output.run(shared);
            return;
        }
    }
}

/// Ends the other thread's wait when this one ends, in whichever way.
struct ThreadEndGuard<'a> {
    threads: &'a Threads,
    shared: &'a PipelineShared,
}

impl Drop for ThreadEndGuard<'_> {
    fn drop(&mut self) {
        let mut turn = lock(&self.threads.turn);
        turn.left -= 1;
        if std::thread::panicking() {
            turn.over = true;
            self.shared.receiver.stop();
            self.shared.readout_queue.close(None);
        }
        if turn.left == 0 {
            self.shared.end();
        }
        drop(turn);
        self.threads.changed.notify_all();
    }
}
