//! Detections with the time of their output, and where they go.

use std::fmt::Write as _;

use serde::Serialize;
use taxel_core::detect::Detection;

/// A detection, and the time of its output.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutputDetection {
    /// The detection.
    #[serde(flatten)]
    pub detection: Detection,
    /// Time of the output by the host's clock, ns since 1970.
    pub reported_ns: i64,
    /// Time of the output by the board's clock: `reported_ns` converted with the estimated offset; us.
    #[serde(rename = "reported")]
    pub reported_us: i64,
}

impl OutputDetection {
    /// A line of JSON with the keys of `taxel detect --json` and the time of the output, including the line end. It is
    /// ASCII, as those lines are: a terminal would obey control characters of a label.
    ///
    /// # Errors
    ///
    /// If the detection cannot be written as JSON.
    pub fn line(&self) -> std::io::Result<Vec<u8>> {
        let Self { detection, reported_ns, reported_us } = self;
        let text = serde_json::to_string(&serde_json::json!({
            "label": detection.label,
            "t_us": detection.t,
            "known_us": detection.known,
            "slope_mv_per_ms": detection.slope,
            "repaired": detection.repaired,
            "reported_us": reported_us,
            "reported_ns": reported_ns,
        }))?;
        let mut line = String::with_capacity(text.len() + 1);
        for unit in text.encode_utf16() {
            match u8::try_from(unit) {
                Ok(plain @ b' '..=b'~') => line.push(char::from(plain)),
                _ => write!(line, "\\u{unit:04x}").map_err(std::io::Error::other)?,
            }
        }
        line.push('\n');
        Ok(line.into_bytes())
    }
}

/// Receives detections in the thread that made them; the next detection waits until the call returns.
pub trait Sink: Send {
    /// Outputs a detection.
    ///
    /// # Errors
    ///
    /// If the detection cannot be output; the pipeline then ends.
    fn output(&mut self, detection: &OutputDetection) -> std::io::Result<()>;
}

impl<F: FnMut(&OutputDetection) -> std::io::Result<()> + Send> Sink for F {
    fn output(&mut self, detection: &OutputDetection) -> std::io::Result<()> {
        self(detection)
    }
}

/// Writes each detection as a line ([`OutputDetection::line`]).
#[derive(Debug)]
pub struct LineSink<W>(pub W);

impl<W: std::io::Write + Send> Sink for LineSink<W> {
    fn output(&mut self, detection: &OutputDetection) -> std::io::Result<()> {
        self.0.write_all(&detection.line()?)?;
        self.0.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_ascii_and_keeps_the_label() {
        let label = "ä\u{1b}[2J\n\u{7f}\u{9b}31m\u{202e}\u{2028}\"\\\u{1f590}";
        let detection = Detection { label: label.into(), t: 5, known: 7, slope: 1.5, repaired: false };
        let line = OutputDetection { detection, reported_ns: 9, reported_us: 8 }.line().unwrap();
        assert!(line[..line.len() - 1].iter().all(|byte| (b' '..=b'~').contains(byte)) && line.ends_with(b"\n"));
        let read: serde_json::Value = serde_json::from_slice(&line).unwrap();
        assert_eq!((read["label"].as_str(), read["t_us"].as_i64()), (Some(label), Some(5)));
    }
}
