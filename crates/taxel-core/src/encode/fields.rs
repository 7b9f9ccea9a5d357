//! Receptive fields: the input of each afferent is the weighted mean of the taxels in its field.
//!
//! A field's channels are consecutive within a row of the array, so a field is a few short windows of channels. The
//! channels of a group of afferents are read first and weighted together. Sums run from a field's first channel to its
//! last, whatever the vector width, and channels that pad a window have weight 0, so all machines compute the same
//! sums.

use std::ops::Range;

use super::blocks::{BLOCK, Block, blocks};
use crate::vectors::{Instructions, OnLine, ROW, WIDE, Windows, by_width};

/// Number of channels in a window of a small field: padding channels need not be loaded for every sample.
const NARROW: usize = 2;

/// The fields of afferents, in blocks of afferents.
///
/// Within a block the afferents with the most windows come first, so that few rows of windows contain them all.
#[derive(Clone)]
pub(super) struct Fields {
    /// The afferent in each lane.
    afferents: Vec<u32>,
    /// Index of the first row of each block's windows, and at the end the number of rows.
    rows: Vec<usize>,
    /// The group of lanes of each row; groups are numbered within a block.
    groups: Vec<usize>,
    /// One window per lane in each row.
    windows: Windows,
    /// The weights of these windows' channels: for each row the first channel of each window, then the second, and so
    /// on.
    weights: Vec<OnLine<[f32; ROW]>>,
    /// Offset of each row's weights, and at the end their number; a row has [`NARROW`] weights per lane if no window
    /// has more.
    weighed: Vec<usize>,
    /// The range of channel blocks on which each block of afferents depends: start and exclusive end.
    feels: Vec<[usize; 2]>,
}

impl Fields {
    /// Builds fields from channels in ascending order with their weights; the array has `channels` channels.
    pub(super) fn new(fields: &[Vec<(u32, f32)>], channels: usize) -> Self {
        let last = (blocks(channels) * BLOCK).saturating_sub(WIDE);
        let (windows, weights, feels) = (Windows::default(), vec![], vec![]);
        let (afferents, rows, groups, weighed) = (vec![], vec![0], vec![], vec![0]);
        let mut new = Self { afferents, rows, groups, windows, weights, weighed, feels };
        for (block, fields) in fields.chunks(BLOCK).enumerate() {
            let mut cut: Vec<(usize, Vec<Window>)> = fields.iter().map(|field| cut(field, last)).enumerate().collect();
            cut.sort_by_key(|(_, windows)| std::cmp::Reverse(windows.len()));
            new.afferents.extend(cut.iter().map(|(lane, _)| (block * BLOCK + lane) as u32));
            // Successive rows belong to different groups, so that no sum waits for the previous one.
            for row in 0..cut[0].1.len() {
                for (number, group) in cut.chunks(ROW).enumerate().filter(|(_, group)| row < group[0].1.len()) {
                    let (mut starts, mut weights) = ([0; ROW], [[0.0; ROW]; WIDE]);
                    for (lane, (_, windows)) in group.iter().enumerate() {
                        if let Some((start, window)) = windows.get(row) {
                            starts[lane] = *start;
                            (0..WIDE).for_each(|k| weights[k][lane] = window[k]);
                        }
                    }
                    new.groups.push(number);
                    new.windows.push(starts);
                    let wide = weights[NARROW..].as_flattened().iter().any(|&weight| weight != 0.0);
                    new.weights
                        .extend(weights[..if wide { WIDE } else { NARROW }].iter().map(|&weights| OnLine(weights)));
                    new.weighed.push(new.weights.len());
                }
            }
            new.rows.push(new.groups.len());
            let felt = || fields.iter().flatten().map(|&(channel, _)| channel as usize / BLOCK);
            new.feels.push([felt().min().unwrap_or(0), felt().max().map_or(0, |last| last + 1)]);
        }
        new
    }

    /// The afferent in a lane; lanes are numbered across all blocks.
    pub(super) fn afferent(&self, lane: usize) -> u32 {
        self.afferents[lane]
    }

    /// Whether the input of a block of afferents depends on any of the channel blocks that `changed`.
    #[inline(always)]
    pub(super) fn any(&self, block: usize, changed: &[bool]) -> bool {
        let [from, to] = self.feels[block];
        changed[from..to].contains(&true)
    }

    /// The inputs of a block of afferents for these pressures, by lane.
    pub(super) fn inputs_of_block(&self, block: usize, held: &[Block]) -> Block {
        #[inline(always)]
        fn by(fields: &Fields, block: usize, read: impl Fn(usize) -> [[f32; ROW]; WIDE]) -> Block {
            let mut felt = OnLine([[0.0; ROW]; BLOCK / ROW]);
            for row in fields.rows_of(block) {
                let (read, weights) = (read(row), &fields.weights[fields.weights_of(row)]);
                let felt = &mut felt.0[fields.groups[row]];
                if let Some(weights) = weights.first_chunk::<WIDE>() {
                    *felt = add(*felt, &read, weights);
                } else if let Some(weights) = weights.first_chunk::<NARROW>() {
                    *felt = add(*felt, &read, weights);
                }
            }
            let mut all = [0.0; BLOCK];
            all.copy_from_slice(felt.0.as_flattened());
            all
        }
        let (fields, held) = (self, held.as_flattened());
        by_width!(
            Instructions::best(), (fields: &Fields, block: usize, held: &[f32]) -> Block, [],
            |fields, block, held| by(fields, block, |row| fields.windows.read_avx512(row, held)),
            |fields, block, held| by(fields, block, |row| fields.windows.read_avx2(row, held)),
            |fields, block, held| by(fields, block, |row| fields.windows.read(row, held))
        )
    }

    /// The rows of a block's windows.
    #[inline(always)]
    fn rows_of(&self, block: usize) -> Range<usize> {
        self.rows[block]..self.rows[block + 1]
    }

    /// The weights of a row.
    #[inline(always)]
    fn weights_of(&self, row: usize) -> Range<usize> {
        self.weighed[row]..self.weighed[row + 1]
    }

    /// The lanes of the afferents whose fields contain a channel, with the channel's weight in each.
    pub(super) fn lanes_of_channel(&self, channel: usize) -> impl Iterator<Item = (usize, f32)> {
        let near = move |block: &usize| (self.feels[*block][0]..self.feels[*block][1]).contains(&(channel / BLOCK));
        (0..self.feels.len()).filter(near).flat_map(|block| block * BLOCK..(block + 1) * BLOCK).filter_map(
            move |lane| {
                let weight_in = |row: usize| {
                    let at = channel.wrapping_sub(self.windows.starts(row)[lane % ROW] as usize);
                    self.weights[self.weights_of(row)].get(at).map_or(0.0, |weights| weights.0[lane % ROW])
                };
                let is_in_group = |row: &usize| self.groups[*row] == lane % BLOCK / ROW;
                let weight: f32 = self.rows_of(lane / BLOCK).filter(is_in_group).map(weight_in).sum();
                (weight != 0.0).then_some((lane, weight))
            },
        )
    }
}

/// Adds the weighted values of channels to the sums.
#[inline(always)]
fn add<const N: usize>(
    mut sum: [f32; ROW],
    read: &[[f32; ROW]; WIDE],
    weights: &[OnLine<[f32; ROW]>; N],
) -> [f32; ROW] {
    for k in 0..N {
        for lane in 0..ROW {
            sum[lane] += read[k][lane] * weights[k].0[lane];
        }
    }
    sum
}

/// A window's first channel, and the weights of its channels.
type Window = (u32, [f32; WIDE]);

/// Cuts a field into windows, none of which begins after `last`.
fn cut(field: &[(u32, f32)], last: usize) -> Vec<Window> {
    let mut windows: Vec<Window> = vec![];
    let mut end = 0;
    for &(channel, weight) in field {
        if channel >= end {
            windows.push((channel.min(last as u32), [0.0; WIDE]));
            end = channel + WIDE as u32;
        }
        if let Some((start, weights)) = windows.last_mut() {
            weights[(channel - *start) as usize] = weight;
        }
    }
    windows
}

#[cfg(test)]
mod tests {
    use rand::rngs::StdRng;
    use rand::{Rng, SeedableRng};

    use super::*;

    #[test]
    fn afferents_feel_the_sum_of_their_channels_from_the_first_to_the_last() {
        let mut rng = StdRng::seed_from_u64(3);
        for _ in 0..300 {
            let channels = rng.random_range(1..400);
            // Fields of one channel up to all of them, in runs or scattered, some at the very end of the array.
            let (share, longest) = (rng.random_range(0.01..1.0), rng.random_range(1..60));
            let fields: Vec<Vec<(u32, f32)>> = (0..rng.random_range(1..200))
                .map(|_| {
                    let from = rng.random_range(0..channels);
                    let to = (from + longest).min(channels);
                    let mut field: Vec<(u32, f32)> = (from..to)
                        .filter(|_| rng.random_bool(share))
                        .map(|channel| (channel as u32, 10_f32.powf(-2.0 * share as f32 * (channel % 7) as f32)))
                        .collect();
                    if field.is_empty() {
                        field.push((from as u32, 1.0));
                    }
                    field
                })
                .collect();
            let mut held = vec![[0.0; BLOCK]; blocks(channels)];
            for held in &mut held.as_flattened_mut()[..channels] {
                *held = rng.random_range(-10.0..150.0) * 10_f32.powi(rng.random_range(-3..4));
            }
            let new = Fields::new(&fields, channels);
            for (block, block_fields) in fields.chunks(BLOCK).enumerate() {
                let felt = new.inputs_of_block(block, &held);
                for (lane, felt) in felt[..block_fields.len()].iter().enumerate() {
                    let field = &fields[new.afferent(block * BLOCK + lane) as usize];
                    let weighed = |&(channel, weight): &(u32, f32)| held.as_flattened()[channel as usize] * weight;
                    let wanted = field.iter().map(weighed).fold(0.0, |sum, weighed| sum + weighed);
                    assert_eq!(felt.to_bits(), f32::to_bits(wanted), "{field:?}");
                }
                assert!(felt[block_fields.len()..].iter().all(|&felt| felt == 0.0));
                for changed in 0..held.len() {
                    let felt =
                        new.any(block, &std::array::from_fn::<bool, 7, _>(|other| other == changed)[..held.len()]);
                    let needed = block_fields.iter().flatten().any(|&(channel, _)| channel as usize / BLOCK == changed);
                    assert!(felt || !needed);
                }
            }
            for channel in 0..channels {
                let weight_on = |(afferent, field): (usize, &Vec<(u32, f32)>)| {
                    field.iter().find(|felt| felt.0 as usize == channel).map(|felt| (afferent, felt.1))
                };
                let wanted: Vec<(usize, f32)> = fields.iter().enumerate().filter_map(weight_on).collect();
                let mut feeling: Vec<(usize, f32)> =
                    new.lanes_of_channel(channel).map(|(lane, weight)| (new.afferent(lane) as usize, weight)).collect();
                feeling.sort_by_key(|&(afferent, _)| afferent);
                assert_eq!(feeling, wanted);
            }
        }
    }
}
