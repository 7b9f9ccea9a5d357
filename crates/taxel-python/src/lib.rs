//! Python bindings of taxel: conversion, releasing the GIL, errors, and nothing else.

#![allow(clippy::too_many_arguments, reason = "Python names them")]

mod held;
#[cfg(feature = "test-hooks")]
mod test_hooks;
mod thread_state;
mod threaded;

mod circuit;
mod cone_x;
mod described;
mod detect;
mod device;
mod encode;
mod learn;
mod live;
mod metrics;
mod neuron;
mod nouns;
mod panel;
mod recording;
mod simulate;
mod wire;
mod wire_v2;

/// The compiled part of taxel; import `taxel` instead.
#[pyo3::pymodule]
mod _core {
    use pyo3::prelude::*;
    use pyo3::types::PyTuple;
    use taxel_core::held::UNKNOWN;
    use taxel_core::rest::{FORCE_UNITS, LOADED_TICKS, NOISE_FLOOR, TIMES_NOISE};
    use taxel_live::capture::FIREWALL;
    use taxel_live::serial_line::BAUDS;

    #[pymodule_export]
    use crate::circuit::{
        Converted, adaptive_convert, circuit_volts, circuit_volts_alone, converter_ramp, converter_ticks,
        converter_trace, fabric,
    };
    #[pymodule_export]
    use crate::cone_x::{ConeXCertificate, ConeXFitOut, ConeXProblem};
    #[pymodule_export]
    use crate::described::{check_parameters, parameters};
    #[pymodule_export]
    use crate::detect::{
        LoadCurve, ReadoutStream, Tally, check_detections, check_plain_rule, check_readout, follow_rest, frame_ends,
        is_plain_rule, make_plain_rule, make_readout, pairs, readout_run_events, readout_run_frames, score, spread,
    };
    #[pymodule_export]
    use crate::device::{SerialLine, line_place, now_ns, serial_ports, status_line};
    #[pymodule_export]
    use crate::encode::{
        EncoderStream, check_encoder, check_tare, encode, encoder_about, encoder_names, local_load_quantities,
        local_load_values, take_tare,
    };
    #[pymodule_export]
    use crate::held::{
        HeldValues, PyTrackedRest, above_rest, changes_of_frames, held_as_events, preload, touched_above,
        touches_of_events, touches_of_frames,
    };
    #[pymodule_export]
    use crate::learn::{ConeRFitOut, ConeRProblem, OnlineConeR};
    #[pymodule_export]
    use crate::live::{Ended, Live, send};
    #[pymodule_export]
    use crate::metrics::{distance, match_spikes, metric_names, pairwise};
    #[pymodule_export]
    use crate::neuron::{neuron_potential, neuron_run};
    #[pymodule_export]
    use crate::nouns::{check_events, check_spikes, split_by_sign};
    #[pymodule_export]
    use crate::panel::{PanelLive, PanelRecording, PanelView, panel_limits};
    #[pymodule_export]
    use crate::recording::{
        DecodedDatagrams, RecordingReader, RecordingWriter, Remarks, causes, clock_doubt, clock_lines,
        recording_damage, recording_verdict, verdict_text, whole_frames,
    };
    #[pymodule_export]
    use crate::simulate::{Layer, Played, check_scene, draw_scene, emulate, motion, pattern_values, play, truth};
    #[cfg(feature = "test-hooks")]
    #[pymodule_export]
    use crate::test_hooks::test_hook;
    #[pymodule_export]
    use crate::wire::{
        WireBoard, WireDecoder, command_bytes, command_read, registers_at_reset, registers_commands, registers_fields,
        registers_of_file, registers_of_source, registers_of_words, registers_preset, registers_presets,
        registers_warnings, registers_with, registers_with_preset, registers_words, wire_cut, wire_encode, wire_rows,
    };
    #[pymodule_export]
    use crate::wire_v2::{DatagramStream, EncodedDatagrams, decode_datagrams, encode_datagrams, is_version_2};
    #[pymodule_export]
    use taxel_border::instructions::instructions;

    #[pymodule_init]
    fn begin(module: &Bound<'_, PyModule>) -> PyResult<()> {
        taxel_border::errors::register(module)?;
        taxel_border::instructions::cap()?;
        module.add("BAUDS", (*BAUDS.start(), *BAUDS.end()))?;
        module.add("FIREWALL", FIREWALL)?;
        module.add("UNKNOWN", UNKNOWN)?;
        module.add("FORCE_UNITS", PyTuple::new(module.py(), FORCE_UNITS)?)?;
        module.add("TIMES_NOISE", TIMES_NOISE)?;
        module.add("NOISE_FLOOR", NOISE_FLOOR)?;
        module.add("LOADED_TICKS", LOADED_TICKS)
    }
}
