//! Effects of lines that taxels share, and of real comparators, on trip times before the board compares them.

use super::NOT_RETURNED;
use crate::circuit::{Chain, Converter, ConverterScan, Ramp};
use crate::contact::Sensor;
use crate::wire::Registers;
use crate::{Array, Result, problem};

/// Passes frames of trip times through a circuit, one after the other.
///
/// The reading of each taxel alone determines its conductance, and the network computes all voltages from all
/// conductances. The difference of these from the taxels' own voltages is added to the latter, so an ideal circuit
/// changes nothing. The registers define the converter's times.
#[derive(Debug, Clone)]
pub struct Crossed {
    chain: Chain,
    array: Array,
    registers: Registers,
    scan: ConverterScan,
    /// Voltage of each reading, in the middle of its tick, because the counter shows whole ticks.
    alone_v: Vec<f64>,
    conductance_us: Vec<f64>,
    ticks: Vec<f64>,
}

impl Crossed {
    /// The circuit of an array whose board has these `registers`.
    ///
    /// # Errors
    ///
    /// `Problem` if a parameter is out of range.
    pub fn new(chain: Chain, registers: &Registers, array: &Array) -> Result<Self> {
        chain.check()?;
        let scan =
            ConverterScan::new(timed(&chain.converter, registers, array), array.rows.into(), array.columns.into())?;
        Ok(Self {
            alone_v: voltages(registers),
            conductance_us: vec![0.0; array.len()],
            ticks: vec![0.0; array.len()],
            registers: *registers,
            array: array.clone(),
            scan,
            chain,
        })
    }

    /// Number of taxels that the circuit reads.
    #[must_use]
    pub fn taxels(&self) -> usize {
        self.ticks.len()
    }

    /// Checks that a circuit has the voltage and the resistor with which the simulated sensor computes trip times.
    ///
    /// # Errors
    ///
    /// `Problem`, naming the parameter.
    pub fn fits(chain: &Chain, sensor: &Sensor) -> Result<()> {
        for (name, circuits, sensors) in [
            ("v_trans", chain.readout.v_trans, sensor.v_trans),
            ("feedback_kohm", chain.readout.feedback_kohm, sensor.feedback_kohm),
        ] {
            if circuits != sensors {
                return Err(problem!("circuit"; ": {name} is {circuits}: must be {sensors}, as in the sensor"));
            }
        }
        Ok(())
    }

    /// Replaces a frame's trip times by those that the board reads through the circuit; one at the ramp's end stays
    /// there.
    ///
    /// # Errors
    ///
    /// `Problem` if the current registers leave the converter no time.
    pub fn read(&mut self, registers: &Registers, ticks: &mut [u16]) -> Result<()> {
        if self.registers != *registers {
            *self = Self::new(self.chain.clone(), registers, &self.array)?;
        }
        let lines = &self.chain.readout;
        let alone_v = |value: u16| self.alone_v[usize::from(value).min(self.alone_v.len() - 1)];
        for (conductance, &value) in self.conductance_us.iter_mut().zip(&*ticks) {
            *conductance = lines.conductance_us_alone(alone_v(value)).max(0.0);
        }
        let mut volts = lines.volts(self.array.rows.into(), self.array.columns.into(), &self.conductance_us)?;
        for ((volts, &conductance), &value) in volts.iter_mut().zip(&self.conductance_us).zip(&*ticks) {
            *volts += alone_v(value) - lines.volts_alone(conductance);
        }
        self.scan.frame(&volts, &mut self.ticks);
        let ramp = registers.ramp;
        for (value, &read) in ticks.iter_mut().zip(&self.ticks) {
            if *value < ramp {
                // An ideal circuit returns its input except for the rounding error of a logarithm, which the margin
                // absorbs.
                *value = if read.is_nan() { NOT_RETURNED } else { (read + 1e-9) as u16 };
            }
        }
        Ok(())
    }
}

/// A converter with the times of a board.
fn timed(converter: &Converter, registers: &Registers, array: &Array) -> Converter {
    let us = |of_10_ns: u32| f64::from(of_10_ns) / 100.0;
    Converter {
        ramp: registers.ramp.into(),
        wait_us: us(u32::from(registers.step_period) - u32::from(registers.step_read.min(registers.step_period))),
        step_us: us(registers.step_period.into()),
        line_us: us(registers.line_period),
        steps: registers.steps(array) as usize,
        ..converter.clone()
    }
}

fn voltages(registers: &Registers) -> Vec<f64> {
    let ramp = Ramp::rc(registers.ramp.into());
    (0..=registers.ramp).map(|tick| ramp.volts(f64::from(tick) + 0.5)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::circuit::VirtualGround;

    fn ideal() -> Chain {
        Chain {
            readout: VirtualGround { gain: None, offset_mv: 0.0, switch_ohm: 0.0, ..VirtualGround::default() },
            converter: Converter { hysteresis_v: 0.0, settle_us: 0.0, discharge_us: 0.0, ..Converter::default() },
        }
    }

    fn read(chain: Chain, registers: &Registers, frames: &[Vec<u16>]) -> Vec<u16> {
        let mut crossed = Crossed::new(chain, registers, &Array::thesis()).unwrap();
        let mut last = vec![];
        for frame in frames {
            last.clone_from(frame);
            crossed.read(registers, &mut last).unwrap();
        }
        last
    }

    #[test]
    fn an_ideal_circuit_changes_nothing_whatever_the_preset() {
        for preset in ["5.2 kHz", "2 kHz", "20.8 kHz"] {
            let registers = Registers::preset(preset).unwrap();
            let frame: Vec<u16> = (0..4096_u32).map(|k| (k * 7919 % 700) as u16).collect();
            assert_eq!(read(ideal(), &registers, &[frame.clone(), frame.clone()]), frame, "{preset}");
        }
    }

    #[test]
    fn a_pressed_column_pulls_its_taxels_down_by_its_switch() {
        let registers = Registers::default();
        let mut frame = vec![49; 4096];
        (0..64).for_each(|y| frame[64 * y + 5] = 140);
        let resting =
            Chain { readout: VirtualGround { switch_ohm: 50.0, gain: None, ..VirtualGround::default() }, ..ideal() };
        let got = read(resting, &registers, &[frame]);
        // 64 taxels of 24 uS on 50 ohm: they lose 7 % of their reading above rest.
        let volts = |tick: f64| Ramp::rc(150.0).volts(tick);
        let (alone_v, conductance) = (volts(140.5), 64.0 * 1e-6 * (volts(140.5) / 1.3 - 1.0) / 47e-3);
        let wanted = Ramp::rc(150.0).ticks(1.3 + (alone_v - 1.3) / (1.0 + 50.0 * conductance));
        assert!((0..64).all(|y| got[64 * y + 5] == wanted as u16), "{} {wanted}", got[5]);
        assert!(got.iter().enumerate().all(|(k, &t)| k % 64 == 5 || t == 49));
    }

    #[test]
    fn hysteresis_and_faults_come_through_and_the_end_stays_the_end() {
        let chain = Chain { converter: Converter { hysteresis_v: 0.1, ..ideal().converter }, ..ideal() };
        let mut frame = vec![60; 4096];
        (frame[3], frame[4]) = (150, NOT_RETURNED);
        let got = read(chain, &Registers::default(), &[frame]);
        let wanted = Ramp::rc(150.0).ticks(Ramp::rc(150.0).volts(60.5) + 0.05) as u16;
        assert_eq!((got[0], got[3], got[4]), (wanted, 150, NOT_RETURNED));
    }

    #[test]
    fn registers_that_are_written_while_it_runs_are_followed() {
        let (fast, slow) = (Registers::preset("5.2 kHz").unwrap(), Registers::preset("2 kHz").unwrap());
        let mut crossed = Crossed::new(ideal(), &fast, &Array::thesis()).unwrap();
        let mut frame = vec![400; 4096];
        crossed.read(&slow, &mut frame).unwrap();
        assert_eq!(frame, vec![400; 4096]);
    }
}
