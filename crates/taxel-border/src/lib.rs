//! How an extension of taxel meets Python: long calls that hear Ctrl-C, the classes of errors, arrays of NumPy,
//! parameters. `taxel._core` and the extensions beside it use it.

pub mod convert;
pub mod enter;
pub mod errors;
pub mod instructions;
pub mod parameters;
