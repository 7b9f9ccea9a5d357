//! The one place where an error gets its Python class.

use std::ffi::CStr;

use pyo3::exceptions::{PyException, PyKeyboardInterrupt, PyOSError};
use pyo3::prelude::*;
use pyo3::types::PyType;
use taxel_core::{Error as CoreError, Place, Reason};
use taxel_live::Error as LiveError;

// The classes that `register` makes; an extension beside `_core` raises the same ones.
pyo3::import_exception!(taxel._core, Error);
pyo3::import_exception!(taxel._core, FormatError);
pyo3::import_exception!(taxel._core, ProblemError);
pyo3::import_exception!(taxel._core, NotFittedError);
pyo3::import_exception!(taxel._core, DeviceError);
pyo3::import_exception!(taxel._core, SceneError);

/// The exception of an error of the core.
pub fn core(error: CoreError) -> PyErr {
    // No wildcard arm: a new kind does not compile until it has a class.
    match error {
        CoreError::Format(reason) => with_help(FormatError::new_err, reason),
        CoreError::Problem(reason) => with_help(ProblemError::new_err, reason),
        CoreError::Device(reason) => with_help(DeviceError::new_err, reason),
        CoreError::Scene(reason) => with_help(SceneError::new_err, reason),
        CoreError::Interrupted => PyKeyboardInterrupt::new_err(()),
    }
}

/// The exception of a reason: its place, argument and hint are attributes, of which `taxel._base.errors` makes what is
/// shown.
fn with_help(raised: fn(String) -> PyErr, Reason { text, place, argument, hint }: Reason) -> PyErr {
    let error = raised(text);
    let hint = hint.and_then(|hint| Some(serde_json::to_value(hint).ok()?.as_str()?.to_owned()));
    let set = Python::attach(|py| {
        let value = error.value(py);
        if let Some(Place { file, line, byte }) = place {
            value.setattr("place", py.import("taxel._base.errors")?.call_method1("Place", (file, line, byte))?)?;
        }
        value.setattr("argument", argument)?;
        value.setattr("hint", hint)
    });
    set.err().unwrap_or(error)
}

/// The exception of an error of the live path.
pub fn live(error: LiveError) -> PyErr {
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
    use std::io::ErrorKind::{AlreadyExists, IsADirectory, NotFound, PermissionDenied, ResourceBusy};
    // An error that the system's code did not make has none: the codes of Python's classes by kind, the same in every system.
    let code = source.raw_os_error().or(match source.kind() {
        NotFound => Some(2),
        PermissionDenied => Some(13),
        ResourceBusy => Some(16),
        AlreadyExists => Some(17),
        IsADirectory => Some(21),
        _ => None,
    });
    let message = source.to_string();
    let text = message.split(" (os error").next().unwrap_or(&message).to_owned();
    match code {
        // Python finds the code of its classes by that of Windows, which comes last.
        Some(code) if cfg!(windows) && source.raw_os_error().is_some() => PyOSError::new_err((0, text, place, code)),
        Some(code) => PyOSError::new_err((code, text, place)),
        None => PyOSError::new_err(format!("{place}: {message}")),
    }
}

/// Both crates' errors, so that one door serves both.
pub trait IntoPyErr {
    /// Its exception.
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

/// Makes the classes, as attributes of `taxel._core`.
///
/// # Errors
///
/// Those of Python.
pub fn register(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    let make = |name: &CStr, about: &CStr, base: &Bound<'_, PyType>| -> PyResult<Bound<'_, PyType>> {
        let class = PyErr::new_type(py, name, Some(about), Some(base), None)?.into_bound(py);
        module.add(class.name()?, &class)?;
        Ok(class)
    };
    let error = make(
        c"taxel.Error",
        c"Every error of taxel; its subclasses are the kinds of errors.",
        &py.get_type::<PyException>(),
    )?;
    error.setattr("place", py.None())?;
    error.setattr("argument", py.None())?;
    error.setattr("hint", py.None())?;
    make(c"taxel.FormatError", c"Bytes or files with wrong content.", &error)?;
    let problem =
        make(c"taxel.ProblemError", c"Arguments, spike trains or learning problems that are not valid.", &error)?;
    make(c"taxel.NotFittedError", c"A learner was used before `fit`.", &problem)?;
    make(c"taxel.DeviceError", c"An error of the board, of its registers or of its commands.", &error)?;
    make(c"taxel.SceneError", c"A scene that cannot be simulated.", &error)?;
    Ok(())
}
