//! Plays acts one after the other; later acts are prepared meanwhile.

use std::time::Duration;

use crossbeam_channel as channel;
use taxel_core::contact::{Act, Contact, Prepared, Stage, Taxels};
use taxel_core::{Array, Stop};

use super::Touch;
use crate::{Error, Result};

/// Number of acts that are prepared ahead of the current one.
const AHEAD: usize = 4;

/// Interval at which a waiting board checks whether to stop.
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// Acts without an end, or with one.
#[derive(Debug)]
pub struct Scenes {
    stage: Stage,
    coming: channel::Receiver<Result<Prepared>>,
    over: bool,
    /// Number of touches that were already returned by `take_contacts`.
    reported: usize,
}

impl Scenes {
    /// Starts to prepare acts, in a thread that ends when this is dropped.
    ///
    /// # Errors
    ///
    /// As [`Stage::new`]; an error in an act is returned when the act is to be played.
    pub fn new(
        array: &Array,
        taxels: Taxels,
        frame_us: f64,
        acts: impl Iterator<Item = Result<Act>> + Send + 'static,
    ) -> Result<Self> {
        let stage = Stage::new(array, taxels, frame_us, &[], Stop::never())?;
        let (ready, coming) = channel::bounded(AHEAD);
        let array = array.clone();
        let work = move || {
            for (n, act) in acts.enumerate() {
                let prepared = act.and_then(|act| {
                    Prepared::new(&array, frame_us, &act, Stop::never())
                        .map_err(|error| error.in_part(&format!("act {n}")).into())
                });
                let last = prepared.is_err();
                if ready.send(prepared).is_err() || last {
                    break;
                }
            }
        };
        std::thread::Builder::new().name("taxel-scenes".to_owned()).spawn(work).map_err(Error::socket("thread"))?;
        Ok(Self { stage, coming, over: false, reported: 0 })
    }

    /// Waits until there is a frame to play; returns false if there are no more, or if the caller stops.
    fn is_ready(&mut self, stop: Stop<'_>) -> Result<bool> {
        while !self.over && self.stage.is_over() {
            match self.coming.recv_timeout(LOOK_EVERY) {
                Ok(act) => self.stage.push(act?),
                Err(channel::RecvTimeoutError::Timeout) if !stop.asked() => {}
                Err(channel::RecvTimeoutError::Timeout) => return Ok(false),
                Err(channel::RecvTimeoutError::Disconnected) => self.over = true,
            }
        }
        Ok(!self.stage.is_over())
    }
}

impl Touch for Scenes {
    fn take_contacts(&mut self) -> Vec<Contact> {
        let contacts = self.stage.contacts();
        let new = contacts[self.reported..].to_vec();
        self.reported = contacts.len();
        new
    }

    fn frame(&mut self, ticks: &mut [u16], stop: Stop<'_>) -> Result<bool> {
        Ok(self.is_ready(stop)? && self.stage.frame(ticks, stop)?)
    }

    fn is_last(&mut self, stop: Stop<'_>) -> Result<bool> {
        Ok(!self.is_ready(stop)?)
    }
}
