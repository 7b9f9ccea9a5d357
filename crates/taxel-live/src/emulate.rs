//! The emulated board as a process of its own.

/// What an emulated board feels: a scene, a recording played again, noise.
pub trait Touch: Send {
    /// Writes the next frame's trip times (ticks of 1/300 us, one a taxel, by taxel index); false where there is none
    /// any more, and the board stops.
    fn frame(&mut self, ticks: &mut [u16]) -> bool;
}

/// A function that writes frames is a touch.
impl<F: FnMut(&mut [u16]) -> bool + Send> Touch for F {
    fn frame(&mut self, ticks: &mut [u16]) -> bool {
        self(ticks)
    }
}
