//! The parameters that the source of a rule publishes.

use serde_json::{Map, Value};

use crate::Result;
use crate::allowed::Parameter;

/// The parameters that the source of a rule publishes, and how they are combined.
pub struct Source {
    /// By which the rule is called.
    pub(super) name: &'static str,
    /// The parameters that are the rule's own.
    pub(super) own: &'static [&'static str],
    /// Their ranges.
    pub(super) ranges: &'static [&'static [Parameter]],
    /// What the source gives; what stands neither here nor among what all rules share, the caller must give.
    pub(super) defaults: fn() -> Value,
    /// Works out what is left out; may name `law` and `current` itself.
    pub(super) arrange: fn(&mut Map<String, Value>) -> Result<()>,
}
