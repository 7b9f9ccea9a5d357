//! The panel's server.

mod requests;

use std::path::PathBuf;

use pyo3::prelude::*;
use taxel_live::address::of_host;
use taxel_panel::{Panel as Server, PanelOptions};

use crate::live::Live;
use crate::threaded::Threaded;
use requests::handlers;
use taxel_border::enter::enter;

/// The panel's server.
#[pyclass(frozen)]
pub struct Panel(Threaded<Server>);

#[pymethods]
impl Panel {
    /// Opens the port and begins to serve.
    #[new]
    fn start(
        py: Python<'_>,
        host: &str,
        port: u16,
        folder: PathBuf,
        opened: Option<String>,
        open_by_handler: bool,
        control: Option<String>,
        registers_stated: bool,
        live: Option<&Live>,
        requests: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let handle = live.map(|live| live.handle(py)).transpose()?;
        let handlers = handlers(requests)?;
        let server = enter(py, |_| {
            let address = of_host(host, port)?;
            let options = PanelOptions { address, folder, open: opened, open_by_handler, control, registers_stated };
            Server::start(options, handle, handlers)
        })?;
        Ok(Self(Threaded::new("panel: has been stopped; begin a new Panel", server)))
    }

    /// Host and port on which it listens.
    fn address(&self, py: Python<'_>) -> PyResult<(String, u16)> {
        let address = self.0.with(py, |server| Ok(server.address()))?;
        Ok((address.ip().to_string(), address.port()))
    }

    /// The address for a browser, with the token.
    fn url(&self, py: Python<'_>) -> PyResult<String> {
        self.0.with(py, |server| Ok(server.url()))
    }

    /// The token.
    fn token(&self, py: Python<'_>) -> PyResult<String> {
        self.0.with(py, |server| Ok(server.token().to_owned()))
    }

    /// Number of connected clients.
    fn viewers(&self, py: Python<'_>) -> PyResult<usize> {
        self.0.with(py, |server| Ok(server.viewers()))
    }

    /// Shows another live source from now on.
    fn attach(&self, py: Python<'_>, live: &Live) -> PyResult<()> {
        let handle = live.handle(py)?;
        self.0.with(py, |server| server.attach(handle))
    }

    /// Notes that the handler has connected the board's serial line, or disconnected it.
    fn connected(&self, py: Python<'_>, control: Option<String>) -> PyResult<()> {
        self.0.with(py, |server| {
            server.connected(control);
            Ok(())
        })
    }

    /// Ends the server; does nothing once it has ended.
    fn stop(&self, py: Python<'_>) {
        // A request may be about to call Python: without the GIL released here the server would never end.
        py.detach(|| drop(self.0.take()));
    }
}
