//! One cell of the layer's face.

/// A cell that a body may touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Column of the grid.
    pub x: u32,
    /// Row of the grid.
    pub y: u32,
    /// How far the body has sunk below the face of the layer at rest, mm; below 0 where it is still above.
    pub sunk_mm: f64,
}
