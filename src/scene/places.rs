//! Points and frames of a scene file, in whatever geometry its space has.
//!
//! Directions are three components in the geometry's standard frame at their point, so that everything below is
//! linear algebra in R³; the geometry is asked for the frame and for the components of ambient vectors.

use super::reader::{Bounds, SceneError, Table, Value};
use crate::{
    geometry::{Geometry, GeometryId, Visitor, visit},
    space::{Space, observer::Frame, reduce},
};
use glam::{DMat3, DVec3, DVec4};

/// Frames may deviate from orthonormal ones by rounding in the file.
const FRAME_TOLERANCE: f64 = 1e-6;

/// A point with the standard frame there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Local {
    geometry: GeometryId,
    frame: Frame,
}

impl Local {
    /// The base point of a cell.
    pub fn base(space: &Space, cell: usize) -> Self {
        struct Base(usize);
        impl Visitor for Base {
            type Output = Frame;
            fn visit<G: Geometry>(self, geometry: G) -> Frame {
                Frame { cell: self.0, point: geometry.base(), axes: geometry.frame(geometry.base()) }
            }
        }
        Self { geometry: space.geometry, frame: visit(space.geometry, Base(cell)) }
    }

    /// The key `position`, by default the base point, in the cell of the key `cell`, by default the first.
    pub fn read(table: &mut Table, space: &Space) -> Result<Self, SceneError> {
        let cell = cell(table, space)?;
        let Some(value) = table.take("position") else { return Ok(Self::base(space, cell)) };
        let numbers = value.numbers(&[space.geometry.components()], Bounds::ANY)?;
        let shown = format!("{numbers:?}");
        let settled = settle(space.geometry, cell, four(&numbers));
        let frame =
            settled.ok_or_else(|| value.error(format!("{shown} is not a point of {}", space.geometry.name())))?;
        if !reduce::is_inside(space, cell, frame.point) {
            return Err(value.error(format!("the point {shown} is outside of cell {cell} of {}", space.name)));
        }
        Ok(Self { geometry: space.geometry, frame })
    }

    /// The frame with these axes, given as columns in the standard frame.
    pub fn frame(&self, axes: DMat3) -> Frame {
        self.frame.rotated(axes)
    }

    /// Three components in the standard frame, or as many as the geometry's own vectors have, with the deviation of
    /// the latter from being tangent.
    fn vector(&self, value: &Value) -> Result<(DVec3, f64), SceneError> {
        let own = self.geometry.components();
        let counts: &[usize] = if own == 3 { &[3] } else { &[3, own] };
        let numbers = value.numbers(counts, Bounds::ANY)?;
        if numbers.len() == 3 {
            return Ok((DVec3::new(numbers[0], numbers[1], numbers[2]), 0.0));
        }
        Ok(visit(self.geometry, Components { frame: self.frame, vector: four(&numbers) }))
    }

    /// A direction: a unit vector.
    pub fn direction(&self, value: &Value) -> Result<DVec3, SceneError> {
        let (vector, _) = self.vector(value)?;
        // Scaling by the largest component first keeps squares of huge and tiny numbers in range.
        let scale = vector.abs().max_element();
        (vector / scale)
            .try_normalize()
            .filter(|v| v.is_finite())
            .ok_or_else(|| value.error("the direction is zero: its tangent part at the position must not vanish"))
    }

    /// Three orthonormal vectors with positive orientation, as columns.
    pub fn orthonormal(&self, value: &Value) -> Result<DMat3, SceneError> {
        let rows = value.array("an array of 3 vectors")?;
        if rows.len() != 3 {
            return Err(value.expected("an array of 3 vectors"));
        }
        let mut columns = [DVec3::ZERO; 3];
        let mut residual = 0.0_f64;
        for (column, row) in columns.iter_mut().zip(&rows) {
            let (vector, normal) = self.vector(row)?;
            *column = vector;
            residual = residual.max(normal);
        }
        let axes = DMat3::from_cols_array_2d(&columns.map(|c| c.to_array()));
        let gram = axes.transpose() * axes - DMat3::IDENTITY;
        residual = gram.to_cols_array().iter().fold(residual, |r, x| r.max(x.abs()));
        if residual.is_nan() || residual > FRAME_TOLERANCE {
            return Err(value.error(format!(
                "the frame is not orthonormal: residual {residual:.3e}, at most {FRAME_TOLERANCE:e} is accepted"
            )));
        }
        if axes.determinant() < 0.0 {
            return Err(value.error("the frame is left-handed: swap two vectors or turn one round"));
        }
        let x = columns[0].normalize();
        let y = (columns[1] - x * x.dot(columns[1])).normalize();
        Ok(DMat3::from_cols(x, y, x.cross(y)))
    }

    /// Axes whose third is `forward` (from the key `look`) and whose second is as near to the key `up` as possible.
    /// Without `up` it is the standard frame's y axis, or another one if that is parallel to `forward`.
    pub fn upright(&self, forward: DVec3, up: Option<&Value>) -> Result<DMat3, SceneError> {
        let up_vector = match up {
            Some(value) => self.direction(value)?,
            None if forward.cross(DVec3::Y).length() > 1e-6 => DVec3::Y,
            None => DVec3::Z,
        };
        let right = up_vector.cross(forward);
        match up {
            Some(value) if right.length() <= 1e-6 => Err(value.error("look and up are parallel")),
            _ => {
                let right = right.normalize();
                Ok(DMat3::from_cols(right, forward.cross(right), forward))
            }
        }
    }
}

/// The key `cell`.
pub(super) fn cell(table: &mut Table, space: &Space) -> Result<usize, SceneError> {
    let last = u32::try_from(space.cells.len().saturating_sub(1)).unwrap_or(u32::MAX);
    table.take("cell").map_or(Ok(0), |value| Ok(value.integer(0, last)? as usize))
}

/// The key `rotate`: turns `[x, y, z, degrees]` about axes of the unturned frame, one after the other.
pub(super) fn turns(value: &Value) -> Result<DMat3, SceneError> {
    let mut rotation = DMat3::IDENTITY;
    for turn in value.array("an array of turns [x, y, z, degrees]")? {
        let n = turn.numbers(&[4], Bounds::ANY)?;
        let axis = DVec3::new(n[0], n[1], n[2]);
        let axis = (axis / axis.abs().max_element()).try_normalize().filter(|axis| axis.is_finite());
        let axis = axis.ok_or_else(|| turn.error("the axis is zero"))?;
        rotation = DMat3::from_axis_angle(axis, (n[3] % 360.0).to_radians()) * rotation;
    }
    Ok(rotation)
}

fn four(numbers: &[f64]) -> DVec4 {
    let mut padded = [0.0; 4];
    padded.iter_mut().zip(numbers).for_each(|(to, from)| *to = *from);
    DVec4::from_array(padded)
}

fn settle(id: GeometryId, cell: usize, components: DVec4) -> Option<Frame> {
    struct Settle(usize, DVec4);
    impl Visitor for Settle {
        type Output = Option<Frame>;
        fn visit<G: Geometry>(self, geometry: G) -> Option<Frame> {
            let point = geometry.settle(self.1).filter(|point| point.is_finite())?;
            let frame = Frame { cell: self.0, point, axes: geometry.frame(point) };
            frame.axes.iter().all(|axis| axis.is_finite()).then_some(frame)
        }
    }
    visit(id, Settle(cell, components))
}

/// Components of an ambient vector in a frame, and the length of its part that is not tangent.
struct Components {
    frame: Frame,
    vector: DVec4,
}

impl Visitor for Components {
    type Output = (DVec3, f64);
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let Frame { point, axes, .. } = self.frame;
        let tangent = geometry.settle_tangent(point, self.vector);
        let component = |axis: DVec4| geometry.inner(point, tangent, axis);
        let components = DVec3::new(component(axes[0]), component(axes[1]), component(axes[2]));
        (components, (self.vector - tangent).length())
    }
}
