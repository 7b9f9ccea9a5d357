//! A plain rule in a stream: its labels, and the changes that wait for their time.

use std::collections::VecDeque;

use crate::Spike;
use crate::detect::running_rule::{Decision, RunningRule};
use crate::detect::{Detection, FrameClock};
use crate::spikes::ms;

/// A rule with its labels.
#[derive(Clone)]
pub(super) struct LabelledRule {
    rule: RunningRule,
    labels: [Option<String>; 2],
    /// Changes of its quantities, and whether each may rest on a repaired event.
    waiting: VecDeque<(Spike, bool)>,
    decisions: Vec<Decision>,
}

impl LabelledRule {
    pub fn new(rule: RunningRule, labels: [Option<String>; 2]) -> Self {
        Self { rule, labels, waiting: VecDeque::new(), decisions: vec![] }
    }

    /// Adds changes of the quantities, each with whether it may rest on a repaired event.
    pub fn receive(&mut self, changes: impl Iterator<Item = (Spike, bool)>) {
        self.waiting.extend(changes);
    }

    /// Advances the rule to `until` us, before which every change is known; emits what lies at `begin` us or later.
    pub fn settle(&mut self, until: i64, clock: &FrameClock, begin: i64, out: &mut Vec<Detection>) {
        while let Some((change, repaired)) = self.waiting.pop_front() {
            if change.t >= ms(until) {
                self.waiting.push_front((change, repaired));
                break;
            }
            self.rule.change(change, repaired, clock, &mut self.decisions);
        }
        self.rule.advance(until, clock, &mut self.decisions);
        out.extend(self.decisions.drain(..).filter_map(|Decision { label, t, known, repaired, .. }| {
            let label = self.labels[label].clone().filter(|_| t >= begin)?;
            // A rule has no potential, hence no slope.
            Some(Detection { label, t, known, slope: f64::NAN, repaired })
        }));
    }
}
