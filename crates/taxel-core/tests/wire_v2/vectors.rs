//! Tests the test vectors that all implementations share.

use taxel_core::wire::v2::Decoder;
use taxel_core::{Array, Events};

type Expected = (i64, u16, u16, bool, Option<u16>, bool);

#[derive(serde::Deserialize)]
struct Vector {
    rows: u16,
    columns: u16,
    events: Vec<Expected>,
    markers: Vec<(i64, bool)>,
    counts: std::collections::BTreeMap<String, u64>,
}

#[test]
fn a_vector_decodes_to_what_its_json_lists() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/wire_v2");
    let mut vectors = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "json") {
            continue;
        }
        let vector: Vector = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let bytes = std::fs::read(path.with_extension("bin")).unwrap();
        let array = Array::new(vector.rows, vector.columns, 1.0, "vector").unwrap();
        let mut decoder = Decoder::new(array.clone());
        let (mut events, mut at) = (Events::empty(array), 0);
        while at < bytes.len() {
            let end = at + 2 + usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]]));
            decoder.push(&bytes[at + 2..end], None, &mut events);
            at = end;
        }
        let ticks = |k: usize| events.intensity.as_ref().and_then(|i| i.present[k].then_some(i.ticks[k]));
        let heard: Vec<Expected> = (0..events.len())
            .map(|k| (events.t[k], events.x[k], events.y[k], events.p[k], ticks(k), events.is_repaired(k)))
            .collect();
        for (k, (a, b)) in heard.iter().zip(&vector.events).enumerate() {
            assert_eq!(a, b, "{path:?}, event {k}");
        }
        assert_eq!(heard.len(), vector.events.len(), "{path:?}");
        let markers: Vec<_> = events.markers.iter().map(|m| (m.t, m.start)).collect();
        assert_eq!(markers, vector.markers, "{path:?}");
        let counts = serde_json::to_value(decoder.counts()).unwrap();
        for (name, count) in &vector.counts {
            assert_eq!(counts[name], *count, "{path:?}, {name}");
        }
        vectors += 1;
    }
    assert!(vectors >= 12, "{vectors} vectors");
}
