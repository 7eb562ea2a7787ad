//! Observers: a point of the space with an orthonormal frame, moved by the exponential map and parallel transport.

use crate::geometry::{Geodesic, Geometry};
use glam::{DMat3, DVec3, DVec4};

/// A cell, a point in it, and an orthonormal frame there. For an observer the axes are right, up and back (he
/// looks along minus the third), for an object they are the mesh's x, y and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Index of the cell.
    pub cell: usize,
    /// The point, in the geometry's coordinates.
    pub point: DVec4,
    /// Orthonormal tangent vectors at the point.
    pub axes: [DVec4; 3],
}

impl Frame {
    /// The point and the axes there.
    pub fn axes_at(&self) -> (DVec4, [DVec4; 3]) {
        (self.point, self.axes)
    }

    /// The tangent vector with components `v` in the frame.
    pub fn vector(&self, v: DVec3) -> DVec4 {
        self.axes[0] * v.x + self.axes[1] * v.y + self.axes[2] * v.z
    }

    /// The frame turned by `rotation`, whose columns are the new axes in terms of the old.
    pub fn rotated(&self, rotation: DMat3) -> Self {
        Self {
            axes: [self.vector(rotation.x_axis), self.vector(rotation.y_axis), self.vector(rotation.z_axis)],
            ..*self
        }
    }

    /// The frame carried by parallel transport along the geodesic that starts with `step` (components in the
    /// frame; its length is the distance). The cell is kept: the point may lie outside of it.
    pub fn moved<G: Geometry>(&self, geometry: G, step: DVec3) -> Self {
        let length = step.length();
        if length == 0.0 {
            return *self;
        }
        let start = Geodesic { point: self.point, velocity: self.vector(step / length) };
        let end = geometry.flow(start, length);
        let axes = self.axes.map(|axis| geometry.transport(start, length, axis));
        Self { cell: self.cell, point: end.point, axes: crate::geometry::orthonormalise(geometry, end.point, axes) }
    }
}
