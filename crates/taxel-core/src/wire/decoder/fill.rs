//! Decodes streams and datagrams into columns that the caller allocated.

use super::Decoder;
use super::filling::FilledColumns;
use crate::wire::columns::{Columns, Filled, Room};
use crate::{Marker, Result, Stop, problem};

impl Decoder {
    /// As [`Self::push`], but fills columns that the caller allocated from their first row on; with `last` the stream
    /// ends after these bytes. Also returns the markers. With `Pairing::Taxel` all events wait for [`Self::finish`].
    ///
    /// # Errors
    ///
    /// `Problem` if a column has fewer entries than [`Self::most_rows`] requires, in which case nothing is read;
    /// `Interrupted` if asked to stop.
    pub fn fill(
        &mut self,
        bytes: &[u8],
        arrived: Option<i64>,
        mut room: Room<'_>,
        last: bool,
        stop: Stop<'_>,
    ) -> Result<Columns> {
        /// Bytes between two checks of `stop`: some milliseconds of work.
        const PIECE: usize = 16 << 20;
        self.check_room(&room, bytes.len())?;
        let (mut done, mut markers) = (Filled { rows: 0, paired: false }, vec![]);
        for piece in bytes.chunks(PIECE) {
            stop.check()?;
            self.fill_behind(piece, arrived, &mut room, &mut done, &mut markers);
        }
        if last {
            self.release(&mut room, &mut done);
            self.as_new();
        }
        Ok(Columns { filled: done, repaired: None, markers })
    }

    /// As [`Self::fill`] to the end of the stream, but decodes consecutive datagrams with these `lengths` separately: a
    /// change whose intensity is not in its datagram has none.
    ///
    /// # Errors
    ///
    /// `Problem` if the lengths together are not those of the bytes, or a column has too few entries, and nothing was read;
    /// `Interrupted` if asked to stop.
    pub fn fill_datagrams(
        &mut self,
        bytes: &[u8],
        lengths: &[i64],
        mut room: Room<'_>,
        stop: Stop<'_>,
    ) -> Result<Columns> {
        /// Datagrams between two checks of `stop`: some milliseconds of work.
        const PIECE: usize = 1 << 14;
        let total = lengths.iter().try_fold(0, |sum: usize, &n| sum.checked_add(usize::try_from(n).ok()?));
        if total != Some(bytes.len()) {
            return Err(problem!("lengths"; ": each must be 0 or more, and their sum {} bytes", bytes.len()));
        }
        self.check_room(&room, bytes.len())?;
        let (mut done, mut markers, mut rest) = (Filled { rows: 0, paired: false }, vec![], bytes);
        for piece in lengths.chunks(PIECE) {
            stop.check()?;
            for &length in piece {
                let (datagram, later) = rest.split_at(length as usize);
                self.fill_behind(datagram, None, &mut room, &mut done, &mut markers);
                self.release(&mut room, &mut done);
                rest = later;
            }
        }
        self.as_new();
        Ok(Columns { filled: done, repaired: None, markers })
    }

    /// Checks that the columns have room for the rows of this many bytes.
    fn check_room(&self, room: &Room<'_>, bytes: usize) -> Result<()> {
        let most = self.most_rows(bytes);
        if room.len() < most {
            return Err(problem!("columns have room for {} rows: {bytes} bytes may need {most} rows", room.len()));
        }
        Ok(())
    }

    /// Fills columns from the first row that is not `done`.
    fn fill_behind(
        &mut self,
        bytes: &[u8],
        arrived: Option<i64>,
        room: &mut Room<'_>,
        done: &mut Filled,
        markers: &mut Vec<Marker>,
    ) {
        let filled = self.fill_columns(bytes, arrived, room.behind(done.rows), done.paired, markers);
        if filled.paired && !done.paired {
            room.without_intensities(done.rows);
        }
        *done = Filled { rows: done.rows + filled.rows, paired: filled.paired };
    }

    /// Writes the change that still waits for its intensity, if there is one, without an intensity.
    fn release(&mut self, room: &mut Room<'_>, done: &mut Filled) {
        if let Some(change) = self.waiting.take() {
            let mut filling = FilledColumns { room: room.behind(done.rows), rows: 0, paired: done.paired, open: false };
            filling.change(change);
            done.rows += filling.rows;
        }
    }
}
