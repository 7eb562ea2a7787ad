//! Cells of products of a surface with a line or a circle.

use super::{outer, paired, signed_axis};
use crate::{
    geometry::Isometry,
    space::{Face, FaceId},
};
use glam::{DMat4, DVec4};

/// The sphere times a circle of length 1, or times the whole line: six cells, the faces of a cube seen from its centre,
/// because a hemisphere is as much as a chart shows. Faces `X = 1, X = −1, Y = 1, Y = −1` of each, then z = ±½.
pub(super) fn sphere(closed: bool) -> Vec<Vec<Face>> {
    // Cell s + 2i has its centre at the coordinate vector i of (x, y, w), negative for odd s; its own axes are the
    // next two, turned so that all cells are oriented alike.
    let axes = [DVec4::X, DVec4::Y, DVec4::W];
    let from_cell = |cell: usize| {
        let (i, sign) = (cell / 2, if cell.is_multiple_of(2) { 1.0 } else { -1.0 });
        DMat4::from_cols(axes[(i + 1) % 3], axes[(i + 2) % 3] * sign, DVec4::Z, axes[i] * sign)
    };
    let cell = |a: usize| {
        let mut faces: Vec<Face> = (0..4)
            .map(|f| {
                let normal = signed_axis(f).extend(0.0);
                // The neighbour's centre lies in the direction of the face, and this cell's in that of the partner.
                let towards = from_cell(a) * normal;
                let b = (0..6).find(|&b| from_cell(b).w_axis == towards).unwrap_or(a);
                let pairing = from_cell(b).transpose() * from_cell(a);
                let back = pairing * DVec4::W;
                let face = (0..4).find(|&g| signed_axis(g).extend(0.0) == back).unwrap_or(f);
                Face {
                    plane: (normal - DVec4::W) / 2.0_f64.sqrt(),
                    pairing: Isometry::linear(pairing),
                    partner: FaceId { cell: b, face },
                }
            })
            .collect();
        if closed {
            faces.extend(slab_faces(a, 4));
        }
        faces
    };
    (0..6).map(cell).collect()
}

/// The regular octagon with angles π/4 times |z| ≤ ½, opposite sides paired by translations.
pub(super) fn genus_two() -> Vec<Face> {
    let (cosh, sinh) = octagon_inradius();
    // Opposite sides lie twice the inradius apart.
    let (far_cosh, far_sinh) = (2.0 * cosh * cosh - 1.0, 2.0 * cosh * sinh);
    let side = |f: usize| {
        let n = octagon_normal(f);
        let travel = (outer(n, n) + outer(DVec4::W, DVec4::W)) * (far_cosh - 1.0)
            - (outer(n, DVec4::W) + outer(DVec4::W, n)) * far_sinh;
        paired(n * cosh - DVec4::W * sinh, (f + 4) % 8, DMat4::IDENTITY + travel)
    };
    (0..8).map(side).chain(slab_faces(0, 8)).collect()
}

/// cosh r and sinh r of the inradius of the regular octagon with angles π/4: cosh r = 1 + √2 = cot(π/8).
pub(super) fn octagon_inradius() -> (f64, f64) {
    let cosh = 1.0 + 2.0_f64.sqrt();
    (cosh, (cosh * cosh - 1.0).sqrt())
}

/// Unit normal of a side of an octagon, against the clock from x.
pub(super) fn octagon_normal(side: usize) -> DVec4 {
    let diagonal = 0.5_f64.sqrt();
    let normal = match side % 4 {
        0 => DVec4::X,
        1 => DVec4::new(diagonal, diagonal, 0.0, 0.0),
        2 => DVec4::Y,
        _ => DVec4::new(-diagonal, diagonal, 0.0, 0.0),
    };
    // Not a product with −1, which would leave zeros with a sign.
    if side < 4 { normal } else { DVec4::ZERO - normal }
}

/// The faces z = ½ and z = −½ of a cell, glued by the shift by 1; the first of them has the index `first`.
fn slab_faces(cell: usize, first: usize) -> [Face; 2] {
    [1.0, -1.0].map(|up| Face {
        plane: DVec4::new(0.0, 0.0, up, -0.5),
        pairing: Isometry { linear: DMat4::IDENTITY, shift: DVec4::Z * -up },
        partner: FaceId { cell, face: if up > 0.0 { first + 1 } else { first } },
    })
}
