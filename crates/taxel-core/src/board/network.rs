//! Simulated network: drops, duplicates, reorders, truncates and corrupts datagrams, drawn from a seed.

use std::collections::VecDeque;

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

use crate::{Result, problem};

/// Largest number of datagrams that can overtake a reordered one.
const BEHIND: usize = 8;

/// Probability of each fault for a datagram, 0 to 1; at most one fault hits a datagram.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NetworkFaults {
    /// Never delivered.
    pub lost: f64,
    /// Delivered twice.
    pub repeated: f64,
    /// Overtaken by 1 to 8 others.
    pub reordered: f64,
    /// Delivered truncated, at any byte.
    pub cut: f64,
    /// Delivered with one to eight flipped bits.
    pub corrupted: f64,
    /// Seed of the random draws.
    pub seed: u64,
}

impl NetworkFaults {
    fn shares(&self) -> [(&'static str, f64); 5] {
        [
            ("lost", self.lost),
            ("repeated", self.repeated),
            ("reordered", self.reordered),
            ("cut", self.cut),
            ("corrupted", self.corrupted),
        ]
    }
}

/// The number of datagrams that each fault has hit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct NetworkCounts {
    /// Datagrams passed to the network.
    pub given: u64,
    /// Datagrams delivered, whole or not; duplicated ones count twice.
    pub delivered: u64,
    /// Datagrams dropped.
    pub lost: u64,
    /// Datagrams duplicated.
    pub repeated: u64,
    /// Datagrams reordered.
    pub reordered: u64,
    /// Datagrams truncated.
    pub cut: u64,
    /// Datagrams corrupted.
    pub corrupted: u64,
}

/// Forwards a board's datagrams to a host, with faults.
#[derive(Debug, Clone)]
pub struct Network {
    faults: NetworkFaults,
    draw: StdRng,
    /// Reordered datagrams that wait, each with the number of datagrams that still have to overtake it.
    behind: VecDeque<(usize, Vec<u8>)>,
    counts: NetworkCounts,
}

impl Network {
    /// A network with these faults.
    ///
    /// # Errors
    ///
    /// `Problem` if a probability, or the sum of all, is not between 0 and 1.
    pub fn new(faults: NetworkFaults) -> Result<Self> {
        let shares = faults.shares();
        for (name, share) in shares {
            if !(0.0..=1.0).contains(&share) {
                return Err(problem!(name; " is {share}: must be from 0 to 1"));
            }
        }
        let all: f64 = shares.iter().map(|(_, share)| share).sum();
        if all > 1.0 {
            return Err(problem!("lost, repeated, reordered, cut and corrupted are {all} together: must be at most 1"));
        }
        let draw = StdRng::seed_from_u64(faults.seed);
        Ok(Self { faults, draw, behind: VecDeque::new(), counts: NetworkCounts::default() })
    }

    /// The number of datagrams that each fault has hit.
    #[must_use]
    pub fn counts(&self) -> &NetworkCounts {
        &self.counts
    }

    /// Sends a datagram through the network; passes each delivered datagram to the sink.
    pub fn pass(&mut self, datagram: &[u8], sink: &mut impl FnMut(&[u8])) {
        self.counts.given += 1;
        let at: f64 = self.draw.random();
        let (mut upto, mut fault) = (0.0, "");
        for (name, share) in self.faults.shares() {
            upto += share;
            if at < upto {
                fault = name;
                break;
            }
        }
        match fault {
            "lost" => self.counts.lost += 1,
            "repeated" => {
                self.counts.repeated += 1;
                self.deliver(datagram, sink);
                self.deliver(datagram, sink);
            }
            "reordered" => {
                self.counts.reordered += 1;
                let others = self.draw.random_range(1..=BEHIND);
                self.behind.push_back((others, datagram.to_vec()));
                return;
            }
            "cut" => {
                self.counts.cut += 1;
                let end = self.draw.random_range(0..datagram.len().max(1));
                self.deliver(&datagram[..end.min(datagram.len())], sink);
            }
            "corrupted" if !datagram.is_empty() => {
                self.counts.corrupted += 1;
                let mut hurt = datagram.to_vec();
                // The bits are distinct, so that none is flipped back.
                for bit in rand::seq::index::sample(&mut self.draw, 8 * hurt.len(), 8) {
                    hurt[bit / 8] ^= 1 << (bit % 8);
                    if self.draw.random() {
                        break;
                    }
                }
                self.deliver(&hurt, sink);
            }
            _ => self.deliver(datagram, sink),
        }
        for (others, _) in &mut self.behind {
            *others = others.saturating_sub(1);
        }
        while let Some(index) = self.behind.iter().position(|(others, _)| *others == 0) {
            if let Some((_, late)) = self.behind.remove(index) {
                self.deliver(&late, sink);
            }
        }
    }

    /// Delivers the datagrams that still wait.
    pub fn flush(&mut self, sink: &mut impl FnMut(&[u8])) {
        while let Some((_, late)) = self.behind.pop_front() {
            self.deliver(&late, sink);
        }
    }

    fn deliver(&mut self, datagram: &[u8], sink: &mut impl FnMut(&[u8])) {
        self.counts.delivered += 1;
        sink(datagram);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_close_and_what_is_not_befallen_comes_out_as_it_was() {
        let faults = NetworkFaults { lost: 0.1, repeated: 0.1, reordered: 0.2, cut: 0.1, corrupted: 0.1, seed: 3 };
        let mut network = Network::new(faults).unwrap();
        let mut out = vec![];
        for k in 0..10_000_u32 {
            let datagram: Vec<u8> = k.to_le_bytes().repeat(10);
            network.pass(&datagram, &mut |d| out.push(d.to_vec()));
        }
        network.flush(&mut |d| out.push(d.to_vec()));
        let c = *network.counts();
        assert_eq!(c.delivered, out.len() as u64);
        assert_eq!(c.delivered, c.given - c.lost + c.repeated);
        let whole = out.iter().filter(|d| d.len() == 40 && d.chunks(4).all(|word| word == &d[..4])).count() as u64;
        assert_eq!(whole, c.delivered - c.cut - c.corrupted);
        for (n, share) in [(c.lost, 0.1), (c.repeated, 0.1), (c.reordered, 0.2), (c.cut, 0.1), (c.corrupted, 0.1)] {
            assert!((n as f64 / 1e4 - share).abs() < 0.02, "{c:?}");
        }
    }

    #[test]
    fn shares_that_are_none_are_refused() {
        for faults in [
            NetworkFaults { lost: -0.1, ..NetworkFaults::default() },
            NetworkFaults { cut: f64::NAN, ..NetworkFaults::default() },
            NetworkFaults { lost: 0.6, corrupted: 0.6, ..NetworkFaults::default() },
        ] {
            assert!(Network::new(faults).is_err());
        }
    }
}
