//! The options of a pipeline, which Python declares with their defaults.

use std::net::SocketAddr;

use serde_json::json;
use taxel_core::Array;
use taxel_core::detect::{Detector, Readout};
use taxel_core::wire::Registers;
use taxel_live::pipeline::LiveOptions;

/// The default options to receive a board of this array at an address.
pub fn options(array: &Array, address: SocketAddr) -> LiveOptions {
    let all = json!({
        "host": address.ip(), "port": address.port(), "array": array, "registers": Registers::default(),
        "differences": false, "record_later": false, "name": "board", "sources": [], "compression": "none",
        "overwrite": false, "guard_frames": null, "lines": false, "send": [],
    });
    serde_json::from_value(all).expect("every option has a value")
}

/// A readout as the options state it.
pub fn stated(readout: &Readout) -> Option<String> {
    Some(Detector::from(readout.clone()).to_json())
}
