//! Spike trains: times of spikes, by train.

use crate::{Result, Stop, problem};

/// Converts a time of the wire, us, to that of neurons, ms.
#[must_use]
pub fn ms(us: i64) -> f64 {
    us as f64 / 1000.0
}

/// Converts a time of neurons, ms, to that of the wire, us; not rounded.
#[must_use]
pub fn us(ms: f64) -> f64 {
    ms * 1000.0
}

/// The meaning of the spikes' values, one for all trains together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum SpikeKind {
    /// Spikes have no value; a neuron reads each as 1.
    #[default]
    Unsigned,
    /// Polarity or bits. A neuron reads each train as two unsigned ones, ON and OFF.
    Signed,
    /// A factor of the weight, finite, above or below 0.
    Graded,
}

impl SpikeKind {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Unsigned, Self::Signed, Self::Graded];

    /// The name in Python and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Unsigned => "unsigned",
            Self::Signed => "signed",
            Self::Graded => "graded",
        }
    }

    /// The kind of this name.
    ///
    /// # Errors
    ///
    /// `Problem`, with the names of all kinds.
    pub fn named(name: &str) -> Result<Self> {
        let names = Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|kind| kind.name() == name)
            .ok_or_else(|| problem!("kind"; " is {name}: must be one of {names}"))
    }

    /// The number of inputs of a neuron for each train: two for signed trains.
    #[must_use]
    pub fn inputs_per_train(self) -> usize {
        if self == Self::Signed { 2 } else { 1 }
    }
}

/// One spike, as encoders emit it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spike {
    /// Time, ms.
    pub t: f64,
    /// Index of its train.
    pub train: u32,
    /// Polarity or bits of a signed spike, the factor of the weight of a graded one, 1 of an unsigned one.
    pub value: f32,
}

/// Spike times by train, in one array with offsets; ms.
#[derive(Debug, Clone, PartialEq)]
pub struct SpikeTrains {
    /// All times, train after train, ascending in each; ms.
    pub times: Vec<f64>,
    /// Index of each train's first spike, and at the end the number of spikes: trains + 1 entries.
    pub offsets: Vec<usize>,
    /// What the values mean.
    pub kind: SpikeKind,
    /// A value per spike of signed and graded trains.
    pub values: Option<Vec<f32>>,
    /// Start of the observed window; ms.
    pub start: f64,
    /// End of the observed window; ms.
    pub stop: f64,
}

impl SpikeTrains {
    /// Sorts spikes into `trains` trains; equal times keep their order.
    ///
    /// # Errors
    ///
    /// `Problem` if a spike's train does not exist, or if a spike is outside the window.
    pub fn from_spikes(spikes: &[Spike], trains: usize, kind: SpikeKind, start: f64, stop: f64) -> Result<Self> {
        let valued = kind != SpikeKind::Unsigned;
        let mut offsets = vec![0_usize; trains + 1];
        for s in spikes {
            let n = s.train as usize;
            if n >= trains {
                return Err(problem!("spike at {} ms: train is {n}, but there are only {trains} trains", s.t));
            }
            if !(start <= s.t && s.t <= stop) {
                return Err(problem!("train {n}: spike at {} ms is outside the window {start} to {stop} ms", s.t));
            }
            offsets[n + 1] += 1;
        }
        for n in 0..trains {
            offsets[n + 1] += offsets[n];
        }
        let mut next = offsets.clone();
        let mut times = vec![0.0; spikes.len()];
        let mut values = vec![0.0; if valued { spikes.len() } else { 0 }];
        for s in spikes {
            let entry = &mut next[s.train as usize];
            times[*entry] = s.t;
            if valued {
                values[*entry] = s.value;
            }
            *entry += 1;
        }
        for train in offsets.windows(2).map(|ends| ends[0]..ends[1]) {
            if !times[train.clone()].is_sorted() {
                let mut order: Vec<usize> = train.clone().collect();
                order.sort_by(|&a, &b| times[a].total_cmp(&times[b]));
                let in_order: Vec<f64> = order.iter().map(|&k| times[k]).collect();
                times[train.clone()].copy_from_slice(&in_order);
                if valued {
                    let in_order: Vec<f32> = order.iter().map(|&k| values[k]).collect();
                    values[train].copy_from_slice(&in_order);
                }
            }
        }
        Ok(Self { times, kind, values: valued.then_some(values), offsets, start, stop })
    }

    /// Copies the columns of spike trains with the window `(start, stop)`, ms, and checks them.
    ///
    /// # Errors
    ///
    /// `Problem` as [`SpikeTrains::check`].
    pub fn copy_of(
        times: &[f64],
        offsets: Vec<usize>,
        (kind, values): (SpikeKind, Option<&[f32]>),
        (start, stop): (f64, f64),
    ) -> Result<Self> {
        let trains = Self { times: times.to_vec(), offsets, kind, values: values.map(<[f32]>::to_vec), start, stop };
        trains.check()?;
        Ok(trains)
    }

    /// Number of trains.
    #[must_use]
    pub fn len(&self) -> usize {
        self.offsets.len().saturating_sub(1)
    }

    /// Whether there are no trains.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The times of train `n`, ms.
    #[must_use]
    pub fn train(&self, n: usize) -> &[f64] {
        &self.times[self.offsets[n]..self.offsets[n + 1]]
    }

    /// All spikes by time; at equal times the lower train first.
    ///
    /// # Errors
    ///
    /// `Interrupted` if the caller stops it.
    pub fn by_time(&self, stop: Stop<'_>) -> Result<Vec<Spike>> {
        let spike = |n: usize, k: usize| Spike {
            t: self.times[k],
            train: u32::try_from(n).unwrap_or(u32::MAX),
            value: self.values.as_ref().map_or(1.0, |v| v[k]),
        };
        let mut all: Vec<Spike> = Vec::with_capacity(self.times.len());
        // Parts of the window are sorted one by one, because one sort of very many spikes could not be interrupted.
        let parts = self.times.len() / BETWEEN_CHECKS + 1;
        let mut next = self.offsets.clone();
        for part in 1..=parts {
            stop.check()?;
            let share = part as f64 / parts as f64;
            let end = if part < parts { self.start + share * (self.stop - self.start) } else { f64::INFINITY };
            let from = all.len();
            for (n, first) in next.iter_mut().enumerate().take(self.len()) {
                let rest = &self.times[*first..self.offsets[n + 1]];
                let until = *first + rest.partition_point(|&t| t < end);
                all.extend((*first..until).map(|k| spike(n, k)));
                *first = until;
            }
            all[from..].sort_by(|a, b| a.t.total_cmp(&b.t));
        }
        Ok(all)
    }

    /// Splits signed trains into twice as many unsigned ones: first all ON (value above 0), then all OFF. Unsigned
    /// trains are returned unchanged.
    ///
    /// # Errors
    ///
    /// `Problem` for graded trains, whose values are factors of the weight.
    pub fn split_by_sign(&self) -> Result<Self> {
        if self.kind == SpikeKind::Graded {
            return Err(
                problem!("trains"; " are graded: their values multiply the weight and are never split by sign"),
            );
        }
        let Some(values) = &self.values else { return Ok(self.clone()) };
        let (mut times, mut offsets) = (Vec::with_capacity(self.times.len()), vec![0]);
        for positive in [true, false] {
            for n in 0..self.len() {
                let range = self.offsets[n]..self.offsets[n + 1];
                times.extend(range.filter(|&k| (values[k] > 0.0) == positive).map(|k| self.times[k]));
                offsets.push(times.len());
            }
        }
        Ok(Self { times, offsets, kind: SpikeKind::Unsigned, values: None, start: self.start, stop: self.stop })
    }

    /// Checks offsets, order, finiteness, window, and that values are those of the kind.
    ///
    /// # Errors
    ///
    /// `Problem`, naming train and spike, or the number of the value.
    pub fn check(&self) -> Result<()> {
        check(&self.times, &self.offsets, (self.kind, self.values.as_deref()), self.start, self.stop)
    }
}

/// Number of spikes that are sorted between two checks for Ctrl-C, where they are spread evenly.
const BETWEEN_CHECKS: usize = 1 << 18;

/// [`SpikeTrains::check`] for borrowed columns.
///
/// # Errors
///
/// `Problem`, naming train and spike, or the number of the value.
pub fn check(
    times: &[f64],
    offsets: &[usize],
    (kind, values): (SpikeKind, Option<&[f32]>),
    start: f64,
    stop: f64,
) -> Result<()> {
    check_values(kind, values, times.len())?;
    if !(start.is_finite() && stop.is_finite() && start <= stop) {
        return Err(problem!("window {} to {} ms: start must not be after stop", start, stop));
    }
    let sound = offsets.first() == Some(&0) && offsets.last() == Some(&times.len()) && offsets.is_sorted();
    if !sound {
        return Err(problem!("offsets must ascend from 0 to the number of spikes, {}", times.len()));
    }
    for (n, ends) in offsets.windows(2).enumerate() {
        let train = &times[ends[0]..ends[1]];
        for (k, &t) in train.iter().enumerate() {
            if !t.is_finite() {
                return Err(problem!("train {n}, spike {k}: time is {t}; must be finite"));
            }
            if k > 0 && t < train[k - 1] {
                return Err(problem!(
                    "train {n}, spike {k}: {t} ms comes after {} ms; times must ascend",
                    train[k - 1]
                ));
            }
            if t < start || t > stop {
                return Err(problem!("train {n}, spike {k}: {t} ms is outside the window {} to {} ms", start, stop));
            }
        }
    }
    Ok(())
}

/// Checks that there are values where the kind has them, one per spike, all finite, and of graded spikes none 0.
fn check_values(kind: SpikeKind, values: Option<&[f32]>, spikes: usize) -> Result<()> {
    let Some(values) = values else {
        return match kind {
            SpikeKind::Unsigned => Ok(()),
            SpikeKind::Signed | SpikeKind::Graded => Err(problem!("{} trains need one value per spike", kind.name())),
        };
    };
    if kind == SpikeKind::Unsigned {
        return Err(problem!("unsigned trains have no values: choose kind signed or graded, or leave the values out"));
    }
    if values.len() != spikes {
        return Err(problem!("values"; ": must be one per spike, {spikes}"));
    }
    if let Some(k) = values.iter().position(|value| !value.is_finite()) {
        return Err(problem!("values"; "[{k}] is {}: must be finite", format!("{}", values[k]).to_lowercase()));
    }
    if kind == SpikeKind::Graded
        && let Some(k) = values.iter().position(|&value| value == 0.0)
    {
        return Err(problem!("values"; "[{k}] is 0: a graded value of 0 is not a spike; leave it out"));
    }
    Ok(())
}
