//! The senders at a port: a board may get another address; two boards take turns.

use crate::capture::counts::Totals;

/// The addresses of the last two senders, the latest first; `None` before.
#[derive(Debug)]
pub(super) struct Senders<Address>([Option<Address>; 2]);

impl<Address> Default for Senders<Address> {
    fn default() -> Self {
        Self([None, None])
    }
}

impl<Address: PartialEq + Copy> Senders<Address> {
    /// Counts a change of the sender.
    pub(super) fn note(&mut self, sender: Address, totals: &mut Totals) {
        let [last, before] = self.0;
        if last != Some(sender) {
            totals.changes_between_senders += u64::from(before == Some(sender));
            totals.changes_of_address += u64::from(before != Some(sender) && last.is_some());
            self.0 = [Some(sender), last];
        }
    }
}
