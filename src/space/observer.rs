//! Observers: a point of the space with an orthonormal frame, moved by the exponential map and parallel transport.

use super::{
    domain::Domain,
    reduce::{TransportError, carry},
};
use crate::geometry::{Geodesic, Geometry, orthonormalise};
use glam::{DMat3, DQuat, DVec3, DVec4};

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
        Self { cell: self.cell, point: end.point, axes: orthonormalise(geometry, end.point, axes) }
    }

    /// The frame after a walk along the geodesic that starts with `step`, as long as one likes: parallel transport
    /// through the faces, so that the point stays in its cell. The axes come out orthonormal and tangent again.
    ///
    /// # Errors
    /// [`TransportError`].
    pub fn walked<G: Geometry>(&self, geometry: G, domain: &Domain, step: DVec3) -> Result<Self, TransportError> {
        let length = step.length();
        if length == 0.0 {
            return Ok(*self);
        }
        let start = Geodesic { point: self.point, velocity: self.vector(step / length) };
        let mut axes = self.axes;
        let end = carry(geometry, domain, start, self.cell, length, &mut axes)?;
        // Off the model by a rounding, the point of a hyperbolic space would leave it by e²ᵈ times as much on each walk.
        let point = geometry.restore(end.state).point;
        let tangent = axes.map(|axis| geometry.settle_tangent(point, axis));
        Ok(Self { cell: end.cell, point, axes: orthonormalise(geometry, point, tangent) })
    }
}

/// A piece of a camera path: from one key pose to the next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leg {
    /// Start of the geodesic to the next key, in the frame of the key before; its length is the distance.
    pub step: DVec3,
    /// The turn on the way: axis, in the frame that is carried along, times angle in radians.
    pub turn: DVec3,
    /// Pictures from one key to the next, the latter included; at least 1.
    pub frames: u32,
}

impl Leg {
    /// The pose on the way, for `share` from 0 (the key before, `from`) to 1 (the next key).
    ///
    /// # Errors
    /// [`TransportError`].
    pub fn pose<G: Geometry>(
        &self,
        geometry: G,
        domain: &Domain,
        from: Frame,
        share: f64,
    ) -> Result<Frame, TransportError> {
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(self.turn * share));
        Ok(from.walked(geometry, domain, self.step * share)?.rotated(turn))
    }
}

/// The observer at picture `number` of a camera path that starts at `start`, which is picture 0. It sets out gently from
/// each key and comes to rest at the next: the speed is continuous and so is what turns. Any picture is computed from the
/// keys alone, so it does not matter which others are. Past the end of the path it stays there.
///
/// # Errors
/// [`TransportError`].
pub fn pose_on_path<G: Geometry>(
    geometry: G,
    domain: &Domain,
    start: Frame,
    path: &[Leg],
    number: u32,
) -> Result<Frame, TransportError> {
    let (mut from, mut rest) = (start, number);
    for leg in path {
        if rest < leg.frames {
            let time = f64::from(rest) / f64::from(leg.frames);
            return leg.pose(geometry, domain, from, time * time * (3.0 - 2.0 * time));
        }
        from = leg.pose(geometry, domain, from, 1.0)?;
        rest -= leg.frames;
    }
    Ok(from)
}
