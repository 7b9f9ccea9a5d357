//! Tracks where times step back: in the order of arrival an event is before an earlier one.

use serde::{Deserialize, Serialize};

use crate::events::FARTHEST_BACK_US;

/// Most steps that are listed: the largest ones.
pub const MOST_STEPS: usize = 256;

/// Events in succession that are all before the latest time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepBack {
    /// The latest time before them, us.
    pub after_us: i64,
    /// How far the earliest of them is before that, us.
    pub by_us: i64,
    /// Number of events.
    pub events: u64,
}

/// The steps back of a sender's times.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Order {
    latest: Option<i64>,
    /// Whether the last event was before the latest time.
    is_behind: bool,
    /// Number of all steps.
    count: u64,
    /// The largest steps, in their order.
    steps: Vec<StepBack>,
    /// Number of events of version 2 before the latest time: by at most [`FARTHEST_BACK_US`], as the network may reorder
    /// datagrams, and by more.
    overtaken: u64,
    far: u64,
}

impl Order {
    /// Notes the times of the next events, and whether they are of version 2: the decoder of version 1 counts its own.
    pub(super) fn note(&mut self, times: &[i64], of_version_2: bool) {
        for &t in times {
            match self.latest {
                Some(latest) if t < latest => self.behind(latest, t, of_version_2),
                _ => (self.latest, self.is_behind) = (Some(t), false),
            }
        }
    }

    #[cold]
    fn behind(&mut self, latest: i64, t: i64, of_version_2: bool) {
        let by_us = latest.saturating_sub(t);
        if of_version_2 {
            *(if by_us > FARTHEST_BACK_US { &mut self.far } else { &mut self.overtaken }) += 1;
        }
        if !self.is_behind {
            self.is_behind = true;
            if self.steps.len() == MOST_STEPS {
                let least = (0..MOST_STEPS).rev().min_by_key(|&k| self.steps[k].by_us).unwrap_or(0);
                self.steps.remove(least);
            }
            self.steps.push(StepBack { after_us: latest, by_us: 0, events: 0 });
            self.count += 1;
        }
        if let Some(step) = self.steps.last_mut() {
            (step.by_us, step.events) = (step.by_us.max(by_us), step.events + 1);
        }
    }

    /// Number of all steps so far.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.count
    }

    /// The largest steps, in their order.
    #[must_use]
    pub fn steps(&self) -> &[StepBack] {
        &self.steps
    }

    /// Number of events of version 2 before the latest time, by at most [`FARTHEST_BACK_US`].
    #[must_use]
    pub fn overtaken(&self) -> u64 {
        self.overtaken
    }

    /// Number of events of version 2 that are farther before it.
    #[must_use]
    pub fn far(&self) -> u64 {
        self.far
    }
}
