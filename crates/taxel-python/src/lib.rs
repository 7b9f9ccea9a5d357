//! Python bindings of taxel: conversion, releasing the GIL, errors, and nothing else.

mod convert;
mod enter;
mod errors;
mod held;
mod instructions;
#[cfg(feature = "test-hooks")]
mod test_hooks;
mod thread_state;
mod threaded;

mod bridge;
mod calibration;
mod circuit;
mod cone_x;
mod described;
mod detect;
mod encode;
mod learn;
mod live;
mod metrics;
mod neuron;
mod nouns;
mod panel;
mod parameters;
mod pictures;
mod recording;
mod rivals;
mod simulate;
mod wire;
mod wire_v2;

use pyo3::prelude::*;

/// The compiled part of taxel; import `taxel` instead.
#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    errors::register(module)?;
    instructions::register(module)?;
    #[cfg(feature = "test-hooks")]
    test_hooks::register(module)?;
    nouns::register(module)?;
    bridge::register(module)?;
    calibration::register(module)?;
    circuit::register(module)?;
    cone_x::register(module)?;
    detect::register(module)?;
    encode::register(module)?;
    live::register(module)?;
    metrics::register(module)?;
    held::register(module)?;
    learn::register(module)?;
    neuron::register(module)?;
    described::register(module)?;
    panel::register(module)?;
    pictures::register(module)?;
    recording::register(module)?;
    rivals::register(module)?;
    simulate::register(module)?;
    wire::register(module)?;
    wire_v2::register(module)?;
    Ok(())
}
