//! Simulated network: drops, repeats, delays, cuts and damages datagrams, by a seed.

use std::collections::VecDeque;

use rand::rngs::StdRng;
use rand::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

use crate::{Result, problem};

/// A datagram that is overtaken comes behind so many others at most.
const BEHIND: usize = 8;

/// The share of all datagrams that each fault hits, 0 to 1; at most one fault hits a datagram.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Faults {
    /// Never arrive.
    pub lost: f64,
    /// Arrive twice.
    pub repeated: f64,
    /// Are overtaken by 1 to 8 others.
    pub reordered: f64,
    /// Arrive without their end, which lies anywhere.
    pub cut: f64,
    /// Arrive with one to eight flipped bits.
    pub corrupted: f64,
    /// Draws all of it.
    pub seed: u64,
}

impl Faults {
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
    /// Given to the network.
    pub given: u64,
    /// That came out, whole or not, and repeated ones twice.
    pub delivered: u64,
    /// By fault.
    pub lost: u64,
    /// By fault.
    pub repeated: u64,
    /// By fault.
    pub reordered: u64,
    /// By fault.
    pub cut: u64,
    /// By fault.
    pub corrupted: u64,
}

/// Passes the datagrams of a board on to a host, with faults.
#[derive(Debug, Clone)]
pub struct Network {
    faults: Faults,
    draw: StdRng,
    /// Those that are overtaken, and by how many others still.
    behind: VecDeque<(usize, Vec<u8>)>,
    counts: NetworkCounts,
}

impl Network {
    /// A network with these faults.
    ///
    /// # Errors
    ///
    /// `Problem` if a share, or all of them together, do not lie in 0 to 1.
    pub fn new(faults: Faults) -> Result<Self> {
        let shares = faults.shares();
        for (name, share) in shares {
            if !(0.0..=1.0).contains(&share) {
                return Err(problem!("{name} is {share}: must be a share, 0 to 1"));
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

    /// Takes a datagram; returns the sink what comes out.
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
                self.out(datagram, sink);
                self.out(datagram, sink);
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
                self.out(&datagram[..end.min(datagram.len())], sink);
            }
            "corrupted" if !datagram.is_empty() => {
                self.counts.corrupted += 1;
                let mut hurt = datagram.to_vec();
                // Different bits, so that none is flipped back.
                for bit in rand::seq::index::sample(&mut self.draw, 8 * hurt.len(), 8) {
                    hurt[bit / 8] ^= 1 << (bit % 8);
                    if self.draw.random() {
                        break;
                    }
                }
                self.out(&hurt, sink);
            }
            _ => self.out(datagram, sink),
        }
        for (others, _) in &mut self.behind {
            *others = others.saturating_sub(1);
        }
        while let Some(place) = self.behind.iter().position(|(others, _)| *others == 0) {
            if let Some((_, late)) = self.behind.remove(place) {
                self.out(&late, sink);
            }
        }
    }

    /// Lets out what is still on the way.
    pub fn flush(&mut self, sink: &mut impl FnMut(&[u8])) {
        while let Some((_, late)) = self.behind.pop_front() {
            self.out(&late, sink);
        }
    }

    fn out(&mut self, datagram: &[u8], sink: &mut impl FnMut(&[u8])) {
        self.counts.delivered += 1;
        sink(datagram);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_close_and_what_is_not_befallen_comes_out_as_it_was() {
        let faults = Faults { lost: 0.1, repeated: 0.1, reordered: 0.2, cut: 0.1, corrupted: 0.1, seed: 3 };
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
            Faults { lost: -0.1, ..Faults::default() },
            Faults { cut: f64::NAN, ..Faults::default() },
            Faults { lost: 0.6, corrupted: 0.6, ..Faults::default() },
        ] {
            assert!(Network::new(faults).is_err());
        }
    }
}
