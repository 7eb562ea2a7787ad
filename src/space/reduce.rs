//! To come.

use super::Space;
use glam::DVec4;

/// Whether the point lies in the cell, up to rounding.
pub fn is_inside(space: &Space, cell: usize, point: DVec4) -> bool {
    space.cells.get(cell).is_some_and(|c| c.faces.iter().all(|f| f.plane.dot(point) <= 1e-9))
}
