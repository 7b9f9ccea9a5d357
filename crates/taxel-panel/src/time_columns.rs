//! Raster and contact curves over the last seconds, by columns of time of equal width.

use std::collections::VecDeque;
use std::ops::Range;

use taxel_core::Array;

/// Width of a column of time unless a client asks for another, us.
pub const COLUMN_US: i64 = 4000;

/// The narrowest and the widest column of time, us; allowed widths double from one to the next.
pub const COLUMNS_US: (i64, i64) = (125, 125 << 20);

/// Columns of time in a frame: 5 s at the default width, 0.16 s at the narrowest, 45 hours at the widest.
pub const SPAN: i64 = 1250;

/// A change that arrives at most this late still enters the raster and the curves, us.
pub const LATE_US: i64 = 120_000;

/// Columns of time in a block of a [`TimeColumns`].
const BLOCK: i64 = 250;

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
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// Of all taxels, then of each of several sources.
    pub sums: Vec<Extent>,
    /// The least and the greatest ticks above rest of each channel.
    pub channels: Vec<(u16, u16)>,
}

/// Number of the column of time that holds `t` (us), of columns `column_us` wide.
#[must_use]
pub fn column_of(t: i64, column_us: i64) -> i64 {
    t.div_euclid(column_us)
}

/// Whether `us` is an allowed width of a column of time.
#[must_use]
pub fn is_column(us: i64) -> bool {
    let (least, most) = COLUMNS_US;
    (least..=most).contains(&us) && us % least == 0 && (us / least).count_ones() == 1
}

/// The curves of a column, of the sums and of the channels.
type OfColumn<'a> = (&'a [Extent], &'a [(u16, u16)]);

#[derive(Debug, Clone)]
struct ColumnBlock {
    raster: Vec<u8>,
    /// The curves of its first columns, column after column.
    during: Curves,
    /// Those of all later ones.
    after: Curves,
}

/// What a column of time holds of each row, of each channel, and of each of several sources.
#[derive(Debug, Clone, Copy)]
struct ColumnShape {
    rows: usize,
    channels: usize,
    sources: usize,
}

impl ColumnShape {
    fn new(array: &Array) -> Self {
        let channels = if array.is_channels() && array.len() <= MOST_CHANNELS { array.len() } else { 0 };
        Self { rows: array.rows.into(), channels, sources: 0 }
    }

    fn block_bytes(self) -> usize {
        let curves = (1 + self.sources) * size_of::<Extent>() + self.channels * size_of::<(u16, u16)>();
        BLOCK.unsigned_abs() as usize * (self.rows + curves)
    }

    /// The curves of no time.
    fn nothing(self) -> Curves {
        Curves { sums: vec![Extent::NOTHING; 1 + self.sources], channels: vec![NO_CHANNEL; self.channels] }
    }
}

impl ColumnBlock {
    /// Number of columns whose curves it has.
    fn len(&self) -> usize {
        self.during.sums.len() / self.after.sums.len()
    }

    /// The curves of its column `k`.
    fn curves(&self, k: usize) -> OfColumn<'_> {
        if k >= self.len() {
            return (&self.after.sums, &self.after.channels);
        }
        let (sums, channels) = (self.after.sums.len(), self.after.channels.len());
        (&self.during.sums[k * sums..(k + 1) * sums], &self.during.channels[k * channels..(k + 1) * channels])
    }

    /// Removes the curves of its columns from `k` on.
    fn truncate(&mut self, k: usize) {
        self.during.sums.truncate(k * self.after.sums.len());
        self.during.channels.truncate(k * self.after.channels.len());
    }
}

/// Raster and curves by column of time, stored in blocks; a stretch without events takes no memory.
#[derive(Debug, Clone)]
pub struct TimeColumns {
    shape: ColumnShape,
    /// Ascending by number. Nearly every access is to the newest block.
    blocks: VecDeque<(i64, ColumnBlock)>,
    /// First and last known column.
    reach: Option<(i64, i64)>,
    /// Maximum number of blocks.
    max_blocks: usize,
}

impl TimeColumns {
    /// Columns of an array that take at most about `bytes` bytes: the oldest blocks are dropped.
    #[must_use]
    pub fn new(array: &Array, bytes: usize) -> Self {
        let shape = ColumnShape::new(array);
        let block = shape.block_bytes();
        Self {
            shape,
            blocks: VecDeque::new(),
            reach: None,
            max_blocks: (bytes / block).max(SPAN.unsigned_abs() as usize / BLOCK.unsigned_abs() as usize + 2),
        }
    }

    /// The same with a curve for each of so many sources; nothing may be stored yet.
    #[must_use]
    pub(super) fn with_sources(mut self, sources: usize) -> Self {
        debug_assert!(self.blocks.is_empty());
        self.shape.sources = sources;
        self
    }

    /// Bytes that `columns` columns of an array take.
    #[must_use]
    pub fn bytes_for(array: &Array, columns: i64) -> usize {
        (usize::try_from(columns / BLOCK).unwrap_or(0) + 2) * ColumnShape::new(array).block_bytes()
    }

    /// Rows of the array.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.shape.rows
    }

    /// The curves of no time.
    #[must_use]
    pub fn no_curves(&self) -> Curves {
        self.shape.nothing()
    }

    /// First and last known column.
    #[must_use]
    pub fn reach(&self) -> Option<(i64, i64)> {
        self.reach
    }

    /// Index of a block, or where it would be inserted.
    fn block_index(&self, key: i64) -> Result<usize, usize> {
        match self.blocks.back() {
            Some(&(last, _)) if last == key => Ok(self.blocks.len() - 1),
            _ => self.blocks.binary_search_by_key(&key, |&(key, _)| key),
        }
    }

    fn block(&mut self, column: i64) -> (&mut ColumnBlock, usize) {
        let (key, rows) = (column.div_euclid(BLOCK), self.shape.rows);
        let index = match self.block_index(key) {
            Ok(index) => index,
            Err(mut index) => {
                if self.blocks.len() >= self.max_blocks
                    && let Some((oldest, _)) = self.blocks.pop_front()
                {
                    index = index.saturating_sub(1);
                    if let Some(reach) = &mut self.reach {
                        reach.0 = reach.0.max((oldest + 1) * BLOCK);
                    }
                }
                let n = BLOCK.unsigned_abs() as usize;
                let before = index.checked_sub(1).map(|before| self.blocks[before].1.after.clone());
                let during = Curves { sums: vec![], channels: vec![] };
                let after = before.unwrap_or_else(|| self.shape.nothing());
                let block = ColumnBlock { raster: vec![0; n * rows], during, after };
                self.blocks.insert(index, (key, block));
                index
            }
        };
        (&mut self.blocks[index].1, column.rem_euclid(BLOCK).unsigned_abs() as usize)
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
        let key = column.div_euclid(BLOCK);
        self.blocks.truncate(self.blocks.partition_point(|&(there, _)| there <= key));
        if let Ok(index) = self.block_index(key) {
            let block = &mut self.blocks[index].1;
            let k = usize::try_from(column.rem_euclid(BLOCK)).unwrap_or(0);
            block.raster[(k + 1) * self.shape.rows..].fill(0);
            block.truncate(k + 1);
        }
    }

    /// Counts changes in a column, each given by its row and whether it rose.
    pub(super) fn count(&mut self, column: i64, changes: impl Iterator<Item = (u16, bool)>) {
        if self.reach.is_some_and(|(first, _)| column < first) {
            return;
        }
        let rows = self.shape.rows;
        let (block, k) = self.block(column);
        let cells = &mut block.raster[k * rows..(k + 1) * rows];
        for (row, up) in changes {
            let cell = &mut cells[usize::from(row)];
            let (ups, downs) = ((*cell & 15) + u8::from(up), (*cell >> 4) + u8::from(!up));
            *cell = ups.min(15) | downs.min(15) << 4;
        }
    }

    /// Sets the curves of a column, and those from its end on.
    pub(super) fn set_curves(&mut self, column: i64, during: &Curves, after: &Curves) {
        let same = |column: i64, curves: &Curves| {
            self.curves(column).is_some_and(|(sums, channels)| *sums == curves.sums && *channels == curves.channels)
        };
        // A stretch without events repeats what was before it, so it needs no block.
        if !(same(column, during) && same(column + 1, after)) {
            let (block, k) = self.block(column);
            block.truncate(k);
            while block.len() < k {
                block.during.sums.extend_from_slice(&block.after.sums);
                block.during.channels.extend_from_slice(&block.after.channels);
            }
            block.during.sums.extend_from_slice(&during.sums);
            block.during.channels.extend_from_slice(&during.channels);
            block.after.clone_from(after);
        }
    }

    /// The curves of a column; `None` before the first block.
    fn curves(&self, column: i64) -> Option<OfColumn<'_>> {
        let (key, k) = (column.div_euclid(BLOCK), column.rem_euclid(BLOCK).unsigned_abs() as usize);
        match self.block_index(key) {
            Ok(index) => Some(self.blocks[index].1.curves(k)),
            Err(index) => {
                let after = &self.blocks[index.checked_sub(1)?].1.after;
                Some((&after.sums, &after.channels))
            }
        }
    }

    /// Extends curves to those of columns.
    pub fn join_curves(&self, columns: Range<i64>, sums: &mut [Extent], channels: &mut [(u16, u16)]) {
        let Range { start, end } = columns;
        if start >= end {
            return;
        }
        let mut join = |(more_sums, more_channels): OfColumn<'_>| {
            sums.iter_mut().zip(more_sums).for_each(|(sum, more)| sum.join(more));
            let widen = |(all, more): (&mut (u16, u16), &(u16, u16))| *all = (all.0.min(more.0), all.1.max(more.1));
            channels.iter_mut().zip(more_channels).for_each(widen);
        };
        self.curves(start).into_iter().for_each(&mut join);
        // All that are not stored are as the end of the one before.
        let from = self.blocks.partition_point(|(key, _)| (key + 1) * BLOCK <= start);
        for (key, block) in self.blocks.range(from..).take_while(|(key, _)| key * BLOCK < end) {
            let within = |column: i64| usize::try_from((column - key * BLOCK).clamp(0, BLOCK)).unwrap_or(0);
            (within(start)..within(end).min(block.len())).for_each(|k| join(block.curves(k)));
        }
    }

    /// The curve of all taxels in a column.
    #[must_use]
    pub fn curve(&self, column: i64) -> Extent {
        self.curves(column).map_or(Extent::NOTHING, |(sums, _)| sums[0])
    }

    /// The columns that are stored, each with its greatest sum of ticks above rest; a stretch without events is left out.
    fn stored(&self) -> impl Iterator<Item = (i64, u32)> {
        let (first, last) = self.reach.unwrap_or((0, -1));
        let of_block = |(key, block): &(i64, ColumnBlock)| {
            let sums: Vec<u32> = (0..BLOCK.unsigned_abs() as usize).map(|k| block.curves(k).0[0].sum.1).collect();
            (key * BLOCK..).zip(sums)
        };
        self.blocks.iter().flat_map(of_block).filter(move |(column, _)| (first..=last).contains(column))
    }

    /// The greatest sum of ticks above rest in each of `bins` stretches of `step` us, the first of which begins at `start` (us), of
    /// columns `column_us` wide.
    #[must_use]
    pub fn greatest_sums(&self, start: i64, step: i64, bins: usize, column_us: i64) -> Vec<u32> {
        // At the beginning of a stretch the force is what it was before, also where nothing is stored.
        let begin = |bin: usize| start + i64::try_from(bin).unwrap_or(0) * step;
        let mut sums: Vec<u32> = (0..bins).map(|bin| self.curve(column_of(begin(bin), column_us)).sum.1).collect();
        for (column, most) in self.stored() {
            let bin = (column * column_us - start).div_euclid(step);
            if let Some(sum) = usize::try_from(bin).ok().and_then(|bin| sums.get_mut(bin)) {
                *sum = (*sum).max(most);
            }
        }
        sums
    }

    /// The column of greatest force in the first touch; `None` where there is no force.
    #[must_use]
    pub fn first_touch(&self) -> Option<i64> {
        let mut sums: Vec<u32> = self.stored().map(|(_, sum)| sum).collect();
        let most = *sums.iter().max()?;
        let rank = sums.len() / QUIET_SHARE;
        let (_, &mut quiet, _) = sums.select_nth_unstable(rank);
        let least = quiet + ((most - quiet) / TOUCH_SHARE).max(1);
        let touch = self.stored().skip_while(|&(_, sum)| sum < least).take_while(|&(_, sum)| sum >= least);
        let greatest = |found: Option<(i64, u32)>, (column, sum): (i64, u32)| match found {
            Some((_, most)) if sum <= most => found,
            _ => Some((column, sum)),
        };
        touch.take(BLOCK.unsigned_abs() as usize).fold(None, greatest).map(|(column, _)| column)
    }

    /// Adds the raster of columns to `out`, which has one byte per row; counts stay at 15.
    pub fn add_raster(&self, columns: Range<i64>, out: &mut [u8]) {
        let from = self.blocks.partition_point(|(key, _)| (key + 1) * BLOCK <= columns.start);
        for (key, block) in self.blocks.range(from..).take_while(|(key, _)| key * BLOCK < columns.end) {
            let within = |column: i64| usize::try_from((column - key * BLOCK).clamp(0, BLOCK)).unwrap_or(0);
            let rows = self.shape.rows;
            let cells = &block.raster[within(columns.start) * rows..within(columns.end) * rows];
            for (n, cell) in cells.iter().enumerate().filter(|(_, cell)| **cell > 0) {
                let sum = &mut out[n % rows];
                let (ups, downs) = ((*sum & 15) + (cell & 15), (*sum >> 4) + (cell >> 4));
                *sum = ups.min(15) | downs.min(15) << 4;
            }
        }
    }
}

/// The curve while nothing is pressed.
pub const NOTHING: Curve = Curve { sum: 0, area: 0, x: f32::NAN, y: f32::NAN };

/// The curve of a frame in which no taxel has a value.
pub const MISSING: Curve = Curve { area: u32::MAX, ..NOTHING };
