//! Cells of bundles whose faces are not glued face to face: a point beyond a face often needs another pairing as well.

use super::{
    golden_ratio, outer, paired,
    products::{octagon_inradius, octagon_normal},
    signed_axis,
};
use crate::{
    geometry::{Isometry, sl2, sol},
    space::{Face, FaceId},
};
use glam::{DMat4, DVec3, DVec4};
use std::f64::consts::{PI, TAU};

/// The unit cube `[0, 1]³` with left multiplications of Nil by the unit vectors: (x, y, z) ↦ (x − 1, y, z − y) through
/// x = 1, shifts of y and z through the others.
pub(super) fn heisenberg() -> Vec<Face> {
    let face = |f: usize| {
        let normal = signed_axis(f);
        let offset = if f.is_multiple_of(2) { -1.0 } else { 0.0 };
        // Left multiplication by (a, b, c): z ↦ z + c + a y.
        let shear = outer(DVec4::Z, DVec4::Y) * -normal.x;
        paired(normal.extend(offset), f ^ 1, DMat4::from_translation(-normal) + shear)
    };
    (0..6).map(face).collect()
}

/// The torus bundle of [[2, 1], [1, 1]] in Sol: the square with the sides b₁ = (φ, −1)/√(φ²+1) and
/// b₂ = (1, φ)/√(φ²+1) times [0, 2 ln φ]. Left multiplication by (0, 0, 2 ln φ) takes b₁ to 2b₁ + b₂ and b₂ to b₁ + b₂,
/// so that the top of the cell comes to lie on parts of several copies of the bottom.
pub(super) fn golden() -> Vec<Face> {
    let golden = golden_ratio();
    let length = golden.hypot(1.0);
    let sides = [DVec3::new(golden, -1.0, 0.0) / length, DVec3::new(1.0, golden, 0.0) / length];
    let steps = [sides[0], sides[1], DVec3::Z * (2.0 * golden.ln())];
    let normals = [sides[0], sides[1], DVec3::Z];
    let face = |f: usize| {
        let (normal, step) = (normals[f / 2], steps[f / 2]);
        let (plane, by) = if f.is_multiple_of(2) {
            (normal.extend(-normal.dot(step)), DVec3::ZERO - step)
        } else {
            ((DVec3::ZERO - normal).extend(0.0), step)
        };
        glued(plane, f ^ 1, sol::translation(by))
    };
    (0..6).map(face).collect()
}

/// The unit tangent vectors of the surface of genus 2 in the universal cover of SL(2, R): the regular octagon with angles
/// π/4 times |θ| ≤ π. The translations that pair opposite sides shear the fibre along them, and their relation is two
/// turns of it: the Euler number.
pub(super) fn tangents() -> Vec<Face> {
    let (cosh, sinh) = octagon_inradius();
    let side = |f: usize| {
        let n = octagon_normal(f);
        // By twice the inradius, against the normal.
        let by = n * (-2.0 * sinh * cosh);
        glued(n * cosh - DVec4::W * sinh, (f + 4) % 8, sl2::translation(sl2::element(by.x, by.y, 0.0)))
    };
    let cap = |up: f64, partner: usize| {
        // A whole turn leaves the base where it is.
        let turn = Isometry { linear: DMat4::IDENTITY, shift: DVec4::Z * (-up * TAU) };
        glued(DVec4::new(0.0, 0.0, up, -PI), partner, turn)
    };
    (0..8).map(side).chain([cap(1.0, 9), cap(-1.0, 8)]).collect()
}

fn glued(plane: DVec4, partner: usize, pairing: Isometry) -> Face {
    Face { plane, pairing, partner: FaceId { cell: 0, face: partner } }
}
