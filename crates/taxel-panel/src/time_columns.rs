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

/// Maximum number of channels that each have a curve.
const MOST_CHANNELS: usize = 64;

/// What is stored of a source: its sum, and the bits of the coordinates of its centre.
pub(super) const OF_SOURCE: usize = 3;

/// A touch exceeds the quiet force by this part of the greatest excess: one in so many.
const TOUCH_SHARE: u32 = 4;
/// The force of one column in so many, the least ones, is that of a sensor at rest.
const QUIET_SHARE: usize = 5;

/// The contact as a whole at the end of a column of time.
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

impl Curve {
    /// What is stored of a source with this curve; [`MISSING_SUM`] everywhere, which is no number, for one without values.
    pub(super) fn of_source(self) -> [u32; OF_SOURCE] {
        let missing = self.area == MISSING.area;
        if missing { [MISSING_SUM; OF_SOURCE] } else { [self.sum, self.x.to_bits(), self.y.to_bits()] }
    }
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

#[derive(Debug, Clone)]
struct ColumnBlock {
    raster: Vec<u8>,
    curves: Vec<Curve>,
    values: Vec<u32>,
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

    /// Number of values that have a curve of their own.
    fn values(self) -> usize {
        self.channels + OF_SOURCE * self.sources
    }

    fn block_bytes(self) -> usize {
        let curves = std::mem::size_of::<Curve>() + self.values() * std::mem::size_of::<u32>();
        BLOCK.unsigned_abs() as usize * (self.rows + curves)
    }
}

impl ColumnBlock {
    /// Repeats the values of its column `k`, so many, up to its end.
    fn repeat_values(&mut self, k: usize, count: usize) {
        for later in k + 1..BLOCK.unsigned_abs() as usize {
            self.values.copy_within(k * count..(k + 1) * count, later * count);
        }
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
    /// Up to this sum of ticks above rest there is noise alone, and no centre; of each of several sources.
    noise: u32,
    source_noise: Vec<u32>,
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
            noise: 0,
            source_noise: vec![],
        }
    }

    /// The same with a curve for each of so many sources; nothing may be stored yet.
    #[must_use]
    pub(super) fn with_sources(mut self, sources: usize) -> Self {
        debug_assert!(self.blocks.is_empty());
        self.shape.sources = sources;
        self
    }

    /// The same with these sums as the most that noise adds up to, of each source.
    #[must_use]
    pub(super) fn with_noise(mut self, each: Vec<u32>) -> Self {
        self.noise = each.iter().fold(0, |sum, &noise| sum.saturating_add(noise));
        self.source_noise = each;
        self
    }

    /// The most that noise adds up to, ticks above rest.
    #[must_use]
    pub fn noise(&self) -> u32 {
        self.noise
    }

    /// The most that noise of each source adds up to, ticks above rest.
    #[must_use]
    pub fn source_noise(&self) -> &[u32] {
        &self.source_noise
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

    /// Number of channels that have a curve each; 0 of any other sensor.
    #[must_use]
    pub fn channel_count(&self) -> usize {
        self.shape.channels
    }

    /// Number of values that have a curve each: of channels, and then the sum and the centre of each source if there are several.
    #[must_use]
    pub fn value_count(&self) -> usize {
        self.shape.values()
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
        let (key, rows, count) = (column.div_euclid(BLOCK), self.shape.rows, self.shape.values());
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
                let before = index.checked_sub(1).map(|before| &self.blocks[before].1);
                let curve = before.map_or(NOTHING, |before| before.curves[n - 1]);
                let values = before.map_or_else(|| vec![0; count], |b| b.values[(n - 1) * count..].to_vec());
                let block = ColumnBlock { raster: vec![0; n * rows], curves: vec![curve; n], values: values.repeat(n) };
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
            let curve = block.curves[k];
            block.curves[k + 1..].fill(curve);
            block.repeat_values(k, self.shape.values());
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

    /// Sets the curve from this column to the end of its block.
    pub(super) fn set_curve(&mut self, column: i64, curve: Curve) {
        let before = self.curve(column);
        let same = before.sum == curve.sum
            && before.area == curve.area
            && before.x.to_bits() == curve.x.to_bits()
            && before.y.to_bits() == curve.y.to_bits();
        // A stretch without events repeats the curve before it, so it needs no block.
        if !same {
            let (block, k) = self.block(column);
            block.curves[k..].fill(curve);
        }
    }

    /// Sets the values that have a curve each, from this column to the end of its block: ticks above rest of the channels,
    /// and what is stored of the sources ([`Curve::of_source`]).
    pub(super) fn set_values(&mut self, column: i64, values: &[u32]) {
        let count = self.shape.values();
        if values.len() == count && self.values_at(column).is_none_or(|before| before != values) {
            let (block, k) = self.block(column);
            block.values[k * count..(k + 1) * count].copy_from_slice(values);
            block.repeat_values(k, count);
        }
    }

    /// The values at the end of a column; `None` before the first block.
    fn values_at(&self, column: i64) -> Option<&[u32]> {
        let (key, n, count) = (column.div_euclid(BLOCK), BLOCK.unsigned_abs() as usize, self.shape.values());
        let (index, k) = match self.block_index(key) {
            Ok(index) => (index, column.rem_euclid(BLOCK).unsigned_abs() as usize),
            Err(index) => (index.checked_sub(1)?, n - 1),
        };
        Some(&self.blocks[index].1.values[k * count..(k + 1) * count])
    }

    /// Raises the values in `out` to the greatest of each in columns, and the sources to where the sum of each is greatest;
    /// any sum is greater than [`MISSING_SUM`].
    pub fn raise_values(&self, columns: Range<i64>, out: &mut [u32]) {
        let (channels, sources) = out.split_at_mut(self.shape.channels);
        for values in self.differing(columns).filter_map(|column| self.values_at(column)) {
            let (of_channels, of_sources) = values.split_at(self.shape.channels);
            channels.iter_mut().zip(of_channels).for_each(|(most, &value)| *most = value.max(*most));
            for (most, source) in sources.chunks_exact_mut(OF_SOURCE).zip(of_sources.chunks_exact(OF_SOURCE)) {
                // What is missing wraps to 0.
                if source[0].wrapping_add(1) > most[0].wrapping_add(1) {
                    most.copy_from_slice(source);
                }
            }
        }
    }

    /// The curves where the force is greatest in columns.
    #[must_use]
    pub fn greatest(&self, columns: Range<i64>) -> Curve {
        let greatest = |most: Curve, column| match self.curve(column) {
            curve if curve.sum > most.sum || most.area == MISSING.area => curve,
            _ => most,
        };
        let first = self.curve(columns.start);
        self.differing(columns).fold(first, greatest)
    }

    /// The first of columns, and those that a block stores: all others are as the one before.
    fn differing(&self, columns: Range<i64>) -> impl Iterator<Item = i64> {
        let Range { start, end } = columns;
        let from = self.blocks.partition_point(|(key, _)| (key + 1) * BLOCK <= start + 1);
        let stored = self.blocks.range(from..).map(|(key, _)| key * BLOCK).take_while(move |&first| first < end);
        (start..end.min(start + 1)).chain(stored.flat_map(move |first| first.max(start + 1)..end.min(first + BLOCK)))
    }

    /// The curves at the end of a column.
    #[must_use]
    pub fn curve(&self, column: i64) -> Curve {
        let (key, k) = (column.div_euclid(BLOCK), column.rem_euclid(BLOCK).unsigned_abs() as usize);
        match self.block_index(key) {
            Ok(index) => self.blocks[index].1.curves[k],
            Err(0) => NOTHING,
            Err(index) => self.blocks[index - 1].1.curves.last().copied().unwrap_or(NOTHING),
        }
    }

    /// The columns that are stored, each with its curves; a stretch without events is left out.
    fn stored(&self) -> impl Iterator<Item = (i64, &Curve)> {
        let (first, last) = self.reach.unwrap_or((0, -1));
        let all = self.blocks.iter().flat_map(|(key, block)| (key * BLOCK..).zip(&block.curves));
        all.filter(move |(column, _)| (first..=last).contains(column))
    }

    /// The greatest sum of ticks above rest in each of `bins` stretches of `step` us, the first of which begins at `start` (us), of
    /// columns `column_us` wide.
    #[must_use]
    pub fn greatest_sums(&self, start: i64, step: i64, bins: usize, column_us: i64) -> Vec<u32> {
        // At the beginning of a stretch the force is what it was before, also where nothing is stored.
        let begin = |bin: usize| start + i64::try_from(bin).unwrap_or(0) * step;
        let mut sums: Vec<u32> = (0..bins).map(|bin| self.curve(column_of(begin(bin), column_us)).sum).collect();
        for (column, curve) in self.stored() {
            let bin = (column * column_us - start).div_euclid(step);
            if let Some(sum) = usize::try_from(bin).ok().and_then(|bin| sums.get_mut(bin)) {
                *sum = (*sum).max(curve.sum);
            }
        }
        sums
    }

    /// The column of greatest force in the first touch; `None` where there is no force.
    #[must_use]
    pub fn first_touch(&self) -> Option<i64> {
        let mut sums: Vec<u32> = self.stored().map(|(_, curve)| curve.sum).collect();
        let most = *sums.iter().max()?;
        let rank = sums.len() / QUIET_SHARE;
        let (_, &mut quiet, _) = sums.select_nth_unstable(rank);
        let least = quiet + ((most - quiet) / TOUCH_SHARE).max(1);
        let touch =
            self.stored().skip_while(|(_, curve)| curve.sum < least).take_while(|(_, curve)| curve.sum >= least);
        let greatest = |found: Option<(i64, u32)>, (column, curve): (i64, &Curve)| match found {
            Some((_, sum)) if curve.sum <= sum => found,
            _ => Some((column, curve.sum)),
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

/// The sum of a source of which no taxel has a value.
pub const MISSING_SUM: u32 = u32::MAX;

/// The curve of a frame in which no taxel has a value.
pub const MISSING: Curve = Curve { area: u32::MAX, ..NOTHING };
