//! Taxels of which a user says that they are at rest now.

use taxel_core::encode::Zeroing;
use taxel_core::{Array, problem};

use super::shared::PublishedState;
use crate::Result;
use crate::recording::now_ns;

impl PublishedState {
    /// The zeroings of taxels (column, row), which rest at what `rest_now` gives by index: none where one cannot be zeroed.
    /// Their time is after all that came, and after `announced`, before which the board promised no more.
    pub(super) fn zeroings_of(
        &self,
        array: &Array,
        taxels: &[(u16, u16)],
        announced: Option<i64>,
        rest_now: impl Fn(usize) -> Option<f64>,
    ) -> Result<Vec<Zeroing>> {
        if self.counters.readout.taring {
            return Err(problem!("a tare is being measured: zero taxels after it").into());
        }
        let now = self.counters.board.offset.map(|offset| offset.board_us(now_ns()));
        let Some(t) = self.counters.board.board_us.max(announced).max(now) else {
            return Err(problem!("nothing has arrived yet, so no taxel can be zeroed").into());
        };
        let zeroing = |&(x, y): &(u16, u16)| {
            let mut zeroing = Zeroing { t, x, y, rest: 0.0, before: None };
            zeroing.check(array)?;
            let taxel = array.index(x, y);
            let Some(rest) = rest_now(taxel) else {
                return Err(problem!(
                    "taxel at row {y}, column {x}: its value is unknown, because it has sent no event so far"
                )
                .into());
            };
            zeroing.rest = rest;
            let tared = self.rest.get(taxel).copied().flatten();
            zeroing.before = self.zeroed.get(&taxel).map(|earlier| earlier.rest).or(tared);
            Ok(zeroing)
        };
        taxels.iter().map(zeroing).collect()
    }

    pub(super) fn add_zeroings(&mut self, array: &Array, zeroings: &[Zeroing]) {
        self.zeroed.extend(zeroings.iter().map(|zeroing| (array.index(zeroing.x, zeroing.y), *zeroing)));
        self.zeroings += 1;
    }
}
