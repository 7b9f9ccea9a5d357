//! Begins and ends of loads that are apart, as of two feet on one plate. They do not depend on position, so what is
//! learnt at one position holds at others.

use serde::{Deserialize, Serialize};

use super::blocks::{BLOCK, Block};
use super::by_stamp::{ByStamp, Measure};
use super::encoding::Encoding;
use super::loaded::Loaded;
use super::stream::Stream;
use super::tare::Tare;
use crate::allowed::Range;
use crate::parameters::parameters;
use crate::spikes::ms;
use crate::{Array, Result, Spike, SpikeKind, problem};

parameters! {
    /// Separate loads: a spike when a load begins, and when one ends, while others last.
    ///
    /// Taxels are loaded and count as for [`ContactArea`](super::ContactArea). Those that are at most a gap apart, in
    /// rows and in columns, are one load; so are those of one stamp and the stamp before. A load begins if none of its
    /// taxels was loaded at the stamp before, and ends if none is loaded any more. Trains, unsigned: begins by each gap,
    /// then ends by each.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    pub struct SeparateLoads {
        /// The board's noise floor, 0 or more, in the sensor's unit (ticks). Default 3, that of the fast presets.
        pub noise_floor: f64 = 3.0, "", Range::FROM_0;
        /// Gaps, ascending, in taxels: 1 joins neighbours alone. Default 1, 2, 4, 8.
        pub gaps: Vec<u32> = vec![1, 2, 4, 8];
        /// The taxels' rest. It is valid for one board on one day: a saved readout has none and receives one when it is
        /// used.
        #[serde(skip_serializing_if = "Option::is_none")]
        pub tare: Option<Tare> = None;
    }
}

impl Encoding for SeparateLoads {
    fn check(&self) -> Result<()> {
        self.check_ranges()?;
        if self.gaps.first().is_none_or(|&least| least == 0) || self.gaps.windows(2).any(|w| w[1] <= w[0]) {
            return Err(problem!("gaps"; " are {:?}: must be one or more, ascending from 1 or more", self.gaps));
        }
        self.tare.as_ref().map_or(Ok(()), Tare::check)
    }

    fn stream(&self, array: &Array) -> Result<Box<dyn Stream>> {
        array.check_neighbours("separate loads")?;
        let loaded = Loaded::new("separate loads", array, self.tare.as_ref(), self.noise_floor)?;
        let loads = PresentLoads {
            gaps: self.gaps.clone(),
            columns: usize::from(array.columns),
            before: vec![],
            place_of: vec![NONE; array.len()],
        };
        Ok(Box::new(ByStamp::new(loads, loaded, array)))
    }

    fn trains(&self, _array: &Array) -> usize {
        2 * self.gaps.len()
    }

    fn kind(&self) -> SpikeKind {
        SpikeKind::Unsigned
    }

    fn set_tare(&mut self, tare: &Tare) {
        self.tare = Some(tare.clone());
    }
}

/// The place of a taxel that has none, and a distance that is longer than any gap.
const NONE: usize = usize::MAX;

/// Taxels that are joined by neighbours.
struct Part {
    /// Row and column of each.
    taxels: Vec<[usize; 2]>,
    /// The first row and column, and the last.
    first: [usize; 2],
    last: [usize; 2],
    /// Whether one is loaded, and whether one was at the stamp before.
    is: bool,
    was: bool,
}

impl Part {
    /// The smallest distance from a taxel of another part, in rows or in columns, whichever is larger; `NONE` if it is
    /// certainly longer than `most`.
    fn apart(&self, other: &Self, most: usize) -> usize {
        let between =
            |k: usize| self.first[k].saturating_sub(other.last[k]).max(other.first[k].saturating_sub(self.last[k]));
        if between(0).max(between(1)) > most {
            return NONE;
        }
        let apart = |a: &[usize; 2], b: &[usize; 2]| a[0].abs_diff(b[0]).max(a[1].abs_diff(b[1]));
        self.taxels.iter().flat_map(|a| other.taxels.iter().map(move |b| apart(a, b))).min().unwrap_or(NONE)
    }
}

/// Merges what a link joins: the first member of each set stands for it.
struct Sets(Vec<usize>);

impl Sets {
    fn first(&mut self, mut member: usize) -> usize {
        while self.0[member] != member {
            self.0[member] = self.0[self.0[member]];
            member = self.0[member];
        }
        member
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.first(a), self.first(b));
        self.0[a.max(b)] = a.min(b);
    }
}

/// The taxels that counted at the end of the last stamp.
#[derive(Clone)]
struct PresentLoads {
    gaps: Vec<u32>,
    columns: usize,
    /// Ascending.
    before: Vec<usize>,
    /// The place of each taxel among those that are in a part, while parts are made.
    place_of: Vec<usize>,
}

impl PresentLoads {
    /// The taxels that count, ascending.
    fn counting(&self, loaded: &Loaded) -> Vec<usize> {
        let blocks = (0..loaded.blocks()).filter(|&block| loaded.any(block));
        let taxels = blocks.flat_map(|block| block * BLOCK..((block + 1) * BLOCK).min(self.place_of.len()));
        taxels.filter(|&taxel| loaded.counts(taxel)).collect()
    }

    /// The taxels that count or counted before, in parts that neighbours join.
    fn parts(&mut self, now: &[usize]) -> Vec<Part> {
        let all = merged(now, &self.before);
        let mut sets = Sets((0..all.len()).collect());
        for (place, &(taxel, ..)) in all.iter().enumerate() {
            let (row, column) = (taxel / self.columns, taxel % self.columns);
            let above = (row > 0).then(|| column.saturating_sub(1)..=(column + 1).min(self.columns - 1));
            let above = above.into_iter().flatten().map(|x| (row - 1) * self.columns + x);
            for neighbour in above.chain((column > 0).then(|| taxel - 1)) {
                if self.place_of[neighbour] != NONE {
                    sets.join(self.place_of[neighbour], place);
                }
            }
            self.place_of[taxel] = place;
        }
        let mut parts: Vec<Part> = vec![];
        let mut part_of_set = vec![NONE; all.len()];
        for (place, &(taxel, is, was)) in all.iter().enumerate() {
            self.place_of[taxel] = NONE;
            let at = [taxel / self.columns, taxel % self.columns];
            let part = &mut part_of_set[sets.first(place)];
            if *part == NONE {
                *part = parts.len();
                parts.push(Part { taxels: vec![], first: at, last: at, is: false, was: false });
            }
            let part = &mut parts[*part];
            part.taxels.push(at);
            for (k, at) in at.into_iter().enumerate() {
                part.first[k] = part.first[k].min(at);
                part.last[k] = part.last[k].max(at);
            }
            part.is |= is;
            part.was |= was;
        }
        parts
    }
}

/// The members of two ascending lists, ascending, and of which of them each is one.
fn merged(a: &[usize], b: &[usize]) -> Vec<(usize, bool, bool)> {
    let (mut a, mut b) = (a.iter().copied().peekable(), b.iter().copied().peekable());
    let mut all = vec![];
    while let Some(next) = a.peek().into_iter().chain(b.peek()).copied().min() {
        all.push((next, a.next_if_eq(&next).is_some(), b.next_if_eq(&next).is_some()));
    }
    all
}

impl Measure for PresentLoads {
    fn trains(&self) -> usize {
        2 * self.gaps.len()
    }

    /// Emits a spike for each gap by which a load has begun since the previous stamp, then for each by which one ended.
    fn emit(&mut self, t: i64, loaded: &Loaded, _held: &[Block], out: &mut Vec<Spike>) {
        let now = self.counting(loaded);
        if now == self.before {
            return;
        }
        let parts = self.parts(&now);
        self.before = now;
        if parts.iter().all(|part| part.is && part.was) {
            return;
        }
        let most = self.gaps.last().map_or(0, |&gap| gap as usize);
        let pairs: Vec<_> = (0..parts.len())
            .flat_map(|a| (0..a).map(move |b| (a, b)))
            .map(|(a, b)| (a, b, parts[a].apart(&parts[b], most)))
            .collect();
        let mut ended = vec![];
        for (train, &gap) in self.gaps.iter().enumerate() {
            let mut sets = Sets((0..parts.len()).collect());
            for &(a, b, _) in pairs.iter().filter(|&&(_, _, apart)| apart <= gap as usize) {
                sets.join(a, b);
            }
            let mut loads = vec![[false; 2]; parts.len()];
            for (k, part) in parts.iter().enumerate() {
                let load = &mut loads[sets.first(k)];
                *load = [load[0] | part.is, load[1] | part.was];
            }
            if loads.contains(&[true, false]) {
                out.push(Spike { t: ms(t), train: train as u32, value: 1.0 });
            }
            if loads.contains(&[false, true]) {
                ended.push(Spike { t: ms(t), train: (self.gaps.len() + train) as u32, value: 1.0 });
            }
        }
        out.append(&mut ended);
    }
}
