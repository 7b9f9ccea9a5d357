//! The shared vectors of the wire: every implementation must decode each file as its JSON file states.

use serde::Deserialize;
use taxel_core::vectors::Instructions;
use taxel_core::wire::{Counts, Decoder};
use taxel_core::{Array, Events};

type Row = (i64, u16, u16, bool, Option<u16>);

#[derive(Deserialize)]
struct Vector {
    columns: u16,
    rows: u16,
    differences: bool,
    /// Number of bytes, arrival time, and whether a datagram ends there.
    pieces: Vec<(usize, Option<i64>, bool)>,
    counts: Counts,
    markers: Vec<(i64, bool)>,
    events: Vec<Row>,
}

fn rows(events: &Events) -> Vec<Row> {
    let ticks = |k: usize| events.intensity.as_ref().and_then(|i| i.present[k].then_some(i.ticks[k]));
    (0..events.len()).map(|k| (events.t[k], events.x[k], events.y[k], events.p[k], ticks(k))).collect()
}

#[test]
fn a_vector_means_what_its_json_says() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/wire");
    let mut vectors = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "json") {
            continue;
        }
        let vector: Vector = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let bytes = std::fs::read(path.with_extension("bin")).unwrap();
        for set in Instructions::ALL.into_iter().filter(|set| set.present()) {
            let array = Array::new(vector.rows, vector.columns, 1.0, "vector").unwrap();
            let mut decoder = Decoder::new(array.clone()).differences(vector.differences).instructions(set).unwrap();
            let (mut events, mut at) = (Events::empty(array), 0);
            for &(length, arrived, end) in &vector.pieces {
                decoder.push(&bytes[at..at + length], arrived, &mut events);
                at += length;
                if end {
                    decoder.end_of_datagram(&mut events);
                }
            }
            decoder.finish(&mut events);
            let markers: Vec<_> = events.markers.iter().map(|m| (m.t, m.start)).collect();
            assert_eq!(rows(&events), vector.events, "{path:?}, {set:?}");
            assert_eq!(markers, vector.markers, "{path:?}, {set:?}");
            assert_eq!(decoder.counts(), &vector.counts, "{path:?}, {set:?}");
        }
        vectors += 1;
    }
    assert!(vectors >= 15, "{vectors} vectors");
}
