//! Presets of the registers: those built in, and those of the user.

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};
use taxel_core::Array;
use taxel_core::wire::Registers;
use taxel_core::wire::registers::{PRESETS, Preset};

use crate::handler::{PresetValue, UserPreset};

/// The built-in presets that a board of this array can hold; all of them without a board.
pub(crate) fn fitting(held: &Registers, array: Option<&Array>) -> Vec<&'static Preset> {
    let Some(array) = array else { return PRESETS.iter().collect() };
    let fits = |preset: &&Preset| held.with_preset(&preset.registers, array).check(array).is_ok();
    Registers::presets(array, held.channels).filter(fits).collect()
}

/// Name of the built-in preset that equals these registers, whatever the version of the wire.
pub(crate) fn built_in_equal_to(held: &Registers, array: Option<&Array>) -> Option<String> {
    let equals = |preset: &&Preset| match array {
        Some(array) => held.with_preset(&preset.registers, array) == *held,
        None => preset.registers == *held,
    };
    fitting(held, array).into_iter().find(equals).map(|preset| preset.name.to_owned())
}

/// Name of the user's preset that equals these registers.
pub(crate) fn equal_to(held: &Registers, presets: &BTreeMap<String, UserPreset>) -> Option<String> {
    let values = json!(held);
    presets.iter().find(|(_, preset)| json!(preset) == values).map(|(name, _)| name.clone())
}

/// The registers of a user's preset.
///
/// # Errors
///
/// Why the preset, which may have been edited by hand, holds no registers.
pub(crate) fn to_registers(preset: &UserPreset) -> Result<Registers, String> {
    serde_json::from_value(json!(preset)).map_err(|error| error.to_string())
}

/// A preset of these registers.
pub(crate) fn from_registers(registers: &Registers) -> UserPreset {
    let held = match json!(registers) {
        Value::Object(held) => held,
        _ => Map::new(),
    };
    let value = |value: Value| match value {
        Value::Bool(flag) => PresetValue::Flag(flag),
        value => value.as_i64().map_or_else(|| PresetValue::Other(value.to_string()), PresetValue::Number),
    };
    held.into_iter().map(|(name, held)| (name, value(held))).collect()
}
