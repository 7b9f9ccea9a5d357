//! Detections with the time of their output, and where they go.

use taxel_core::detect::Detection;

/// A detection, and the time of its output.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputDetection {
    /// The detection.
    pub detection: Detection,
    /// Time of the output by the host's clock, ns since 1970.
    pub output_ns: i64,
    /// Time of the output by the board's clock: `output_ns` converted with the estimated offset; us.
    pub output_us: i64,
}

impl OutputDetection {
    /// A line of JSON with the keys of `taxel detect --json` and the time of the output, including the line end.
    ///
    /// # Errors
    ///
    /// If the detection cannot be written as JSON.
    pub fn line(&self) -> std::io::Result<Vec<u8>> {
        let Self { detection, output_ns, output_us } = self;
        let mut line = serde_json::to_vec(&serde_json::json!({
            "label": detection.label,
            "t_us": detection.t,
            "known_us": detection.known,
            "slope_mv_per_ms": detection.slope,
            "repaired": detection.repaired,
            "said_us": output_us,
            "said_ns": output_ns,
        }))?;
        line.push(b'\n');
        Ok(line)
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
pub struct Lines<W>(pub W);

impl<W: std::io::Write + Send> Sink for Lines<W> {
    fn output(&mut self, detection: &OutputDetection) -> std::io::Result<()> {
        self.0.write_all(&detection.line()?)?;
        self.0.flush()
    }
}
