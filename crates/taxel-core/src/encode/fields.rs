//! Receptive fields: what afferents feel of an array, each the weighed mean of the taxels in its field.
//!
//! Row by row of the array a field's channels follow each other, so a field is a few short windows of channels. Those of
//! a block of afferents are read first; what each weighs is then reckoned for all of them at once. Sums run from a
//! field's first channel to its last whatever the vectors, as what fills a window up weighs 0: all machines feel the same.

use super::sampled::{BLOCK, Block, blocks};
use crate::vectors::Windows;

/// Channels that are read at once.
const WIDE: usize = 4;

/// The fields of afferents, a block of them at a time.
#[derive(Clone)]
pub(super) struct Fields {
    /// Where the rows of a block's windows begin in what follows, and where the last block's end.
    rows: Vec<usize>,
    /// A window an afferent in each row.
    windows: Windows<WIDE, BLOCK>,
    /// What the channels of these windows weigh.
    weights: Vec<[Block; WIDE]>,
    /// The blocks of channels that each block of afferents feels, from one to before another.
    feels: Vec<[usize; 2]>,
}

impl Fields {
    /// Fields of channels with their weights, in ascending order; of `channels` channels in all.
    pub(super) fn new(fields: &[Vec<(u32, f32)>], channels: usize) -> Self {
        let last = (blocks(channels) * BLOCK).saturating_sub(WIDE);
        let mut new = Self { rows: vec![0], windows: Windows::default(), weights: vec![], feels: vec![] };
        for block in fields.chunks(BLOCK) {
            let windows: Vec<Vec<(u32, [f32; WIDE])>> = block.iter().map(|field| cut(field, last)).collect();
            for row in 0..windows.iter().map(Vec::len).max().unwrap_or(0) {
                let (mut starts, mut weights) = ([0; BLOCK], [[0.0; BLOCK]; WIDE]);
                for (lane, windows) in windows.iter().enumerate() {
                    if let Some((start, own)) = windows.get(row) {
                        starts[lane] = *start;
                        (0..WIDE).for_each(|k| weights[k][lane] = own[k]);
                    }
                }
                new.windows.push(starts);
                new.weights.push(weights);
            }
            new.rows.push(new.weights.len());
            let felt = || block.iter().flatten().map(|&(channel, _)| channel as usize / BLOCK);
            new.feels.push([felt().min().unwrap_or(0), felt().max().map_or(0, |last| last + 1)]);
        }
        new
    }

    /// Whether a block of afferents feels any of the blocks of channels that `changed`.
    #[inline(always)]
    pub(super) fn any(&self, block: usize, changed: &[bool]) -> bool {
        let [from, to] = self.feels[block];
        changed[from..to].contains(&true)
    }

    /// What a block of afferents feels of these pressures.
    #[inline(always)]
    pub(super) fn feel(&self, block: usize, held: &[Block]) -> Block {
        let mut felt = [0.0; BLOCK];
        for row in self.rows[block]..self.rows[block + 1] {
            let (read, weights) = (self.windows.read(row, held.as_flattened()), &self.weights[row]);
            for lane in 0..BLOCK {
                for k in 0..WIDE {
                    felt[lane] += read[lane][k] * weights[k][lane];
                }
            }
        }
        felt
    }

    /// The afferents that feel a channel, with what it weighs to each.
    pub(super) fn feeling(&self, channel: usize) -> impl Iterator<Item = (usize, f32)> {
        let near = move |block: &usize| (self.feels[*block][0]..self.feels[*block][1]).contains(&(channel / BLOCK));
        (0..self.feels.len()).filter(near).flat_map(|block| block * BLOCK..(block + 1) * BLOCK).filter_map(
            move |afferent| {
                let (block, lane) = (afferent / BLOCK, afferent % BLOCK);
                let of = |row: usize| {
                    let at = channel.wrapping_sub(self.windows.starts(row)[lane] as usize);
                    self.weights[row].get(at).map_or(0.0, |weights| weights[lane])
                };
                let weight: f32 = (self.rows[block]..self.rows[block + 1]).map(of).sum();
                (weight != 0.0).then_some((afferent, weight))
            },
        )
    }
}

/// Cuts a field into windows, none of which begins behind `last`.
fn cut(field: &[(u32, f32)], last: usize) -> Vec<(u32, [f32; WIDE])> {
    let mut windows: Vec<(u32, [f32; WIDE])> = vec![];
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
            // From one channel to all of them, in runs or scattered, some at the array's very end.
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
            for (block, own) in fields.chunks(BLOCK).enumerate() {
                let felt = new.feel(block, &held);
                for (lane, field) in own.iter().enumerate() {
                    let weighed = |&(channel, weight): &(u32, f32)| held.as_flattened()[channel as usize] * weight;
                    let wanted = field.iter().map(weighed).fold(0.0, |sum, weighed| sum + weighed);
                    assert_eq!(felt[lane].to_bits(), f32::to_bits(wanted), "{field:?}");
                }
                assert!(felt[own.len()..].iter().all(|&felt| felt == 0.0));
                for changed in 0..held.len() {
                    let said =
                        new.any(block, &std::array::from_fn::<bool, 7, _>(|other| other == changed)[..held.len()]);
                    let needed = own.iter().flatten().any(|&(channel, _)| channel as usize / BLOCK == changed);
                    assert!(said || !needed);
                }
            }
            for channel in 0..channels {
                let of = |(afferent, field): (usize, &Vec<(u32, f32)>)| {
                    field.iter().find(|felt| felt.0 as usize == channel).map(|felt| (afferent, felt.1))
                };
                let wanted: Vec<(usize, f32)> = fields.iter().enumerate().filter_map(of).collect();
                assert_eq!(new.feeling(channel).collect::<Vec<_>>(), wanted);
            }
        }
    }
}
