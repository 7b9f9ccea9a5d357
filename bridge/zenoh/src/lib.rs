//! Sends datagrams to other computers and receives them, over Zenoh.
//!
//! The bridge transports taxel's parcels unchanged. It reads one field of their format, the base time, so that tests
//! can offset the clock of this computer. Endpoints are explicit: no multicast, no gossip, no discovery.

mod keys;
mod publisher;
mod session;
mod skew;
mod subscriber;

use pyo3::prelude::*;

#[pymodule]
fn taxel_zenoh(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<publisher::Publisher>()?;
    module.add_class::<subscriber::Subscriber>()
}
