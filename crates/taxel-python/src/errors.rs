//! The one place where an error gets its Python class.

use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyOSError};
use pyo3::prelude::*;
use taxel_core::{Error as CoreError, Reason, reading};
use taxel_live::Error as LiveError;

pyo3::create_exception!(taxel, Error, PyException, "Anything that taxel refuses; its kinds are its subclasses.");
pyo3::create_exception!(taxel, FormatError, Error, "Bytes or files that do not hold what they should.");
pyo3::create_exception!(
    taxel,
    ProblemError,
    Error,
    "Arguments, spike trains or a learning problem that make no sense."
);
pyo3::create_exception!(taxel, NotFittedError, ProblemError, "A learner that was used before `fit`.");
pyo3::create_exception!(taxel, DeviceError, Error, "The board, its registers or its commands.");
pyo3::create_exception!(taxel, SceneError, Error, "A simulated scene that cannot be played.");

pub(crate) fn core(error: CoreError) -> PyErr {
    // No wildcard arm: a new kind does not compile until it has a class.
    match error {
        CoreError::Format(reason) => with_help(FormatError::new_err, reason),
        CoreError::Problem(reason) => with_help(ProblemError::new_err, reason),
        CoreError::Device(reason) => with_help(DeviceError::new_err, reason),
        CoreError::Scene(reason) => with_help(SceneError::new_err, reason),
        CoreError::Interrupted => PyKeyboardInterrupt::new_err(()),
    }
}

/// The exception of a reason: its argument and its hint are attributes, of which `error_line` makes what is shown.
fn with_help(raised: fn(String) -> PyErr, Reason { text, argument, hint }: Reason) -> PyErr {
    let error = raised(text);
    let hint = hint.and_then(|hint| Some(serde_json::to_value(hint).ok()?.as_str()?.to_owned()));
    let set = Python::attach(|py| {
        let value = error.value(py);
        value.setattr("argument", argument)?;
        value.setattr("hint", hint)
    });
    set.err().unwrap_or(error)
}

/// The line of an error, in which its argument has the name that the reader knows it by.
#[pyfunction]
fn error_line(text: String, argument: &str, hint: Option<&str>) -> PyResult<String> {
    let hint = reading::from_value(hint.into()).map_err(|unfit| core(unfit.problem("hint")))?;
    Ok(Reason { text, argument: None, hint }.line(argument))
}

pub(crate) fn live(error: LiveError) -> PyErr {
    match error {
        LiveError::Core(error) => core(error),
        // OSError picks its own subclass by errno: FileNotFoundError, PermissionError ...
        LiveError::File { path, source } => os_error(source, path.display().to_string()),
        LiveError::Socket { place, source } => os_error(source, place),
        // What a caller's own function raised is raised again.
        LiveError::Sink(source) => {
            source.downcast::<PyErr>().unwrap_or_else(|source| os_error(source, "detections".to_owned()))
        }
    }
}

fn os_error(source: std::io::Error, place: String) -> PyErr {
    match source.raw_os_error() {
        Some(code) => {
            let message = source.to_string();
            let text = message.split(" (os error").next().unwrap_or(&message).to_owned();
            PyOSError::new_err((code, text, place))
        }
        None if source.kind() == std::io::ErrorKind::AlreadyExists => {
            pyo3::exceptions::PyFileExistsError::new_err(format!("{place}: {source}"))
        }
        None => PyOSError::new_err(format!("{place}: {source}")),
    }
}

/// Both crates' errors, so that one door serves both.
pub(crate) trait IntoPyErr {
    fn into_py_err(self) -> PyErr;
}

impl IntoPyErr for CoreError {
    fn into_py_err(self) -> PyErr {
        core(self)
    }
}

impl IntoPyErr for LiveError {
    fn into_py_err(self) -> PyErr {
        live(self)
    }
}

pub(crate) fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let error = py.get_type::<Error>();
    error.setattr("argument", py.None())?;
    error.setattr("hint", py.None())?;
    module.add("Error", error)?;
    module.add_function(wrap_pyfunction!(error_line, module)?)?;
    module.add("FormatError", py.get_type::<FormatError>())?;
    module.add("ProblemError", py.get_type::<ProblemError>())?;
    module.add("NotFittedError", py.get_type::<NotFittedError>())?;
    module.add("DeviceError", py.get_type::<DeviceError>())?;
    module.add("SceneError", py.get_type::<SceneError>())
}
