//! Exponentials computed once per spike, so that comparing two smoothed trains takes a few multiplications per spike.
//!
//! The inner product of two trains smoothed by `exp(-t / tau)` is, in units of tau / 2, the sum of `exp(-|s - t| / tau)`
//! over their spikes s and t (Houghton and Kreuz 2012). For one spike t of the second that is
//! `fall(t) * sum of rise(s) over s <= t  +  rise(t) * sum of fall(s) over s > t`, with `rise(t) = exp(t / tau)` and
//! `fall = 1 / rise`. The sums are stored for the first train's entries and looked up by the cell of time that contains
//! t. Time is divided into stretches short enough for `rise` not to overflow; the edge of a stretch is an entry without
//! a spike, at which the sums are converted from one stretch's unit to the next's.

use super::patterns::Patterns;

/// The length of a stretch in tau; within it, `rise` ranges from `exp(-STRETCH / 2)` to `exp(STRETCH / 2)`.
const STRETCH: f64 = 512.0;

/// The number of cells of time for each spike of a typical train.
const CELLS_A_SPIKE: usize = 8;

/// The division of time into cells and stretches.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    tau: f64,
    start: f64,
    stretches: usize,
    cells: usize,
    cells_a_ms: f64,
}

/// A spike time with its cell.
#[derive(Debug, Clone, Copy)]
pub(super) struct Query {
    t: f64,
    rise: f64,
    fall: f64,
    cell: usize,
}

impl Frame {
    /// For the times of train `n` of these patterns, or of whole patterns. `None` if there are no spikes, or if there
    /// would be more edges than spikes, so that storing the sums gains nothing.
    pub(super) fn around(tau: f64, sides: &[&Patterns<'_>], n: Option<usize>) -> Option<Self> {
        let trains = || {
            sides.iter().flat_map(|side| {
                let chosen = n.map_or(0..side.trains, |n| n..n + 1);
                (0..side.count).flat_map(move |p| chosen.clone().map(move |n| side.train(p, n)))
            })
        };
        let start = trains().filter_map(<[f64]>::first).copied().fold(f64::INFINITY, f64::min);
        let stop = trains().filter_map(<[f64]>::last).copied().fold(f64::NEG_INFINITY, f64::max);
        let patterns: usize = sides.iter().map(|side| side.count).sum();
        let entries = trains().map(<[f64]>::len).sum::<usize>().div_ceil(patterns.max(1));
        let stretches = ((stop - start) / (STRETCH * tau)).floor() + 1.0;
        if !(start <= stop && stretches <= entries.max(4) as f64) {
            return None;
        }
        let cells = (CELLS_A_SPIKE * entries).next_power_of_two().clamp(8, 1 << 20);
        let cells_a_ms = if stop > start { cells as f64 / (stop - start) } else { 0.0 };
        Some(Self { tau, start, stretches: stretches as usize, cells, cells_a_ms })
    }

    /// The start of stretch `s`.
    fn edge(&self, s: usize) -> f64 {
        self.start + s as f64 * (STRETCH * self.tau)
    }

    /// The cell of a time; cells ascend with time.
    fn cell(&self, t: f64) -> usize {
        (((t - self.start) * self.cells_a_ms) as usize).min(self.cells - 1)
    }

    /// A spike time with its cell.
    pub(super) fn query(&self, t: f64) -> Query {
        let mut stretch = ((t - self.start) / (STRETCH * self.tau)) as usize;
        // The computed edges decide, so that rounding in this division does not matter.
        while stretch > 0 && self.edge(stretch) > t {
            stretch -= 1;
        }
        while stretch + 1 < self.stretches && self.edge(stretch + 1) <= t {
            stretch += 1;
        }
        let rise = ((t - self.edge(stretch)) / self.tau - STRETCH / 2.0).exp();
        Query { t, rise, fall: 1.0 / rise, cell: self.cell(t) }
    }
}

/// The times at which sums change: spikes, and edges of stretches.
#[derive(Debug, Clone)]
pub(super) struct Entries {
    /// The times in ascending order, followed by infinity, which ends every search.
    times: Vec<f64>,
    /// The values of spikes; 0 at edges.
    rise: Vec<f64>,
    fall: Vec<f64>,
    /// The number of entries in earlier cells, by cell.
    before: Vec<u32>,
    edges: Vec<usize>,
}

impl Entries {
    /// Entries for these ascending times and for the edges; also returns the entry of each time.
    pub(super) fn new(frame: &Frame, spikes: impl Iterator<Item = f64>) -> (Self, Vec<usize>) {
        let (mut times, mut rise, mut fall) = (Vec::new(), Vec::new(), Vec::new());
        let (mut edges, mut of_spike) = (Vec::new(), Vec::new());
        for spike in spikes.map(Some).chain([None]) {
            // At an edge the sums change their unit before a spike at the same time is added.
            let until = spike.unwrap_or(f64::INFINITY);
            while edges.len() + 1 < frame.stretches && frame.edge(edges.len() + 1) <= until {
                times.push(frame.edge(edges.len() + 1));
                edges.push(rise.len());
                rise.push(0.0);
                fall.push(0.0);
            }
            if let Some(t) = spike {
                let query = frame.query(t);
                of_spike.push(times.len());
                times.push(t);
                rise.push(query.rise);
                fall.push(query.fall);
            }
        }
        let mut before = vec![0; frame.cells];
        for &t in &times {
            if let Some(next) = before.get_mut(frame.cell(t) + 1) {
                *next += 1;
            }
        }
        let mut sum = 0;
        for cell in &mut before {
            sum += *cell;
            *cell = sum;
        }
        times.push(f64::INFINITY);
        (Self { times, rise, fall, before, edges }, of_spike)
    }

    /// The number of entries.
    pub(super) fn len(&self) -> usize {
        self.rise.len()
    }

    /// The number of entries at or before a query.
    #[inline(always)]
    fn until(&self, query: &Query) -> usize {
        let mut k = self.before[query.cell] as usize;
        while self.times[k] <= query.t {
            k += 1;
        }
        k
    }

    /// The sums of entries weighted by `weight`, for each number of passed entries: rises of passed ones, falls of
    /// later ones.
    pub(super) fn sums(&self, weight: impl Fn(usize) -> f64, sums: &mut Vec<[f64; 2]>) {
        let (n, unit) = (self.len(), (-STRETCH).exp());
        sums.clear();
        sums.resize(n + 1, [0.0; 2]);
        let (mut behind, mut edges) = (0.0, self.edges.iter().peekable());
        for k in 0..n {
            if edges.next_if_eq(&&k).is_some() {
                behind *= unit;
            }
            behind += self.rise[k] * weight(k);
            sums[k + 1][0] = behind;
        }
        let (mut ahead, mut edges) = (0.0, self.edges.iter().rev().peekable());
        for k in (0..n).rev() {
            ahead += self.fall[k] * weight(k);
            if edges.next_if_eq(&&k).is_some() {
                ahead *= unit;
            }
            sums[k][1] = ahead;
        }
    }

    /// The inner product of the summed trains with these spikes, in units of tau / 2.
    #[inline]
    pub(super) fn product(&self, sums: &[[f64; 2]], queries: &[Query]) -> f64 {
        let (mut behind, mut ahead) = (0.0, 0.0);
        for query in queries {
            let [rises, falls] = sums[self.until(query)];
            behind += query.fall * rises;
            ahead += query.rise * falls;
        }
        behind + ahead
    }
}
