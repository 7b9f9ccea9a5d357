//! The parameters that the source of a rule publishes.

use serde_json::{Map, Value};

use taxel_core::Result;
use taxel_core::allowed::Parameter;

/// The parameters that the source of a rule publishes, and how they are combined.
pub struct Source {
    /// The name of the rule.
    pub(super) name: &'static str,
    /// The parameters that are the rule's own.
    pub(super) of_rule: &'static [&'static str],
    /// Their ranges.
    pub(super) ranges: &'static [&'static [Parameter]],
    /// The published defaults; a parameter without a default here or among those of all rules is required.
    pub(super) defaults: fn() -> Value,
    /// Computes parameters that are left out; may name `constants` (the rule's kind with its own) and `current` itself.
    pub(super) arrange: fn(&mut Map<String, Value>) -> Result<()>,
}
