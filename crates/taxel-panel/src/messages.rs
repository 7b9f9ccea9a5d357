//! Parts of the protocol's JSON messages that several requests use: docs/panel-protocol.md, *From the server*.

use serde_json::{Map, Value, json};
use taxel_core::Array;
use taxel_core::encode::Zeroing;
use taxel_live::pipeline::{Counters, OutputDetection};
use taxel_live::recording::now_ns;

use super::keyframe_index::KeyframeIndex;
use super::live_source::LiveSource;

/// Maximum number of detections of a recording in a message.
pub(super) const MOST_DETECTIONS: usize = 10_000;

/// A sensor.
pub(super) fn array(array: &Array) -> Value {
    let digit = |&exists: &bool| if exists { '1' } else { '0' };
    let exists = array.exists.as_ref().map(|all| all.iter().map(digit).collect::<String>());
    // Pitch and places are as in files.
    let mut sensor = json!(Array { exists: None, ..array.clone() });
    sensor["exists"] = json!(exists);
    sensor
}

/// A taxel that was zeroed.
pub(super) fn zeroing(zeroing: &Zeroing) -> Value {
    let Zeroing { t, x, y, rest, before } = zeroing;
    json!({ "taxel": [x, y], "t_us": t, "rest": rest, "before": before })
}

/// `detection`.
pub(super) fn detection(output: &OutputDetection) -> Value {
    let OutputDetection { detection, output_us, .. } = output;
    json!({
        "type": "detection", "label": detection.label, "t_us": detection.t, "known_us": detection.known, "said_us": output_us,
        "latency_us": output_us - detection.known, "slope_mv_per_ms": detection.slope,
    })
}

/// `warning`.
pub(super) fn warning(text: impl std::fmt::Display) -> Value {
    json!({ "type": "warning", "text": text.to_string() })
}

/// `counters` of a live source; rates are those of the last `seconds`, since the counters `before`.
#[allow(clippy::cast_precision_loss)]
pub(super) fn counters(
    live: &LiveSource,
    now: &Counters,
    before: Option<&Counters>,
    seconds: f64,
    frame_us: Option<f64>,
    clients: usize,
) -> Map<String, Value> {
    let rate = |now: u64, before: Option<u64>| before.map(|before| now.saturating_sub(before) as f64 / seconds);
    let damaged = now.decoding.wire.skipped
        + now.decoding.wire_v2.checksum
        + now.decoding.wire_v2.short
        + now.decoding.wire_v2.foreign;
    let message = json!({
        "type": "counters",
        "at_ns": now_ns(),
        "seconds": now.seconds,
        "board_us": now.board.board_us,
        "events": now.decoding.events,
        "events_per_s": rate(now.decoding.events, before.map(|b| b.decoding.events)),
        "bytes_per_s": rate(now.capture.bytes, before.map(|b| b.capture.bytes)),
        "datagrams_per_s": rate(now.capture.datagrams, before.map(|b| b.capture.datagrams)),
        "frames_per_s": frame_us.map(|frame_us| 1e6 / frame_us),
        "arrival": now.arrival(now_ns()),
        "pace": now.board.pace,
        "lost": {
            "kernel": now.capture.dropped_by_kernel,
            "queue": now.capture.dropped_by_queue,
            "wire": now.decoding.wire_v2.missing,
            "damaged": damaged,
            "outside": now.decoding.wire.outside + now.decoding.wire_v2.outside,
            "readout": now.readout.events_dropped,
            "panel": live.missing(),
        },
        "queue": now.capture.waiting,
        "latency": { "decode": now.decode_latency, "said": now.output_latency },
        "wire_version": now.decoding.wire_version,
        "marked_start": now.board.marked_start,
        "taring": now.readout.taring,
        "detections": now.readout.detections,
        "reach_us": live.index.range(),
        "reach_bytes": live.index.bytes(),
        "viewers": clients,
        "ended": live.handle.is_over(),
    });
    match message {
        Value::Object(message) => message,
        _ => Map::new(),
    }
}
