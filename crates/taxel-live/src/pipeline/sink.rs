//! Detections with the time of their output, and where they go.

use taxel_core::detect::Detection;

/// A detection, and when it was output.
#[derive(Debug, Clone, PartialEq)]
pub struct Said {
    /// What was detected.
    pub detection: Detection,
    /// When it was output by the host's clock, ns since 1970.
    pub said_ns: i64,
    /// The same by the board's clock, as far as the host can tell: `said_ns` less the estimated offset; us.
    pub said: i64,
}

impl Said {
    /// A line of JSON with the keys of `taxel detect --json` and the time of the output, its end included.
    ///
    /// # Errors
    ///
    /// Where it cannot be written as JSON.
    pub fn line(&self) -> std::io::Result<Vec<u8>> {
        let Self { detection, said_ns, said } = self;
        let mut line = serde_json::to_vec(&serde_json::json!({
            "label": detection.label,
            "t_us": detection.t,
            "known_us": detection.known,
            "slope_mv_per_ms": detection.slope,
            "repaired": detection.repaired,
            "said_us": said,
            "said_ns": said_ns,
        }))?;
        line.push(b'\n');
        Ok(line)
    }
}

/// Takes detections in the thread that made them; the next detection waits until it returns.
pub trait Sink: Send {
    /// Takes one.
    ///
    /// # Errors
    ///
    /// Where it cannot be handed on: then the pipeline ends.
    fn take(&mut self, said: &Said) -> std::io::Result<()>;
}

impl<F: FnMut(&Said) -> std::io::Result<()> + Send> Sink for F {
    fn take(&mut self, said: &Said) -> std::io::Result<()> {
        self(said)
    }
}

/// Writes each detection as a line ([`Said::line`]).
#[derive(Debug)]
pub struct Lines<W>(pub W);

impl<W: std::io::Write + Send> Sink for Lines<W> {
    fn take(&mut self, said: &Said) -> std::io::Result<()> {
        self.0.write_all(&said.line()?)?;
        self.0.flush()
    }
}
