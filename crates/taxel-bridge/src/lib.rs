//! Datagrams to and from other computers, over Zenoh.
//!
//! Carries what taxel packs, as it is. It knows nothing of it but where a parcel's base time stands, so that trials can set
//! the clock of this computer off. Explicit endpoints, no multicast, no gossip: nobody is looked for.

mod keys;
mod publisher;
mod session;
mod skew;
mod subscriber;

use pyo3::prelude::*;

#[pymodule]
fn taxel_bridge(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<publisher::Publisher>()?;
    module.add_class::<subscriber::Subscriber>()
}
