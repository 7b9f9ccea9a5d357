//! Tracks where times step back: in the order of arrival an event is before an earlier one.

use serde::{Deserialize, Serialize};

use super::SenderTotals;
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
pub(super) struct Order {
    latest: Option<i64>,
    /// Whether the last event was before the latest time.
    is_behind: bool,
    /// The largest steps, in their order.
    steps: Vec<StepBack>,
}

impl Order {
    /// Notes the times of the next events, and whether they are of version 2: the decoder of version 1 counts its own.
    pub(super) fn note(&mut self, times: &[i64], of_version_2: bool, totals: &mut SenderTotals) {
        for &t in times {
            match self.latest {
                Some(latest) if t < latest => self.step_back(latest, t, of_version_2, totals),
                _ => (self.latest, self.is_behind) = (Some(t), false),
            }
        }
    }

    #[cold]
    fn step_back(&mut self, latest: i64, t: i64, of_version_2: bool, totals: &mut SenderTotals) {
        let by_us = latest.saturating_sub(t);
        if of_version_2 {
            *(if by_us > FARTHEST_BACK_US { &mut totals.far_behind } else { &mut totals.overtaken }) += 1;
        }
        if !self.is_behind {
            self.is_behind = true;
            if self.steps.len() == MOST_STEPS {
                let least = (0..MOST_STEPS).rev().min_by_key(|&k| self.steps[k].by_us).unwrap_or(0);
                self.steps.remove(least);
            }
            self.steps.push(StepBack { after_us: latest, by_us: 0, events: 0 });
            totals.steps_back += 1;
        }
        if let Some(step) = self.steps.last_mut() {
            (step.by_us, step.events) = (step.by_us.max(by_us), step.events + 1);
        }
    }

    /// The largest steps, in their order.
    pub(super) fn steps(&self) -> &[StepBack] {
        &self.steps
    }
}
