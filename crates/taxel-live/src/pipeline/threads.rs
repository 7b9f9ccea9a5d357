//! The pipeline's threads, in the pattern *leader/followers* (Schmidt et al., Pattern-Oriented Software Architecture 2, 2000): one
//! thread at a time owns the stages. While nothing is recorded it receives, decodes, reads out and outputs detections, so that
//! there is one wake-up between a datagram and a callback. It releases the stages before it calls a callback, and acquires them
//! again afterwards; where a callback takes longer than [`TAKE_OVER`], the other thread acquires them and continues to receive:
//! what arrives in the meantime waits in the kernel's buffer.
//!
//! A disk may delay a recording, and a readout may be slower than the events arrive. In these cases one thread receives
//! (or reads what a third one received), decodes and records, and the other reads out from then on.

use std::sync::atomic::Ordering;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::output::DetectionOutput;
use super::running_readout::RunningReadout;
use super::shared::PipelineShared;
use super::stages::{Stages, StagesOutcome};
use crate::locked::lock;

/// Interval at which the follower looks for work, of which it is not told, as a callback would have to wait for its wake-up: a
/// callback may delay receiving by this time.
const TAKE_OVER: Duration = Duration::from_millis(2);

/// The stages and the output, which one thread at a time owns.
pub(super) struct Threads {
    turn: Mutex<Turn>,
    output: DetectionOutput,
    shared: Arc<PipelineShared>,
}

/// What a thread that is free does next.
enum Turn {
    /// It waits: the other thread, the leader, owns the stages.
    Wait,
    Run(Box<Stages>),
    ReadOut(Box<RunningReadout>),
    End,
}

impl Threads {
    pub(super) fn new(stages: Stages, output: DetectionOutput, shared: Arc<PipelineShared>) -> Self {
        Self { turn: Mutex::new(Turn::Run(Box::new(stages))), output, shared }
    }

    /// The loop of each thread, until the end.
    pub(super) fn run(&self) {
        let _leaving = ThreadEndGuard(self);
        loop {
            match self.next(Turn::Wait) {
                Turn::Wait => std::thread::sleep(TAKE_OVER),
                Turn::Run(stages) => self.run_stages(stages),
                Turn::ReadOut(readout) => return readout.run(&self.shared, &self.output),
                Turn::End => return,
            }
        }
    }

    /// Takes what is to be done next, and leaves `then` for a thread that is free.
    fn next(&self, then: Turn) -> Turn {
        std::mem::replace(&mut *lock(&self.turn), then)
    }

    /// Runs the stages until there are detections to output, or the pipeline has ended.
    fn run_stages(&self, mut stages: Box<Stages>) {
        loop {
            let next = stages.run();
            let alone = self.output.add(&self.shared, stages.pending_detections());
            match next {
                StagesOutcome::Output if !alone => continue,
                StagesOutcome::Output => drop(self.next(Turn::Run(stages))),
                StagesOutcome::MoveReadout(readout) => {
                    self.next(Turn::ReadOut(readout));
                    continue;
                }
                StagesOutcome::Finished => {
                    if let Turn::ReadOut(readout) = self.next(Turn::End) {
                        readout.run(&self.shared, &self.output);
                    }
                }
            }
            self.output.run(&self.shared);
            return;
        }
    }
}

impl Drop for Threads {
    /// Both threads have ended.
    fn drop(&mut self) {
        self.shared.ended.store(true, Ordering::Release);
    }
}

/// Ends the other thread too when this one ends, in whichever way.
struct ThreadEndGuard<'a>(&'a Threads);

impl Drop for ThreadEndGuard<'_> {
    fn drop(&mut self) {
        self.0.next(Turn::End);
        if std::thread::panicking() {
            self.0.shared.receiver.stop();
            self.0.shared.readout_queue.close();
        }
    }
}
