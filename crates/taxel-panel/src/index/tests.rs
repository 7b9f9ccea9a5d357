//! The latest of a live source can be viewed at any time; a taxel's values over hours are those of all of its changes.

use rand::{Rng, SeedableRng, rngs::StdRng};
use taxel_core::Array;
use taxel_core::held::UNKNOWN;

use super::*;
use crate::events::tests::held_at;
use crate::player::{Player, ViewOptions};

const MINUTE_US: i64 = 60_000_000;

fn changes(changes: &[TaxelChange]) -> Block {
    Block { changes: Arc::new(changes.to_vec()), ..Block::default() }
}

fn change(t: i64, taxel: u32, ticks: u16) -> TaxelChange {
    TaxelChange { t, taxel, ticks, up: true, repaired: false }
}

#[test]
fn a_minute_is_stored_and_a_view_of_the_past_equals_what_was_decoded() {
    let sensor = Arc::new(Sensor::new(Array::thesis(), 3, None));
    let taxels = sensor.array.len();
    let empty = || Index::new(Arc::clone(&sensor), Kept::Latest { us: MINUTE_US, bytes: 512 << 20 });
    let index = empty();
    index.push(Some(Keyframe::blank(taxels)), Block::default()).unwrap();
    assert_eq!(index.range(), None);
    index.push(None, changes(&[change(5, 0, 50)])).unwrap();
    index.push(None, changes(&[change(9, 0, 51)])).unwrap();
    assert_eq!(index.range(), Some((5, 9)));
    let index = Arc::new(empty());
    let (mut held, mut all, mut random) = (vec![UNKNOWN; taxels], vec![], StdRng::seed_from_u64(9));
    for n in 0..900_i64 {
        let block: Vec<TaxelChange> = (0..40)
            .map(|k| change(n * 100_000 + k * 2000, random.random_range(0..4096), random.random_range(20..140)))
            .collect();
        let latest = all.last().map(|change: &TaxelChange| change.t);
        let blank = Keyframe::blank(taxels);
        let key = Keyframe { latest, events: all.len() as u64, held: held.clone(), ..blank };
        index.push(Some(key), changes(&block)).unwrap();
        for change in block {
            held[change.taxel as usize] = change.ticks;
            all.push(change);
        }
    }
    let (first, last) = index.range().unwrap();
    assert!((MINUTE_US..MINUTE_US + 1_000_000).contains(&(last - first)), "{} us", last - first);
    for _ in 0..20 {
        let t = random.random_range(first + 6_000_000..=last);
        let player = Player::open(&index, t, &ViewOptions::plain(COLUMN_US), None).unwrap();
        assert_eq!(player.state.held(), held_at(&all, t, taxels).0, "at {t} us");
    }
    assert!(index.store().bytes < 16 << 20);
    // Whoever read up to a block that is forgotten goes on with the values held after the gap.
    let block = index.next(&mut 3).unwrap().unwrap();
    assert_eq!(block.held.unwrap(), {
        let (held, events) = held_at(&all, first, taxels);
        (held, events)
    });
}

/// The taxel whose history is shown.
const WATCHED: u32 = 5;

/// Its least, greatest and last value in these columns, computed from all changes up to `t`.
fn drawn(changes: &[TaxelChange], columns: std::ops::Range<i64>, us: i64, t: i64) -> Vec<u16> {
    let own: Vec<_> = changes.iter().filter(|change| change.taxel == WATCHED && change.t <= t).collect();
    let until = |column: i64| own.partition_point(|change| change.t < column * us);
    let mut values = vec![];
    for column in columns {
        // At its beginning a column has what was held before it.
        let within = &own[until(column).saturating_sub(1)..until(column + 1)];
        let ticks = || within.iter().map(|change| change.ticks);
        values.extend([ticks().min(), ticks().max(), ticks().next_back()].map(|value| value.unwrap_or(UNKNOWN)));
    }
    values
}

#[test]
fn a_window_of_hours_has_the_least_and_the_greatest_of_a_taxel_at_each_width() {
    let mut random = StdRng::seed_from_u64(25);
    let sensor = Sensor::new(Array::new(8, 8, 1.0, "small").unwrap(), 3, None);
    let mut t = 0;
    let all: Vec<TaxelChange> = (0..3_000_000)
        .map(|k| {
            // Three hours, now and then a minute without events. What is watched changes in one stretch of ten alone.
            t += if random.random_range(0..100_000) == 0 { MINUTE_US } else { random.random_range(0..7000) };
            let quiet = k / 150_000 % 10 != 0;
            let taxel =
                (0..).find_map(|_| Some(random.random_range(0..64)).filter(|&taxel| taxel != WATCHED || !quiet));
            change(t, taxel.unwrap(), random.random_range(20..140))
        })
        .collect();
    for memory in [1 << 20, u64::MAX] {
        let kept = Kept::All { memory, folder: std::env::temp_dir() };
        let sensor = Sensor::new(sensor.array.clone(), 3, None);
        let mut indexing = Indexing::new(sensor, &Keyframe::blank(64), kept);
        all.chunks(CHANGES).for_each(|block| indexing.push(changes(block)).unwrap());
        let index = Arc::new(indexing.finish());
        for us in [125 << 17, 125 << 14, COLUMN_US, 125] {
            for at in [t, t / 2, random.random_range(0..t)] {
                let options = ViewOptions { watched: Some(WATCHED), ..ViewOptions::plain(us) };
                let mut player = Player::open(&index, at - 3 * us, &options, None).unwrap();
                player.advance(at).unwrap();
                let first = (column_of(at, us) + 1 - crate::columns::SPAN).max(column_of(all[0].t, us));
                let mut bytes = vec![];
                player.history.as_ref().unwrap().write(first..column_of(at, us) + 1, &mut bytes);
                let shown: Vec<u16> = bytes.chunks(2).map(|two| u16::from_le_bytes([two[0], two[1]])).collect();
                let expected = drawn(&all, first..column_of(at, us) + 1, us, at);
                assert!(shown == expected, "{us} us a column, at {at} us, {memory} bytes");
            }
        }
    }
}
