//! The panel's server and its files, and its requests as calls of a Python object.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use pyo3::types::PyDict;
use taxel_core::Array;
use taxel_core::held::UNKNOWN;
use taxel_core::wire::Command;
use taxel_live::address::of_host;
use taxel_panel::assets::asset;
use taxel_panel::{
    Activity, BoardLines, Cut, LabelRow, Panel as Server, PanelOptions, PresetValue, Reply, RequestHandler,
    UnhealthyTaxels, UserPreset, UserPresets,
};

use crate::convert::{array, from_array};
use crate::enter::enter;
use crate::errors::core;
use crate::held::by_taxel;
use crate::live::Live;
use crate::threaded::Threaded;

/// Gives a file of the panel's page by its name below `web/`, as bytes.
#[pyfunction]
fn page_file(name: &str) -> PyResult<&'static [u8]> {
    Ok(asset(name).map_err(core)?.bytes)
}

/// Calls the methods of a Python object, `PanelRequests` in `_core.pyi`; the text of an exception is the reason of a refusal.
struct PythonHandler(Py<PyAny>);

impl PythonHandler {
    fn call<T>(&self, call: impl FnOnce(&Bound<'_, PyAny>) -> PyResult<T>) -> Reply<T> {
        Python::attach(|py| call(self.0.bind(py)).map_err(|error| error.value(py).to_string()))
    }
}

impl RequestHandler for PythonHandler {
    fn command(&self, command: Command) -> Reply<u32> {
        self.call(|handler| handler.call_method1("command", (command.register, command.value))?.extract())
    }

    fn channels(&self) -> Reply<u8> {
        self.call(|handler| handler.call_method0("channels")?.extract())
    }

    fn board_lines(&self) -> Reply<BoardLines> {
        let (lines, resets) = self.call(|handler| handler.call_method0("board_lines")?.extract())?;
        Ok(BoardLines { lines, resets })
    }

    fn connect(&self, place: Option<&str>) -> Reply<()> {
        self.call(|handler| handler.call_method1("connect", (place,)).map(drop))
    }

    fn listen(&self, host: &str, port: u16) -> Reply<()> {
        self.call(|handler| handler.call_method1("listen", (host, port)).map(drop))
    }

    fn set_differences(&self, on: bool) -> Reply<()> {
        self.call(|handler| handler.call_method1("set_differences", (on,)).map(drop))
    }

    fn addresses(&self) -> Reply<Vec<(String, String)>> {
        self.call(|handler| handler.call_method0("addresses")?.extract())
    }

    fn health(&self, sensor: &Array, activity: &Activity) -> Reply<UnhealthyTaxels> {
        let known = activity.range.iter().any(|&(least, _)| least != UNKNOWN);
        // Python has -1 for what is unknown.
        let range = |&(least, greatest): &(u16, u16)| match least {
            UNKNOWN => (-1_i32, -1_i32),
            _ => (least.into(), greatest.into()),
        };
        let (least, greatest): (Vec<_>, Vec<_>) = activity.range.iter().map(range).unzip();
        let (dead, stuck, noisy, untold) = self.call(|handler| {
            let py = handler.py();
            let values = known.then(|| (array(py, activity.values.clone()), array(py, least), array(py, greatest)));
            let counts = (array(py, activity.events.clone()), array(py, activity.moved.clone()));
            let touches = array(py, by_taxel(activity.touches.counts()));
            handler.call_method1("health", (from_array(sensor), counts.0, counts.1, touches, values))?.extract()
        })?;
        Ok(UnhealthyTaxels { dead, stuck, noisy, untold })
    }

    fn cut(&self, cut: &Cut<'_>) -> Reply<Vec<String>> {
        let Cut { path, out, start_us, stop_us } = *cut;
        self.call(|handler| handler.call_method1("cut", (path, out, start_us, stop_us))?.extract())
    }

    fn train(&self, recording: &Path, out: &Path) -> Reply<String> {
        self.call(|handler| handler.call_method1("train", (recording, out))?.extract())
    }

    fn end_training(&self) -> Reply<()> {
        self.call(|handler| handler.call_method0("end_training").map(drop))
    }

    fn detect(&self, recording: &Path, readout: &Path) -> Reply<Vec<(String, i64, i64)>> {
        self.call(|handler| handler.call_method1("detect", (recording, readout))?.extract())
    }

    fn read_out(&self, readout: &Path) -> Reply<()> {
        self.call(|handler| handler.call_method1("read_out", (readout,)).map(drop))
    }

    fn read_labels(&self, table: &Path, recording: &str) -> Reply<Vec<LabelRow>> {
        let rows: Vec<(String, i64)> =
            self.call(|handler| handler.call_method1("read_labels", (table, recording))?.extract())?;
        Ok(rows.into_iter().map(|(label, t_us)| LabelRow { label, t_us }).collect())
    }

    fn write_labels(&self, table: &Path, labels: &[LabelRow]) -> Reply<()> {
        let rows: Vec<(&str, i64)> = labels.iter().map(|row| (row.label.as_str(), row.t_us)).collect();
        self.call(|handler| handler.call_method1("write_labels", (table, rows)).map(drop))
    }

    fn read_presets(&self) -> Reply<UserPresets> {
        self.call(|handler| {
            let (path, presets): (PathBuf, BTreeMap<String, BTreeMap<String, Bound<'_, PyAny>>>) =
                handler.call_method0("read_presets")?.extract()?;
            let preset = |held: BTreeMap<String, Bound<'_, PyAny>>| {
                held.into_iter()
                    .map(|(name, value)| Ok((name, preset_value(&value)?)))
                    .collect::<PyResult<UserPreset>>()
            };
            let presets = presets.into_iter().map(|(name, held)| Ok((name, preset(held)?))).collect::<PyResult<_>>()?;
            Ok(UserPresets { path, presets })
        })
    }

    fn write_presets(&self, presets: &BTreeMap<String, UserPreset>) -> Reply<()> {
        self.call(|handler| {
            let all = PyDict::new(handler.py());
            for (name, preset) in presets {
                let values = PyDict::new(handler.py());
                for (register, value) in preset {
                    match value {
                        PresetValue::Flag(flag) => values.set_item(register, flag)?,
                        PresetValue::Number(number) => values.set_item(register, number)?,
                        PresetValue::Other(text) => values.set_item(register, text)?,
                    }
                }
                all.set_item(name, values)?;
            }
            handler.call_method1("write_presets", (all,)).map(drop)
        })
    }
}

/// A value of a preset, as a table in TOML has it.
fn preset_value(value: &Bound<'_, PyAny>) -> PyResult<PresetValue> {
    if let Ok(flag) = value.extract() {
        return Ok(PresetValue::Flag(flag));
    }
    match value.extract() {
        Ok(number) => Ok(PresetValue::Number(number)),
        Err(_) => Ok(PresetValue::Other(value.str()?.to_string())),
    }
}

/// The panel's server.
#[pyclass(frozen)]
struct Panel(Threaded<Server>);

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
        registers_stated: bool,
        readout: Option<Vec<String>>,
        live: Option<&Live>,
        requests: Py<PyAny>,
    ) -> PyResult<Self> {
        let handle = live.map(|live| live.handle(py)).transpose()?;
        let server = enter(py, |_| {
            let address = of_host(host, port)?;
            let options = PanelOptions { address, folder, open: opened, control, registers_stated, readout };
            Server::start(options, handle, Box::new(PythonHandler(requests)))
        })?;
        Ok(Self(Threaded::new("panel", "panel: has been stopped; begin a new one", server)))
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
    fn attach(&self, py: Python<'_>, live: &Live, readout: Option<Vec<String>>) -> PyResult<()> {
        let handle = live.handle(py)?;
        self.0.with(py, |server| server.attach(handle, readout))
    }

    /// Notes that the handler has connected the board's serial line, or disconnected it.
    fn connected(&self, py: Python<'_>, control: Option<String>) -> PyResult<()> {
        self.0.with(py, |server| {
            server.connected(control);
            Ok(())
        })
    }

    /// Ends the server; does nothing once it has ended.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        self.0.check()?;
        // A request may be about to call Python: without the GIL released here the server would never end.
        py.detach(|| drop(self.0.take()));
        Ok(())
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Panel>()?;
    module.add_function(wrap_pyfunction!(page_file, module)?)
}
