//! What is known of parameters, noun by noun, and their check: for the Python classes, whose defaults are read from here.

use pyo3::prelude::*;
use serde_json::{Value, json};
use taxel_core::circuit::{Adaptive, Chain, Converter, Divider, Fabric, VirtualGround};
use taxel_core::encode::{Encoder, RunningRange};
use taxel_core::learn::{ConeR, ConeX, OnlineConeR};
use taxel_core::metrics::{Metric, matching};
use taxel_core::neuron::Neuron;
use taxel_core::parameters::Described;

use crate::learn::to_online;
use taxel_border::errors::core;
use taxel_border::parameters::{Plain, checked, unknown};

/// What is known of a noun's parameters: defaults, what must be given, ranges.
#[pyfunction]
pub fn parameters(name: &str) -> PyResult<Plain<Value>> {
    described(name).map(|d| Plain(d.to_json())).ok_or_else(|| unknown(name))
}

fn described(name: &str) -> Option<Described> {
    match name {
        "neuron" => Some(Neuron::described()),
        "running_range" => Some(RunningRange::described()),
        "cone_x" => Some(ConeX::described()),
        "cone_r" => Some(ConeR::described()),
        "online_cone_r" => Some(OnlineConeR::described()),
        "matching" => Some(matching::described()),
        "fabric" => Some(Fabric::described()),
        "virtual_ground" => Some(VirtualGround::described()),
        "divider" => Some(Divider::described()),
        "converter" => Some(Converter::described()),
        "circuit" => Some(Chain::described()),
        "adaptive_ramp" => Some(Adaptive::described()),
        _ => Encoder::described(name).or_else(|| Metric::described(name)),
    }
}

/// Checks a noun's parameters, which are JSON; gives them back with every default filled in.
#[pyfunction]
pub fn check_parameters(name: &str, parameters: &str) -> PyResult<Plain<Value>> {
    match name {
        "neuron" => checked("neuron", parameters, Neuron::check),
        "running_range" => checked("running_range", parameters, RunningRange::check),
        "cone_x" => checked("ConeX", parameters, ConeX::check),
        "cone_r" => checked("ConeR", parameters, ConeR::check),
        "online_cone_r" => {
            let (cone, window) = to_online(parameters)?;
            OnlineConeR::new(&cone, window).map_err(core)?;
            Ok(json!(cone))
        }
        "fabric" => checked("Fabric", parameters, Fabric::check),
        "virtual_ground" => checked("VirtualGround", parameters, VirtualGround::check),
        "divider" => checked("Divider", parameters, Divider::check),
        "converter" => checked("Converter", parameters, Converter::check),
        "circuit" => checked("Circuit", parameters, Chain::check),
        "adaptive_ramp" => checked("AdaptiveRamp", parameters, Adaptive::check),
        _ if Encoder::described(name).is_some() => Ok(json!(Encoder::from_json(parameters).map_err(core)?)),
        _ => Err(unknown(name)),
    }
    .map(Plain)
}
