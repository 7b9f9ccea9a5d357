//! What a moment looks like: held values, what changed lately, the last seconds by column of time.
//!
//! The same for live events and for recordings: a lens that was begun earlier and one that was begun from a keyframe show
//! the same, as soon as [`FORGET`] columns of time have passed.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use crate::pipeline::{Change, UNKNOWN};

/// A column of time where nobody asked for another, us.
pub const COLUMN_US: i64 = 4000;

/// The narrowest and the widest column of time, us: each twice the one before.
pub const COLUMNS_US: (i64, i64) = (125, 256_000);

/// Columns of time that a picture shows: 5 s, of the narrowest 0.16 s, of the widest 320 s.
pub const SPAN: i64 = 1250;

/// How far behind the latest a change may come and be in raster and curves, us.
pub const LATE_US: i64 = 120_000;

/// After so many columns of [`COLUMN_US`] no change is seen any more: 127 less a sixteenth each time is 0.
pub const FORGET: i64 = 64;

/// What a change without a value counts.
const UNVALUED: i8 = 16;

/// Columns of time in a block of a [`Strip`].
const BLOCK: i64 = 250;

/// What all taxels do together at the end of a column of time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Curve {
    /// Ticks above rest.
    pub sum: u32,
    /// Taxels above rest.
    pub area: u32,
    /// Centre; NaN where nothing is pressed.
    pub x: f32,
    /// The same of rows.
    pub y: f32,
}

/// The column of time in which a moment lies, of columns of so many us.
#[must_use]
pub fn column_of(t: i64, column_us: i64) -> i64 {
    t.div_euclid(column_us)
}

/// Whether a column of time may have so many us.
#[must_use]
pub fn is_column(us: i64) -> bool {
    let (least, most) = COLUMNS_US;
    (least..=most).contains(&us) && us % least == 0 && (us / least).count_ones() == 1
}

#[derive(Debug, Clone)]
struct Block {
    raster: Vec<u8>,
    curves: Vec<Curve>,
}

/// Raster and curves by column of time; stretches in which nothing was heard cost nothing.
#[derive(Debug, Clone)]
pub struct Strip {
    rows: usize,
    /// Ascending by number; the newest is asked for nearly always.
    blocks: VecDeque<(i64, Block)>,
    /// The columns that are known: first and last.
    reach: Option<(i64, i64)>,
    /// Blocks kept at most.
    most: usize,
}

impl Strip {
    /// A strip of an array of so many rows that keeps so many bytes at most: the oldest go.
    #[must_use]
    pub fn new(rows: usize, bytes: usize) -> Self {
        let block = Self::block_bytes(rows);
        Self {
            rows,
            blocks: VecDeque::new(),
            reach: None,
            most: (bytes / block).max(SPAN.unsigned_abs() as usize / BLOCK.unsigned_abs() as usize + 2),
        }
    }

    /// Bytes in which so many columns of an array of so many rows find room.
    #[must_use]
    pub fn room(rows: usize, columns: i64) -> usize {
        (usize::try_from(columns / BLOCK).unwrap_or(0) + 2) * Self::block_bytes(rows)
    }

    /// Rows of the array.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Whether nothing happened in a column, nor near it.
    #[must_use]
    pub fn is_silent(&self, column: i64) -> bool {
        self.place(column.div_euclid(BLOCK)).is_err()
    }

    fn block_bytes(rows: usize) -> usize {
        BLOCK.unsigned_abs() as usize * (rows + std::mem::size_of::<Curve>())
    }

    /// First and last column that it knows.
    #[must_use]
    pub fn reach(&self) -> Option<(i64, i64)> {
        self.reach
    }

    /// Where a block stands, or would.
    fn place(&self, key: i64) -> Result<usize, usize> {
        match self.blocks.back() {
            Some(&(last, _)) if last == key => Ok(self.blocks.len() - 1),
            _ => self.blocks.binary_search_by_key(&key, |&(key, _)| key),
        }
    }

    fn block(&mut self, column: i64) -> (&mut Block, usize) {
        let (key, rows) = (column.div_euclid(BLOCK), self.rows);
        let place = match self.place(key) {
            Ok(place) => place,
            Err(mut place) => {
                if self.blocks.len() >= self.most
                    && let Some((oldest, _)) = self.blocks.pop_front()
                {
                    place = place.saturating_sub(1);
                    if let Some(reach) = &mut self.reach {
                        reach.0 = reach.0.max((oldest + 1) * BLOCK);
                    }
                }
                let n = BLOCK.unsigned_abs() as usize;
                let held = place.checked_sub(1).map_or(NOTHING, |before| self.blocks[before].1.curves[n - 1]);
                self.blocks.insert(place, (key, Block { raster: vec![0; n * rows], curves: vec![held; n] }));
                place
            }
        };
        (&mut self.blocks[place].1, column.rem_euclid(BLOCK).unsigned_abs() as usize)
    }

    /// Says that time has come into this column.
    fn come_to(&mut self, column: i64) {
        match &mut self.reach {
            None => self.reach = Some((column, column)),
            Some(reach) => reach.1 = reach.1.max(column),
        }
    }

    /// Forgets what comes after a column.
    fn cut(&mut self, column: i64) {
        let Some(reach) = self.reach.filter(|reach| reach.1 > column) else { return };
        self.reach = Some((reach.0.min(column), column));
        let key = column.div_euclid(BLOCK);
        self.blocks.truncate(self.blocks.partition_point(|&(there, _)| there <= key));
        if let Ok(place) = self.place(key) {
            let block = &mut self.blocks[place].1;
            let k = usize::try_from(column.rem_euclid(BLOCK)).unwrap_or(0);
            block.raster[(k + 1) * self.rows..].fill(0);
            let curve = block.curves[k];
            block.curves[k + 1..].fill(curve);
        }
    }

    /// Marks changes of a column: their rows, and whether they rose.
    fn mark(&mut self, column: i64, changes: impl Iterator<Item = (u16, bool)>) {
        if self.reach.is_some_and(|(first, _)| column < first) {
            return;
        }
        let rows = self.rows;
        let (block, k) = self.block(column);
        let cells = &mut block.raster[k * rows..(k + 1) * rows];
        for (row, up) in changes {
            let cell = &mut cells[usize::from(row)];
            let (ups, downs) = ((*cell & 15) + u8::from(up), (*cell >> 4) + u8::from(!up));
            *cell = ups.min(15) | downs.min(15) << 4;
        }
    }

    /// From this column on to the end of its block the curves are these.
    fn set_curve(&mut self, column: i64, curve: Curve) {
        let before = self.curve(column);
        let same = before.sum == curve.sum
            && before.x.to_bits() == curve.x.to_bits()
            && before.y.to_bits() == curve.y.to_bits();
        // A silent stretch takes what came before it.
        if !same {
            let (block, k) = self.block(column);
            block.curves[k..].fill(curve);
        }
    }

    /// The curves at the end of a column.
    #[must_use]
    pub fn curve(&self, column: i64) -> Curve {
        let (key, k) = (column.div_euclid(BLOCK), column.rem_euclid(BLOCK).unsigned_abs() as usize);
        match self.place(key) {
            Ok(place) => self.blocks[place].1.curves[k],
            Err(0) => NOTHING,
            Err(place) => self.blocks[place - 1].1.curves.last().copied().unwrap_or(NOTHING),
        }
    }

    /// Appends the raster of a column, a byte a row.
    pub fn raster(&self, column: i64, out: &mut Vec<u8>) {
        let (key, k) = (column.div_euclid(BLOCK), column.rem_euclid(BLOCK).unsigned_abs() as usize);
        match self.place(key).map(|place| &self.blocks[place].1) {
            Ok(block) => out.extend_from_slice(&block.raster[k * self.rows..(k + 1) * self.rows]),
            Err(_) => out.resize(out.len() + self.rows, 0),
        }
    }
}

/// Of nothing that is pressed.
pub const NOTHING: Curve = Curve { sum: 0, area: 0, x: f32::NAN, y: f32::NAN };

/// What a lens begins with.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Keyframe {
    /// The board's time come to, us; `None` before anything came.
    pub latest: Option<i64>,
    /// Events up to there.
    pub events: u64,
    /// What each taxel holds; [`UNKNOWN`] where it was never heard of.
    pub held: Vec<u16>,
    /// What each taxel reads at rest.
    pub rest: Vec<u16>,
}

/// See the module.
#[derive(Debug, Clone)]
pub struct Lens {
    /// Column and row of each taxel: a division a change would take most of its time.
    at: Arc<[(u16, u16)]>,
    floor: u16,
    held: Vec<u16>,
    rest: Vec<u16>,
    /// Whether the rest is the lowest so far; else it was set.
    lowest: bool,
    /// Taxels whose rest was set one by one: no lower value moves it.
    zeroed: BTreeSet<usize>,
    /// How often the rest has changed.
    rests: u64,
    change: Vec<i8>,
    strip: Strip,
    column_us: i64,
    /// The column that is not over.
    column: Option<i64>,
    /// Of [`COLUMN_US`]: what changes fade by.
    fades: i64,
    /// From where to where a moment is in both, us.
    within: std::ops::Range<i64>,
    latest: Option<i64>,
    /// How often time was set back, or the board was reset.
    restarts: u64,
    events: u64,
    sum: u64,
    sum_x: u64,
    sum_y: u64,
    area: u32,
}

impl Lens {
    /// A lens on an array of so many columns that begins with a keyframe; its columns of time have `column_us`.
    #[must_use]
    pub fn new(columns: u16, floor: u16, from: &Keyframe, column_us: i64, strip_bytes: usize) -> Self {
        let columns = usize::from(columns).max(1);
        // An array has 65 535 rows and columns at most.
        #[allow(clippy::cast_possible_truncation)]
        let at = |taxel: usize| ((taxel % columns) as u16, (taxel / columns) as u16);
        let mut lens = Self {
            at: (0..from.held.len()).map(at).collect(),
            floor,
            held: from.held.clone(),
            rest: from.rest.clone(),
            lowest: true,
            zeroed: BTreeSet::new(),
            rests: 1,
            change: vec![0; from.held.len()],
            strip: Strip::new(from.held.len() / columns, strip_bytes),
            column_us,
            column: None,
            fades: 0,
            within: 0..0,
            latest: from.latest,
            restarts: 0,
            events: from.events,
            sum: 0,
            sum_x: 0,
            sum_y: 0,
            area: 0,
        };
        lens.reckon();
        if let Some(t) = from.latest {
            lens.advance(t);
        }
        lens
    }

    /// A keyframe of now.
    #[must_use]
    pub fn keyframe(&self) -> Keyframe {
        Keyframe { latest: self.latest, events: self.events, held: self.held.clone(), rest: self.rest.clone() }
    }

    /// Sums anew.
    fn reckon(&mut self) {
        (self.sum, self.sum_x, self.sum_y, self.area) = (0, 0, 0, 0);
        for taxel in 0..self.held.len() {
            self.weigh(taxel, 0, self.above(taxel));
        }
    }

    /// Ticks above rest, 0 up to the noise floor.
    fn above(&self, taxel: usize) -> u16 {
        let (held, rest) = (self.held[taxel], self.rest[taxel]);
        let above = held.saturating_sub(rest);
        // No branch: which taxels are pressed nobody can foresee.
        if (held != UNKNOWN) & (rest != UNKNOWN) & (above > self.floor) { above } else { 0 }
    }

    /// A taxel is so many ticks above rest that was so many before.
    fn weigh(&mut self, taxel: usize, before: u16, now: u16) {
        let (x, y) = self.at[taxel];
        // A fall is a large number: the sums come out right, modulo 2^64.
        let moved = u64::from(now).wrapping_sub(before.into());
        self.sum = self.sum.wrapping_add(moved);
        self.sum_x = self.sum_x.wrapping_add(moved.wrapping_mul(x.into()));
        self.sum_y = self.sum_y.wrapping_add(moved.wrapping_mul(y.into()));
        self.area = self.area + u32::from(now > 0) - u32::from(before > 0);
    }

    #[allow(clippy::cast_possible_truncation, clippy::cast_precision_loss)]
    fn curve(&self) -> Curve {
        if self.sum == 0 {
            return NOTHING;
        }
        let (x, y) = (self.sum_x as f64 / self.sum as f64, self.sum_y as f64 / self.sum as f64);
        Curve { sum: self.sum.min(u64::from(u32::MAX)) as u32, area: self.area, x: x as f32, y: y as f32 }
    }

    /// Takes changes, in their order; those of one moment together, as most of the work is the moment's.
    pub fn take_all(&mut self, changes: &[Change]) {
        for together in changes.chunk_by(|one, next| one.t == next.t) {
            let t = together[0].t;
            self.advance(t);
            self.events += together.len() as u64;
            together.iter().for_each(|change| self.press(change));
            let column = match self.column {
                Some(column) if self.within.contains(&t) => column,
                _ => column_of(t, self.column_us),
            };
            self.strip.mark(column, together.iter().map(|change| (self.at[change.taxel as usize].1, change.up)));
        }
    }

    /// Takes one, as no view does.
    #[cfg(test)]
    pub fn take(&mut self, change: &Change) {
        self.take_all(std::slice::from_ref(change));
    }

    /// What a change changes of its taxel.
    #[inline]
    fn press(&mut self, change: &Change) {
        let taxel = change.taxel as usize;
        if change.ticks == UNKNOWN {
            let size = if change.up { UNVALUED } else { -UNVALUED };
            self.change[taxel] = self.change[taxel].saturating_add(size).max(-127);
            return;
        }
        let before = self.held[taxel];
        // What is heard for the first time has not changed.
        let moved = if before == UNKNOWN { 0 } else { i32::from(change.ticks) - i32::from(before) };
        #[allow(clippy::cast_possible_truncation)]
        let size = moved.clamp(-127, 127) as i8;
        let largest = self.change[taxel];
        self.change[taxel] = if size.unsigned_abs() >= largest.unsigned_abs() { size } else { largest };
        let above = self.above(taxel);
        self.held[taxel] = change.ticks;
        if (self.rest[taxel] == UNKNOWN || self.lowest && change.ticks < self.rest[taxel])
            && !self.zeroed.contains(&taxel)
        {
            self.rest[taxel] = change.ticks;
            self.rests += 1;
        }
        self.weigh(taxel, above, self.above(taxel));
    }

    /// Moves time on; back does nothing.
    pub fn advance(&mut self, t: i64) {
        if self.latest.is_some_and(|latest| t < latest) {
            return;
        }
        self.latest = Some(t);
        if self.within.contains(&t) {
            return;
        }
        let (column, fades) = (column_of(t, self.column_us), column_of(t, COLUMN_US));
        match self.column {
            None => self.fades = fades,
            Some(now) if now == column => {}
            Some(now) => {
                let curve = self.curve();
                self.strip.set_curve(now, curve);
                if column > now + 1 {
                    self.strip.set_curve(now + 1, curve);
                }
            }
        }
        for _ in 0..(fades - self.fades).min(FORGET) {
            for change in &mut self.change {
                // Towards 0, so that 1 becomes 0.
                #[allow(clippy::cast_possible_truncation)]
                {
                    *change = (i16::from(*change) * 15 / 16) as i8;
                }
            }
        }
        self.come_to(column, fades);
    }

    fn come_to(&mut self, column: i64, fades: i64) {
        (self.column, self.fades) = (Some(column), fades);
        let begin = (column * self.column_us).max(fades * COLUMN_US);
        self.within = begin..((column + 1) * self.column_us).min((fades + 1) * COLUMN_US);
        self.strip.come_to(column);
    }

    /// Sets time back where it had been moved on, as in a silence that was none; forward does nothing.
    pub fn set_back(&mut self, t: i64) {
        if self.latest.is_none_or(|latest| latest <= t) {
            return;
        }
        self.latest = Some(t);
        let column = column_of(t, self.column_us);
        self.strip.cut(column);
        self.come_to(column, column_of(t, COLUMN_US));
        self.restarts += 1;
    }

    /// The board was reset: its taxels hold nothing until they are heard again.
    pub fn forget(&mut self) {
        self.held.fill(UNKNOWN);
        self.reckon();
        self.restarts += 1;
    }

    /// How often time was set back, or the board was reset.
    #[must_use]
    pub fn restarts(&self) -> u64 {
        self.restarts
    }

    /// Events were missing: what the taxels hold now.
    pub fn hold(&mut self, held: &[u16], events: u64) {
        self.held.copy_from_slice(held);
        self.events = events;
        for (taxel, (rest, &held)) in self.rest.iter_mut().zip(held).enumerate() {
            let lower = *rest == UNKNOWN || self.lowest && held < *rest;
            if held != UNKNOWN && lower && !self.zeroed.contains(&taxel) {
                *rest = held;
                self.rests += 1;
            }
        }
        self.reckon();
    }

    /// A taxel rests at `rest` from here on, until the rest of all is set.
    pub fn zero(&mut self, taxel: usize, rest: u16) {
        let above = self.above(taxel);
        self.rest[taxel] = rest;
        self.zeroed.insert(taxel);
        self.rests += 1;
        self.weigh(taxel, above, self.above(taxel));
    }

    /// What is held now is the rest from here on.
    pub fn rest_now(&mut self) {
        self.zeroed.clear();
        self.rest.copy_from_slice(&self.held);
        (self.lowest, self.rests) = (false, self.rests + 1);
        self.reckon();
    }

    /// The rest is the lowest from here on.
    pub fn rest_lowest(&mut self) {
        self.zeroed.clear();
        self.rest.copy_from_slice(&self.held);
        (self.lowest, self.rests) = (true, self.rests + 1);
        self.reckon();
    }

    /// Takes rest and noise floor from another lens on the same source, where they differ.
    pub fn rest_as(&mut self, other: &Self) {
        if self.floor != other.floor || self.rest != other.rest {
            self.floor = other.floor;
            self.rest.copy_from_slice(&other.rest);
            self.reckon();
        }
        self.lowest = other.lowest;
        self.zeroed.clone_from(&other.zeroed);
    }

    /// Changes up to the noise floor are none.
    pub fn set_floor(&mut self, floor: u16) {
        self.floor = floor;
        self.reckon();
    }

    /// What the taxels hold.
    #[must_use]
    pub fn held(&self) -> &[u16] {
        &self.held
    }

    /// What they read at rest.
    #[must_use]
    pub fn rest(&self) -> &[u16] {
        &self.rest
    }

    /// How often the rest has changed.
    #[must_use]
    pub fn rests(&self) -> u64 {
        self.rests
    }

    /// The largest changes lately.
    #[must_use]
    pub fn change(&self) -> &[i8] {
        &self.change
    }

    /// The board's time come to, us.
    #[must_use]
    pub fn latest(&self) -> Option<i64> {
        self.latest
    }

    /// Events up to now.
    #[must_use]
    pub fn events(&self) -> u64 {
        self.events
    }

    /// Gives the column that is not over the curves of now.
    pub fn settle(&mut self) {
        if let Some(now) = self.column {
            let curve = self.curve();
            self.strip.set_curve(now, curve);
        }
    }

    /// Raster and curves, as they were settled last.
    #[must_use]
    pub fn strip(&self) -> &Strip {
        &self.strip
    }
}

/// The watched taxel's least, greatest and last value in each column of time.
#[derive(Debug, Clone)]
pub struct History {
    /// Its index.
    pub taxel: u32,
    column_us: i64,
    /// What it held when it began to be watched, and in which column that was; nothing is known before.
    first: (i64, u16),
    last: u16,
    columns: VecDeque<(i64, [u16; 3])>,
}

impl History {
    /// Begins to watch a taxel that holds this value at this time (us; `None`: before anything came), by columns of so many us.
    #[must_use]
    pub fn new(taxel: u32, held: u16, since: Option<i64>, column_us: i64) -> Self {
        let first = since.map_or(i64::MIN, |t| column_of(t, column_us));
        Self { taxel, column_us, first: (first, held), last: held, columns: VecDeque::new() }
    }

    /// Takes a change, of any taxel.
    pub fn take(&mut self, change: &Change) {
        if change.taxel != self.taxel || change.ticks == UNKNOWN {
            return;
        }
        let column = column_of(change.t, self.column_us);
        let before = self.last;
        self.last = change.ticks;
        match self.columns.back_mut() {
            Some((there, [least, greatest, last])) if *there >= column => {
                (*least, *greatest, *last) = ((*least).min(change.ticks), (*greatest).max(change.ticks), change.ticks);
            }
            _ => {
                let (least, greatest) = if before == UNKNOWN {
                    (change.ticks, change.ticks)
                } else {
                    (before.min(change.ticks), before.max(change.ticks))
                };
                self.columns.push_back((column, [least, greatest, change.ticks]));
            }
        }
        while self.columns.len() > 1 && self.columns[1].0 <= column - SPAN {
            if let Some((gone, [_, _, last])) = self.columns.pop_front() {
                self.first = (gone, last);
            }
        }
    }

    /// Appends least, greatest and last of these columns; [`UNKNOWN`] where it was not watched yet.
    pub fn write(&self, columns: std::ops::Range<i64>, out: &mut Vec<u8>) {
        let mut place = self.columns.partition_point(|(column, _)| *column < columns.start);
        let (since, held) = self.first;
        let mut last = if place == 0 { held } else { self.columns[place - 1].1[2] };
        for column in columns {
            if column < since {
                out.extend_from_slice(&[0xFF; 6]);
                continue;
            }
            let three = match self.columns.get(place) {
                Some((there, three)) if *there == column => {
                    place += 1;
                    *three
                }
                _ => [last; 3],
            };
            last = three[2];
            three.iter().for_each(|value| out.extend_from_slice(&value.to_le_bytes()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blank(taxels: usize) -> Keyframe {
        Keyframe { latest: None, events: 0, held: vec![UNKNOWN; taxels], rest: vec![UNKNOWN; taxels] }
    }

    fn change(t: i64, taxel: u32, ticks: u16) -> Change {
        Change { t, taxel, ticks, up: true, repaired: false }
    }

    #[test]
    fn a_lens_from_a_keyframe_shows_what_one_from_the_beginning_shows() {
        [COLUMN_US, 500].into_iter().for_each(from_a_keyframe);
    }

    fn from_a_keyframe(us: i64) {
        use rand::{Rng, SeedableRng, rngs::StdRng};
        let mut random = StdRng::seed_from_u64(18);
        let (taxels, mut t) = (12, 0_i64);
        let mut changes = vec![];
        for _ in 0..5000 {
            // Pauses of an hour too.
            t += match random.random_range(0..500) {
                0 => 3_600_000_000,
                // Of one moment.
                1..200 => 0,
                _ => random.random_range(0..5000),
            };
            // Some come late.
            let back = if random.random_range(0..9) == 0 { random.random_range(0..9000) } else { 0 };
            changes.push(change(t - back, random.random_range(0..taxels), random.random_range(0..300)));
        }
        let mut whole = Lens::new(4, 3, &blank(taxels as usize), us, 1 << 20);
        let mut keyframes = vec![];
        for (k, one) in changes.iter().enumerate() {
            if k % 100 == 0 {
                keyframes.push((k, whole.keyframe()));
            }
            whole.take(one);
        }
        for (k, keyframe) in keyframes {
            let mut fresh = Lens::new(4, 3, &keyframe, us, 1 << 20);
            fresh.take_all(&changes[k..]);
            assert_eq!(fresh.held(), whole.held());
            assert_eq!(fresh.rest(), whole.rest());
            assert_eq!((fresh.events(), fresh.latest()), (whole.events(), whole.latest()));
            let begun = keyframe.latest.map_or(0, |t| column_of(t, us));
            let now = column_of(whole.latest().unwrap(), us);
            if (now - begun) * us > FORGET * COLUMN_US {
                assert_eq!(fresh.change(), whole.change());
            }
            fresh.settle();
            whole.settle();
            let (one, other) = (fresh.strip(), whole.strip());
            for column in (begun + 30).max(now - SPAN)..=now {
                let (mut a, mut b) = (vec![], vec![]);
                one.raster(column, &mut a);
                other.raster(column, &mut b);
                assert_eq!(a, b, "column {column}");
                assert_eq!(format!("{:?}", one.curve(column)), format!("{:?}", other.curve(column)), "column {column}");
            }
        }
    }

    #[test]
    fn above_rest_is_more_than_the_floor_and_its_centre_is_known() {
        let mut lens = Lens::new(2, 3, &blank(4), COLUMN_US, 1 << 20);
        for taxel in 0..4 {
            lens.take(&change(0, taxel, 48));
        }
        lens.take(&change(100, 0, 51));
        lens.settle();
        assert_eq!(lens.strip().curve(0).sum, 0, "the floor is no touch");
        lens.take(&change(200, 0, 58));
        lens.take(&change(300, 3, 78));
        lens.settle();
        let curve = lens.strip().curve(0);
        assert_eq!((curve.sum, curve.area, curve.x, curve.y), (40, 2, 0.75, 0.75));
        assert_eq!(lens.change(), [7, 0, 0, 30], "the larger of two changes, 3 and 7");
        lens.rest_now();
        lens.settle();
        assert_eq!(lens.strip().curve(0).sum, 0);
        lens.advance(FORGET * COLUMN_US);
        assert_eq!(lens.change(), [0; 4]);
    }

    #[test]
    fn a_zeroed_taxel_keeps_its_rest_until_the_rest_of_all_is_set() {
        let mut lens = Lens::new(2, 3, &blank(4), COLUMN_US, 1 << 20);
        for (t, ticks) in [(0, 40), (100, 60)] {
            (0..4).for_each(|taxel| lens.take(&change(t, taxel, ticks)));
        }
        lens.zero(1, 60);
        lens.settle();
        assert_eq!((lens.strip().curve(0).sum, lens.strip().curve(0).area), (60, 3));
        lens.take(&change(200, 1, 30));
        lens.take(&change(200, 0, 30));
        assert_eq!(lens.rest(), [30, 60, 40, 40]);
        lens.take(&change(300, 1, 80));
        lens.settle();
        assert_eq!(lens.strip().curve(0).sum, 60);
        lens.rest_lowest();
        lens.take(&change(400, 1, 20));
        assert_eq!(lens.rest()[1], 20);
    }

    #[test]
    fn time_set_back_forgets_what_silence_had_brought_and_goes_on() {
        let mut once = Lens::new(2, 3, &blank(4), COLUMN_US, 1 << 20);
        let mut stalled = once.clone();
        for t in [0, 40_000] {
            once.take(&change(t, 1, 60));
            stalled.take(&change(t, 1, 60));
        }
        stalled.advance(9_000_000);
        stalled.set_back(40_000);
        stalled.set_back(50_000);
        for t in [80_000, 81_000] {
            once.take(&change(t, 2, 70));
            stalled.take(&change(t, 2, 70));
        }
        once.settle();
        stalled.settle();
        assert_eq!(stalled.restarts(), 1);
        assert_eq!(stalled.strip().reach(), once.strip().reach());
        for column in 0..=column_of(81_000, COLUMN_US) {
            let (mut a, mut b) = (vec![], vec![]);
            once.strip().raster(column, &mut a);
            stalled.strip().raster(column, &mut b);
            assert_eq!(a, b, "column {column}");
            let curves = [once.strip().curve(column), stalled.strip().curve(column)];
            assert_eq!(format!("{:?}", curves[0]), format!("{:?}", curves[1]), "column {column}");
        }
    }

    #[test]
    fn a_history_has_every_extreme_and_goes_on_through_silence() {
        let mut history = History::new(1, 40, Some(-4000), COLUMN_US);
        for (t, ticks) in [(0, 50), (1000, 20), (2000, 45), (12_000, 60)] {
            history.take(&change(t, 1, ticks));
            history.take(&change(t, 0, 999));
        }
        let mut bytes = vec![];
        history.write(-2..5, &mut bytes);
        let values: Vec<u16> = bytes.chunks(2).map(|b| u16::from_le_bytes([b[0], b[1]])).collect();
        let expected =
            [[UNKNOWN; 3], [40, 40, 40], [20, 50, 45], [45, 45, 45], [45, 45, 45], [45, 60, 60], [60, 60, 60]];
        assert_eq!(values, expected.concat());
    }
}
