//! What has left the scan and not the board: whole datagrams, in order, within a bound.

use std::collections::VecDeque;

use super::counts::BoardCounts;

/// Datagrams that the sink has not taken yet, and how many words of the queue they fill.
#[derive(Debug, Clone, Default)]
pub(super) struct Outbox {
    waiting: VecDeque<(Vec<u8>, usize)>,
    words: usize,
}

impl Outbox {
    /// Words that wait.
    pub(super) fn words(&self) -> usize {
        self.words
    }

    /// Offers the sink what waits, oldest first.
    pub(super) fn offer(&mut self, sink: &mut impl FnMut(&[u8]) -> bool, counts: &mut BoardCounts) {
        while let Some((oldest, words)) = self.waiting.front() {
            if !sink(oldest) {
                break;
            }
            took(counts, *words);
            self.words -= words;
            self.waiting.pop_front();
        }
    }

    /// Sends a datagram after what waits, or lets it wait too.
    pub(super) fn send(
        &mut self,
        datagram: &[u8],
        words: usize,
        sink: &mut impl FnMut(&[u8]) -> bool,
        counts: &mut BoardCounts,
    ) {
        self.offer(sink, counts);
        if self.waiting.is_empty() && sink(datagram) {
            took(counts, words);
        } else {
            self.words += words;
            self.waiting.push_back((datagram.to_vec(), words));
        }
    }
}

fn took(counts: &mut BoardCounts, words: usize) {
    counts.datagrams += 1;
    counts.sent += words as u64;
}
