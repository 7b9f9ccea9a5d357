//! Who receives, and who says. As long as nothing is recorded one thread receives, decodes, reads out and says, so that one
//! wake-up lies between a datagram and who is called back. It lays the lead down before it speaks and takes it up again after;
//! where a listener takes longer than [`TAKE_OVER`], the other thread takes it, and goes on receiving: what comes meanwhile
//! waits in the kernel's buffer.
//!
//! A disk may hold up who records, and a readout may be slower than what comes: then one thread receives (or takes what a third
//! one received), decodes and records, and the other reads out, from there on.

use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use super::decode::{Next, Work};
use super::read::Reader;
use super::saying::Saying;
use super::shared::Shared;
use crate::locked::lock;

/// How often the thread that does not lead looks whether the lead lies there: so long a listener may hold up what comes.
const TAKE_OVER: Duration = Duration::from_millis(2);

/// What the threads take turns at.
pub(super) struct Lead {
    turn: Mutex<Turn>,
    changed: Condvar,
    saying: Saying,
}

struct Turn {
    /// None while a thread has it, and with it the lead.
    work: Option<Box<Work>>,
    /// A readout that wants a thread of its own.
    apart: Option<Reader>,
    over: bool,
    /// Threads that have not ended.
    threads: usize,
}

impl Lead {
    pub(super) fn new(work: Work, saying: Saying, threads: usize) -> Self {
        let turn = Turn { work: Some(Box::new(work)), apart: None, over: false, threads };
        Self { turn: Mutex::new(turn), changed: Condvar::new(), saying }
    }

    /// What each thread does, until the end.
    pub(super) fn serve(&self, shared: &Arc<Shared>) {
        let _leaving = Leaving { lead: self, shared };
        loop {
            let nothing = |turn: &mut Turn| turn.work.is_none() && turn.apart.is_none() && !turn.over;
            let waited = self.changed.wait_timeout_while(lock(&self.turn), TAKE_OVER, nothing);
            let (mut turn, waited) = waited.unwrap_or_else(PoisonError::into_inner);
            if waited.timed_out() {
                continue;
            }
            if let Some(reader) = turn.apart.take() {
                drop(turn);
                reader.run(shared, &self.saying);
                return;
            }
            let Some(work) = turn.work.take() else { return };
            drop(turn);
            self.lead(work, shared);
        }
    }

    /// Leads until there is something to say, or all is over.
    fn lead(&self, mut work: Box<Work>, shared: &Shared) {
        loop {
            let next = work.go_on();
            let alone = self.saying.add(shared, work.found());
            match next {
                Next::Say if !alone => continue,
                // Nobody is woken for it: who is called back would wait for that.
                Next::Say => lock(&self.turn).work = Some(work),
                Next::Apart(reader) => {
                    lock(&self.turn).apart = Some(*reader);
                    self.changed.notify_one();
                    continue;
                }
                Next::Over => {
                    lock(&self.turn).over = true;
                    self.changed.notify_all();
                }
            }
            self.saying.speak(shared);
            return;
        }
    }
}

/// However a thread ends, the other one does not wait for it.
struct Leaving<'a> {
    lead: &'a Lead,
    shared: &'a Shared,
}

impl Drop for Leaving<'_> {
    fn drop(&mut self) {
        let mut turn = lock(&self.lead.turn);
        turn.threads -= 1;
        if std::thread::panicking() {
            turn.over = true;
            self.shared.receiver.stop();
            self.shared.handover.close(None);
        }
        if turn.threads == 0 {
            self.shared.end();
        }
        drop(turn);
        self.lead.changed.notify_all();
    }
}
