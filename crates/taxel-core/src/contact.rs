//! Fast contact for scenes.
