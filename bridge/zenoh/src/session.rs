//! A Zenoh session: explicit endpoints over TCP, no discovery.

use std::fmt::Write as _;

use pyo3::exceptions::{PyConnectionError, PyValueError};
use pyo3::prelude::*;
use zenoh::{Config, Session, Wait};

/// Lease of a link, ms: it is closed after this time without any message; keep-alives are sent four times within it.
const LEASE_MS: u64 = 1500;

/// A subscriber that reads nothing while messages must not be lost is disconnected after this, us.
const PATIENCE_US: u64 = 1_500_000;

/// Interval between attempts to connect, ms: the first, and the longest.
const RETRY_MS: (u64, u64) = (200, 1000);

/// Largest message, bytes: a longer one is dropped before it is buffered.
const LONGEST: usize = 1 << 20;

/// Opens a session that listens on and connects to these endpoints; connecting is retried.
pub(crate) fn open(listen: &[String], connect: &[String]) -> PyResult<Session> {
    let config = Config::from_json5(&config(listen, connect)?).map_err(|e| PyValueError::new_err(e.to_string()))?;
    zenoh::open(config).wait().map_err(|e| PyConnectionError::new_err(first_line(&e)))
}

/// The first line of an error, without the source file that its library names.
pub(crate) fn first_line(error: &zenoh::Error) -> String {
    let text = error.to_string();
    let line = text.lines().next().unwrap_or_default();
    line.split(" at /").next().unwrap_or(line).to_owned()
}

fn config(listen: &[String], connect: &[String]) -> PyResult<String> {
    let mut config =
        String::from("{ mode: \"peer\", scouting: { multicast: { enabled: false }, gossip: { enabled: false } },");
    let (listen, connect) = (places(listen)?, places(connect)?);
    let (first, most) = RETRY_MS;
    let written = write!(
        config,
        "listen: {{ endpoints: [{listen}], exit_on_failure: true, timeout_ms: 0 }}, \
         connect: {{ endpoints: [{connect}], exit_on_failure: false, timeout_ms: -1, \
         retry: {{ period_init_ms: {first}, period_max_ms: {most}, period_increase_factor: 1.5 }} }}, \
         transport: {{ link: {{ tx: {{ lease: {LEASE_MS}, keep_alive: 4, \
         queue: {{ congestion_control: {{ block: {{ wait_before_close: {PATIENCE_US} }} }} }} }}, \
         rx: {{ max_message_size: {LONGEST} }} }} }} }}"
    );
    written.map(|()| config).map_err(|e| PyValueError::new_err(e.to_string()))
}

/// Formats endpoints in Zenoh's syntax.
fn places(places: &[String]) -> PyResult<String> {
    let mut quoted = vec![];
    for place in places {
        // Characters that could end the surrounding JSON text are refused.
        if !place.chars().all(|c| c.is_ascii_alphanumeric() || "-_.:[]%".contains(c)) || !place.contains(':') {
            return Err(PyValueError::new_err(format!("{place:?}: must be HOST:PORT")));
        }
        quoted.push(format!("\"tcp/{place}\""));
    }
    Ok(quoted.join(", "))
}
