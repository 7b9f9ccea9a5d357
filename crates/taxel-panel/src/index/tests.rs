//! The latest of a live source can be viewed at any time.

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
