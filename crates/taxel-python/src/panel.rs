//! The panel's server, its files, and the office that answers it in Python.

use std::path::PathBuf;
use std::sync::{PoisonError, RwLock};

use pyo3::prelude::*;
use serde_json::Value;
use taxel_core::problem;
use taxel_live::address::of_host;
use taxel_live::panel::assets::asset;
use taxel_live::panel::{Office, Panel as Server, PanelOptions};

use crate::enter::enter;
use crate::errors::core;
use crate::live::Live;

/// Gives a file of the panel's page by its name below `web/`, as bytes.
#[pyfunction]
fn page_file(name: &str) -> PyResult<&'static [u8]> {
    Ok(asset(name).map_err(core)?.bytes)
}

/// Calls a Python function of (what, JSON) that returns JSON; what it raises is the reason why not.
struct Asked(Py<PyAny>);

impl Office for Asked {
    fn ask(&self, what: &str, with: &Value) -> Result<Value, String> {
        let said = Python::attach(|py| {
            let answer = self.0.call1(py, (what, with.to_string()))?;
            answer.extract::<String>(py)
        });
        let text = said.map_err(|error| Python::attach(|py| error.value(py).to_string()))?;
        serde_json::from_str(&text).map_err(|error| format!("{what}: {error}"))
    }
}

/// The panel's server.
#[pyclass(frozen)]
struct Panel {
    server: RwLock<Option<Server>>,
}

impl Panel {
    fn with<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&Server) -> taxel_live::Result<T> + Send) -> PyResult<T> {
        enter(py, |_| match self.server.read().unwrap_or_else(PoisonError::into_inner).as_ref() {
            Some(server) => work(server),
            None => Err(problem!("panel: has been stopped; begin a new one").into()),
        })
    }
}

#[pymethods]
impl Panel {
    /// Opens the port and begins to serve.
    #[new]
    #[allow(clippy::too_many_arguments)]
    fn start(
        py: Python<'_>,
        host: &str,
        port: u16,
        folder: PathBuf,
        opened: Option<String>,
        control: Option<String>,
        readout: Option<Vec<String>>,
        live: Option<&Live>,
        office: Py<PyAny>,
    ) -> PyResult<Self> {
        let handle = live.map(|live| live.handle(py)).transpose()?;
        let server = enter(py, |_| {
            let options = PanelOptions { address: of_host(host, port)?, folder, open: opened, control, readout };
            Server::start(options, handle, Box::new(Asked(office)))
        })?;
        Ok(Self { server: RwLock::new(Some(server)) })
    }

    /// Host and port that it listens on.
    fn address(&self, py: Python<'_>) -> PyResult<(String, u16)> {
        let address = self.with(py, |server| Ok(server.address()))?;
        Ok((address.ip().to_string(), address.port()))
    }

    /// What a person opens, with the token.
    fn url(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |server| Ok(server.url()))
    }

    /// The token.
    fn token(&self, py: Python<'_>) -> PyResult<String> {
        self.with(py, |server| Ok(server.token().to_owned()))
    }

    /// How many look.
    fn viewers(&self, py: Python<'_>) -> PyResult<usize> {
        self.with(py, |server| Ok(server.viewers()))
    }

    /// Shows another live source from here on.
    fn attach(&self, py: Python<'_>, live: &Live) -> PyResult<()> {
        let handle = live.handle(py)?;
        self.with(py, |server| server.attach(handle))
    }

    /// Ends; once ended, nothing.
    fn stop(&self, py: Python<'_>) {
        // The office may be about to call Python: it must be able to, or the server never ends.
        py.detach(|| drop(self.server.write().unwrap_or_else(PoisonError::into_inner).take()));
    }
}

impl Drop for Panel {
    fn drop(&mut self) {
        let server = self.server.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        Python::attach(|py| py.detach(|| drop(server)));
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Panel>()?;
    module.add_function(wrap_pyfunction!(page_file, module)?)
}
