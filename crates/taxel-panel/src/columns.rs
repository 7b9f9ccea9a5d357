//! Raster and contact curves over time, by columns of time of equal width.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;

use taxel_core::Array;

/// Width of a column of time unless a client asks for another, us.
pub const COLUMN_US: i64 = 4000;

/// The narrowest and the widest column of time, us; allowed widths double from one to the next.
pub const COLUMNS_US: (i64, i64) = (125, 125 << 20);

/// Columns of time in a frame: 5 s at the default width, 0.16 s at the narrowest, 45 hours at the widest.
pub const SPAN: i64 = 1250;

/// A change that arrives at most this late still enters the raster and the curves, us.
pub const LATE_US: i64 = 120_000;

/// Most columns of time in which the greatest force of the first touch is looked for.
const TOUCH_COLUMNS: usize = 250;

/// The ticks above rest of a channel at no time: the least above the greatest.
const NO_CHANNEL: (u16, u16) = (u16::MAX, 0);

/// Maximum number of channels that each have a curve.
const MOST_CHANNELS: usize = 64;

/// A touch exceeds the quiet force by this part of the greatest excess: one in so many.
const TOUCH_SHARE: u32 = 4;
/// The force of one column in so many, the least ones, is that of a sensor at rest.
const QUIET_SHARE: usize = 5;

/// The contact as a whole at a time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Curve {
    /// Sum of ticks above rest.
    pub sum: u32,
    /// Number of taxels above rest; [`MISSING`]'s where no taxel has a value.
    pub area: u32,
    /// Column of the centre of pressure; NaN where nothing is pressed.
    pub x: f32,
    /// Row of the centre of pressure; NaN where nothing is pressed.
    pub y: f32,
}

/// The least and the greatest of each value of a [`Curve`] over a stretch of time.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    /// Of the sum; the least above the greatest where no taxel had a value.
    pub sum: (u32, u32),
    /// Of the number of taxels above rest.
    pub area: (u32, u32),
    /// Of the column of the centre; NaN where nothing was pressed.
    pub x: (f32, f32),
    /// Of the row of the centre.
    pub y: (f32, f32),
}

impl Extent {
    /// That of no time.
    pub const NOTHING: Self =
        Self { sum: (u32::MAX, 0), area: (u32::MAX, 0), x: (f32::NAN, f32::NAN), y: (f32::NAN, f32::NAN) };

    /// Extends it to a time with this curve.
    pub(super) fn extend(&mut self, curve: &Curve) {
        if curve.area != MISSING.area {
            let both = |value| (value, value);
            let Curve { sum, area, x, y } = *curve;
            self.join(&Self { sum: both(sum), area: both(area), x: (x, x), y: (y, y) });
        }
    }

    /// Extends it to another stretch of time.
    pub(super) fn join(&mut self, other: &Self) {
        let whole = |a: (u32, u32), b: (u32, u32)| (a.0.min(b.0), a.1.max(b.1));
        // The least and the greatest of a number and NaN are the number.
        let real = |a: (f32, f32), b: (f32, f32)| (a.0.min(b.0), a.1.max(b.1));
        (self.sum, self.area) = (whole(self.sum, other.sum), whole(self.area, other.area));
        (self.x, self.y) = (real(self.x, other.x), real(self.y, other.y));
    }

    fn bits(&self) -> [u32; 8] {
        let Self { sum, area, x, y } = self;
        [sum.0, sum.1, area.0, area.1, x.0.to_bits(), x.1.to_bits(), y.0.to_bits(), y.1.to_bits()]
    }

    /// Appends it as frames have it.
    pub(super) fn write(&self, out: &mut Vec<u8>) {
        self.bits().iter().for_each(|word| out.extend(word.to_le_bytes()));
    }
}

impl PartialEq for Extent {
    fn eq(&self, other: &Self) -> bool {
        self.bits() == other.bits()
    }
}

/// The curves of a stretch of time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Curves {
    /// Of all taxels, then of each of several sources.
    pub sums: Vec<Extent>,
    /// The least and the greatest ticks above rest of each channel.
    pub channels: Vec<(u16, u16)>,
}

/// Number of the column of time that holds `t` (us), of columns `column_us` wide.
pub fn column_of(t: i64, column_us: i64) -> i64 {
    t.div_euclid(column_us)
}

/// Whether `us` is an allowed width of a column of time.
pub fn is_column(us: i64) -> bool {
    let (least, most) = COLUMNS_US;
    (least..=most).contains(&us) && us % least == 0 && (us / least).count_ones() == 1
}

/// What a column of time holds of each row, of each channel, and of each of several sources.
#[derive(Debug, Clone, Copy)]
struct ColumnShape {
    rows: usize,
    channels: usize,
    sums: usize,
}

impl ColumnShape {
    fn new(array: &Array, sources: usize) -> Self {
        let channels = if array.is_channels() && array.len() <= MOST_CHANNELS { array.len() } else { 0 };
        Self { rows: array.rows.into(), channels, sums: 1 + sources }
    }

    fn bytes(self) -> usize {
        let Self { rows, channels, sums } = self;
        size_of::<i64>() + rows + sums * size_of::<Extent>() + channels * size_of::<(u16, u16)>()
    }
}

/// Raster and curves by column of time. A column that is not stored has no changes, and the curves of the last stored one
/// before it: a stretch without events takes no memory.
#[derive(Debug, Clone)]
pub struct TimeColumns {
    shape: ColumnShape,
    /// What was stored before, and the column from which on these columns replace it.
    earlier: Option<(Arc<TimeColumns>, i64)>,
    /// The columns that are stored, ascending. Nearly every access is to the last ones.
    numbers: VecDeque<i64>,
    /// The raster of each: ups and downs by row.
    raster: VecDeque<u8>,
    /// The curves of each.
    sums: VecDeque<Extent>,
    channels: VecDeque<(u16, u16)>,
    /// First and last known column.
    reach: Option<(i64, i64)>,
    /// Maximum number of stored columns.
    most: usize,
}

impl TimeColumns {
    /// Columns of an array, with a curve for each of so many sources. So many are stored at most, but no fewer than a frame shows:
    /// the oldest are dropped.
    pub fn new(array: &Array, sources: usize, most: i64) -> Self {
        Self {
            shape: ColumnShape::new(array, sources),
            earlier: None,
            numbers: VecDeque::new(),
            raster: VecDeque::new(),
            sums: VecDeque::new(),
            channels: VecDeque::new(),
            reach: None,
            most: usize::try_from(most.max(2 * SPAN)).unwrap_or(usize::MAX),
        }
    }

    /// Number of columns of an array that take so many bytes.
    pub fn columns_in(bytes: i64, array: &Array, sources: usize) -> i64 {
        bytes / i64::try_from(ColumnShape::new(array, sources).bytes()).unwrap_or(i64::MAX)
    }

    /// The same after columns that are stored already, which these replace from column `from` on.
    pub(super) fn after(self, earlier: Arc<Self>, from: i64) -> Self {
        Self { earlier: Some((earlier, from)), ..self }
    }

    /// The curves of no time.
    pub fn no_curves(&self) -> Curves {
        let ColumnShape { channels, sums, .. } = self.shape;
        Curves { sums: vec![Extent::NOTHING; sums], channels: vec![NO_CHANNEL; channels] }
    }

    /// Rows of the array.
    pub fn rows(&self) -> usize {
        self.shape.rows
    }

    /// First and last known column.
    pub fn reach(&self) -> Option<(i64, i64)> {
        let earlier = self.earlier.as_ref().and_then(|(earlier, _)| earlier.reach());
        self.reach.map(|(first, last)| (earlier.map_or(first, |(there, _)| first.min(there)), last))
    }

    /// Extends the known columns up to this one.
    pub(super) fn extend_to(&mut self, column: i64) {
        match &mut self.reach {
            None => self.reach = Some((column, column)),
            Some(reach) => reach.1 = reach.1.max(column),
        }
    }

    /// Removes everything after a column.
    pub(super) fn truncate_after(&mut self, column: i64) {
        let Some(reach) = self.reach.filter(|reach| reach.1 > column) else { return };
        self.reach = Some((reach.0.min(column), column));
        let stored = self.numbers.partition_point(|&there| there <= column);
        self.numbers.truncate(stored);
        self.raster.truncate(stored * self.shape.rows);
        self.sums.truncate(stored * self.shape.sums);
        self.channels.truncate(stored * self.shape.channels);
    }

    /// The index of a column, which is stored from now on, with the curves of the one before it.
    fn store(&mut self, column: i64) -> usize {
        let at = match self.numbers.back() {
            Some(&last) if last == column => return self.numbers.len() - 1,
            Some(&last) if last > column => match self.numbers.binary_search(&column) {
                Ok(at) => return at,
                Err(at) => at,
            },
            _ => self.numbers.len(),
        };
        let ColumnShape { rows, sums, channels } = self.shape;
        let before = self.own_curves(column);
        insert(&mut self.numbers, at, [column]);
        insert(&mut self.raster, at * rows, std::iter::repeat_n(0, rows));
        insert(&mut self.sums, at * sums, before.sums);
        insert(&mut self.channels, at * channels, before.channels);
        if self.numbers.len() <= self.most {
            return at;
        }
        self.numbers.pop_front();
        self.raster.drain(..rows);
        self.sums.drain(..sums);
        self.channels.drain(..channels);
        self.reach = self.reach.map(|(first, last)| (self.numbers.front().map_or(first, |&now| first.max(now)), last));
        at.saturating_sub(1)
    }

    /// Counts changes in a column, each given by its row and whether it rose.
    pub(super) fn count(&mut self, column: i64, changes: impl Iterator<Item = (u16, bool)>) {
        if self.reach.is_some_and(|(first, _)| column < first) {
            return;
        }
        let (at, rows) = (self.store(column), self.shape.rows);
        for (row, up) in changes {
            add_to(&mut self.raster[at * rows + usize::from(row)], u8::from(up), u8::from(!up));
        }
    }

    /// Sets the curves of a column.
    pub(super) fn set_curves(&mut self, column: i64, curves: &Curves) {
        if self.own_curves(column) != *curves {
            let ColumnShape { sums, channels, .. } = self.shape;
            let at = self.store(column);
            self.sums.range_mut(at * sums..(at + 1) * sums).zip(&curves.sums).for_each(|(there, now)| *there = *now);
            let there = self.channels.range_mut(at * channels..(at + 1) * channels);
            there.zip(&curves.channels).for_each(|(there, now)| *there = *now);
        }
    }

    /// The curves of a column; of no time before the first one.
    pub(super) fn curves(&self, column: i64) -> Curves {
        let mut curves = self.no_curves();
        self.join_curves(column..column + 1, &mut curves);
        curves
    }

    /// The columns that earlier ones have of these, and these themselves.
    fn parts(&self, columns: Range<i64>) -> (Option<(&Self, Range<i64>)>, Range<i64>) {
        let Some((earlier, from)) = &self.earlier else { return (None, columns) };
        // Columns that take all of their memory drop the first ones.
        let from = self.reach.map_or(i64::MAX, |(first, _)| first.max(*from));
        let from = from.clamp(columns.start, columns.end.max(columns.start));
        (Some((earlier, columns.start..from)), from..columns.end)
    }

    /// The indices of the columns that are stored among these.
    fn stored(&self, columns: &Range<i64>) -> Range<usize> {
        let until = |column: i64| self.numbers.partition_point(|&there| there < column);
        until(columns.start)..until(columns.end)
    }

    /// Extends curves to those of columns.
    pub fn join_curves(&self, columns: Range<i64>, to: &mut Curves) {
        let (earlier, own) = self.parts(columns);
        if let Some((earlier, columns)) = earlier {
            earlier.join_curves(columns, to);
        }
        self.join_own(own, to);
    }

    fn join_own(&self, columns: Range<i64>, to: &mut Curves) {
        if columns.is_empty() {
            return;
        }
        let ColumnShape { sums, channels, .. } = self.shape;
        // The first one is stored, or is as the one before it.
        let Range { start, end } = self.stored(&columns);
        let is_stored = self.numbers.get(start) == Some(&columns.start);
        let begin = if is_stored { start } else { start.saturating_sub(1) };
        for k in begin..end {
            let more = self.sums.range(k * sums..(k + 1) * sums);
            to.sums.iter_mut().zip(more).for_each(|(all, more)| all.join(more));
            let more = self.channels.range(k * channels..(k + 1) * channels);
            to.channels.iter_mut().zip(more).for_each(|(all, more)| *all = (all.0.min(more.0), all.1.max(more.1)));
        }
    }

    fn own_curves(&self, column: i64) -> Curves {
        let mut curves = self.no_curves();
        self.join_own(column..column + 1, &mut curves);
        curves
    }

    /// The curve of all taxels in a column.
    pub fn curve(&self, column: i64) -> Extent {
        self.curves(column).sums[0]
    }

    /// The columns that are stored, each with its greatest sum of ticks above rest; a stretch without events is left out.
    fn forces(&self) -> impl Iterator<Item = (i64, u32)> {
        self.numbers.iter().zip(self.sums.iter().step_by(self.shape.sums)).map(|(&column, sums)| (column, sums.sum.1))
    }

    /// The greatest sum of ticks above rest in each of `bins` stretches of `step` us, the first of which begins at `start` (us), of
    /// columns `column_us` wide.
    pub fn greatest_sums(&self, start: i64, step: i64, bins: usize, column_us: i64) -> Vec<u32> {
        // At the beginning of a stretch the force is what it was before, also where nothing is stored.
        let begin = |bin: usize| start + i64::try_from(bin).unwrap_or(0) * step;
        let mut sums: Vec<u32> = (0..bins).map(|bin| self.curve(column_of(begin(bin), column_us)).sum.1).collect();
        for (column, most) in self.forces() {
            let bin = (column * column_us - start).div_euclid(step);
            if let Some(sum) = usize::try_from(bin).ok().and_then(|bin| sums.get_mut(bin)) {
                *sum = (*sum).max(most);
            }
        }
        sums
    }

    /// The column of greatest force in the first touch; `None` where there is no force.
    pub fn first_touch(&self) -> Option<i64> {
        let mut sums: Vec<u32> = self.forces().map(|(_, sum)| sum).collect();
        let most = *sums.iter().max()?;
        let rank = sums.len() / QUIET_SHARE;
        let (_, &mut quiet, _) = sums.select_nth_unstable(rank);
        let least = quiet + ((most - quiet) / TOUCH_SHARE).max(1);
        let touch = self.forces().skip_while(|&(_, sum)| sum < least).take_while(|&(_, sum)| sum >= least);
        let greatest = |found: Option<(i64, u32)>, (column, sum): (i64, u32)| match found {
            Some((_, most)) if sum <= most => found,
            _ => Some((column, sum)),
        };
        touch.take(TOUCH_COLUMNS).fold(None, greatest).map(|(column, _)| column)
    }

    /// Adds the raster of columns to `out`, which has one byte per row; counts stay at 15.
    pub fn add_raster(&self, columns: Range<i64>, out: &mut [u8]) {
        let (earlier, columns) = self.parts(columns);
        if let Some((earlier, columns)) = earlier {
            earlier.add_raster(columns, out);
        }
        let (Range { start, end }, rows) = (self.stored(&columns), self.shape.rows);
        for (n, cell) in self.raster.range(start * rows..end * rows).enumerate().filter(|(_, cell)| **cell > 0) {
            add_to(&mut out[n % rows], cell & 15, cell >> 4);
        }
    }
}

/// Inserts values, nearly always at the end.
fn insert<T>(into: &mut VecDeque<T>, at: usize, values: impl IntoIterator<Item = T>) {
    let after = into.split_off(at);
    into.extend(values);
    into.extend(after);
}

/// Adds ups and downs to a cell of a raster; both stay at 15.
fn add_to(cell: &mut u8, ups: u8, downs: u8) {
    let (ups, downs) = ((*cell & 15) + ups, (*cell >> 4) + downs);
    *cell = ups.min(15) | downs.min(15) << 4;
}

/// The curve while nothing is pressed.
pub const NOTHING: Curve = Curve { sum: 0, area: 0, x: f32::NAN, y: f32::NAN };

/// The curve of a frame in which no taxel has a value.
pub const MISSING: Curve = Curve { area: u32::MAX, ..NOTHING };
