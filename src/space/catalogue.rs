//! The named spaces, computed from formulas.
//!
//! Regular cells are given by their face normals and one dihedral angle. With the planes `(c n, −s)` of
//! `regular_faces` and α the angle of two neighbouring normals, the dihedral angle δ satisfies
//! c² = (1 + cos δ) / (1 − cos α), where c is cos r in the sphere and cosh r in hyperbolic space, r the inradius:
//! one formula for both, from ⟨Pᵢ, Pⱼ⟩ = −cos δ with the form diag(1, 1, 1, κ) and ⟨Pᵢ, Pᵢ⟩ = 1.

mod bundles;
mod eight_cubes;
mod flat;
mod products;

use super::{Cell, Face, FaceId, Space};
use crate::geometry::{GeometryId, Isometry, sl2_trace};
use glam::{DMat3, DMat4, DVec3, DVec4};
use std::f64::consts::PI;

/// A named space.
#[derive(Debug)]
pub struct Entry {
    /// Name in scenes and on the command line.
    pub name: &'static str,
    /// What it is, in a few words.
    pub title: &'static str,
    /// Its geometry and the faces of its cells.
    build: fn() -> (GeometryId, Vec<Vec<Face>>),
}

/// All named spaces.
pub const SPACES: &[Entry] = &[
    Entry { name: "torus", title: "flat three-torus, the unit cube with opposite faces glued", build: torus },
    Entry { name: "mirrored-cube", title: "flat orbifold, the unit cube with mirrors for faces", build: mirrored_cube },
    Entry {
        name: "half-turn",
        title: "flat manifold, the unit cube with top and bottom glued by a turn of π",
        build: || (GeometryId::E3, vec![flat::prism(4, 2)]),
    },
    Entry {
        name: "quarter-turn",
        title: "flat manifold, the unit cube with top and bottom glued by a turn of π/2",
        build: || (GeometryId::E3, vec![flat::prism(4, 4)]),
    },
    Entry {
        name: "third-turn",
        title: "flat manifold, a hexagonal prism with top and bottom glued by a turn of 2π/3",
        build: || (GeometryId::E3, vec![flat::prism(6, 3)]),
    },
    Entry {
        name: "sixth-turn",
        title: "flat manifold, a hexagonal prism with top and bottom glued by a turn of π/3",
        build: || (GeometryId::E3, vec![flat::prism(6, 6)]),
    },
    Entry {
        name: "hantzsche-wendt",
        title: "flat manifold, a rhombic dodecahedron glued by half turns about three directions",
        build: || (GeometryId::E3, vec![flat::hantzsche_wendt()]),
    },
    Entry {
        name: "poincare",
        title: "Poincaré dodecahedral space, opposite faces glued by a turn of π/5",
        build: poincare,
    },
    Entry {
        name: "seifert-weber",
        title: "Seifert–Weber space, opposite faces of a hyperbolic dodecahedron glued by a turn of 3π/5",
        build: seifert_weber,
    },
    Entry {
        name: "mirrored-dodecahedron",
        title: "hyperbolic orbifold, the right-angled dodecahedron with mirrors for faces",
        build: mirrored_dodecahedron,
    },
    Entry {
        name: "s3",
        title: "the whole three-sphere, glued from eight cubes",
        build: || (GeometryId::S3, eight_cubes::cells()),
    },
    Entry {
        name: "s2xs1",
        title: "the sphere times a circle of length 1",
        build: || (GeometryId::S2xR, products::sphere(true)),
    },
    Entry {
        name: "genus2xs1",
        title: "the surface of genus 2 from a regular octagon, times a circle of length 1",
        build: || (GeometryId::H2xR, vec![products::genus_two()]),
    },
    Entry {
        name: "nil-heisenberg",
        title: "Nil by the integer Heisenberg group, a unit cube that is sheared across x",
        build: || (GeometryId::Nil, vec![bundles::heisenberg()]),
    },
    Entry {
        name: "sol-golden",
        title: "Sol by the torus bundle of [[2, 1], [1, 1]], a square torus times 2 ln φ",
        build: || (GeometryId::Sol, vec![bundles::golden()]),
    },
    Entry {
        name: "sl2-genus2-tangent",
        title: "the unit tangent vectors of the surface of genus 2, an octagon times a turn of the fibre",
        build: || (GeometryId::Sl2, vec![bundles::tangents()]),
    },
];

/// The names of [`SPACES`], in its order.
pub const NAMES: &[&str] = &{
    let mut names = [""; SPACES.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = SPACES[i].name;
        i += 1;
    }
    names
};

/// The space with this name.
pub fn find(name: &str) -> Option<Space> {
    let entry = SPACES.iter().find(|entry| entry.name == name)?;
    let (geometry, cells) = (entry.build)();
    let cells = cells.into_iter().map(|faces| Cell { faces }).collect();
    Some(Space { name: entry.name.to_owned(), geometry, cells })
}

/// The whole of a model geometry: where one chart does not show all of it, several cells, else one without faces.
pub fn whole(geometry: GeometryId) -> Space {
    let cells = match geometry {
        GeometryId::S3 => eight_cubes::cells(),
        GeometryId::S2xR => products::sphere(false),
        GeometryId::Sl2Trace => vec![vec![wall()]],
        _ => vec![Vec::new()],
    };
    let cells = cells.into_iter().map(|faces| Cell { faces }).collect();
    Space { name: geometry.name().to_owned(), geometry, cells }
}

/// A wall in front of the edge x = −1 of the chart, before which walks would take ever shorter steps. What passes it is
/// taken further out, so that a walk ends there.
fn wall() -> Face {
    const BEFORE: f64 = 0.01;
    let outwards = sl2_trace::translation(DVec3::new(-0.1, 0.0, 0.0));
    Face { plane: DVec4::new(-1.0, 0.0, 0.0, BEFORE - 1.0), pairing: outwards, partner: FaceId { cell: 0, face: 0 } }
}

/// Unit cube `[0, 1]³`, faces `x = 1, x = 0, y = 1, …`, unit translations.
fn torus() -> (GeometryId, Vec<Vec<Face>>) {
    let faces = (0..6).map(|f| {
        let normal = signed_axis(f);
        let offset = if f.is_multiple_of(2) { -1.0 } else { 0.0 };
        paired(normal.extend(offset), f ^ 1, DMat4::from_translation(-normal))
    });
    (GeometryId::E3, vec![faces.collect()])
}

/// Cube of side 1 about the base point, faces `x = ½, x = −½, y = ½, …`, reflections.
fn mirrored_cube() -> (GeometryId, Vec<Vec<Face>>) {
    let faces = (0..6).map(|f| {
        let normal = signed_axis(f);
        // x ↦ x − 2 (n·x − ½) n.
        let axis = normal.extend(0.0);
        let reflection = DMat4::IDENTITY - 2.0 * outer(axis, axis) + outer(axis, DVec4::W);
        paired(normal.extend(-0.5), f, reflection)
    });
    (GeometryId::E3, vec![faces.collect()])
}

// Dihedral angle 2π/3: three cells round an edge.
fn poincare() -> (GeometryId, Vec<Vec<Face>>) {
    (GeometryId::S3, vec![regular_faces(Form::SPHERE, -0.5, Some(PI / 5.0))])
}

// Dihedral angle 2π/5, whose cosine is 1/(2φ): five cells round an edge.
fn seifert_weber() -> (GeometryId, Vec<Vec<Face>>) {
    (GeometryId::H3, vec![regular_faces(Form::HYPERBOLOID, 0.5 / golden_ratio(), Some(3.0 * PI / 5.0))])
}

// Right angles: four cells round an edge.
fn mirrored_dodecahedron() -> (GeometryId, Vec<Vec<Face>>) {
    (GeometryId::H3, vec![regular_faces(Form::HYPERBOLOID, 0.0, None)])
}

/// The form diag(1, 1, 1, κ) of R⁴ whose unit vectors are the model.
struct Form {
    kappa: f64,
}

impl Form {
    const SPHERE: Self = Self { kappa: 1.0 };
    const HYPERBOLOID: Self = Self { kappa: -1.0 };
}

/// The faces of the regular dodecahedron with this cosine of the dihedral angle (given as such because the
/// rounding of the angle would cost a digit), opposite ones paired by the shortest translation after a turn
/// about the direction of travel, or mirrors where no turn is given.
fn regular_faces(form: Form, dihedral_cos: f64, turn: Option<f64>) -> Vec<Face> {
    let normals = dodecahedron_normals();
    let neighbours_cos = 1.0 / 5.0_f64.sqrt();
    let c2 = (1.0 + dihedral_cos) / (1.0 - neighbours_cos);
    let s2 = form.kappa * (1.0 - c2);
    let (c, s) = (c2.sqrt(), s2.sqrt());
    // Opposite faces lie twice the inradius apart.
    let (translation_c, translation_s) = (2.0 * c2 - 1.0, 2.0 * c * s);

    let faces = normals.iter().enumerate().map(|(f, &normal)| {
        let plane = (normal * c).extend(-s);
        match turn {
            Some(turn) => {
                let n = normal.extend(0.0);
                let turned = turn_about(-normal, turn);
                let travel = (outer(n, n) + outer(DVec4::W, DVec4::W)) * translation_c
                    + (outer(DVec4::W, n) * form.kappa - outer(n, DVec4::W)) * translation_s;
                paired(plane, opposite(f), turned + travel)
            }
            None => {
                let raised = DVec4::new(plane.x, plane.y, plane.z, plane.w * form.kappa);
                paired(plane, f, DMat4::IDENTITY - 2.0 * outer(raised, plane))
            }
        }
    });
    faces.collect()
}

/// The part of a right-handed turn that acts across its axis; zero along the axis and on the last coordinate.
fn turn_about(axis: DVec3, angle: f64) -> DMat4 {
    let (sin, cos) = angle.sin_cos();
    let cross = DMat3::from_cols(axis.cross(DVec3::X), axis.cross(DVec3::Y), axis.cross(DVec3::Z));
    let along = DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
    let across = (DMat3::IDENTITY - along) * cos + cross * sin;
    DMat4::from_cols(across.x_axis.extend(0.0), across.y_axis.extend(0.0), across.z_axis.extend(0.0), DVec4::ZERO)
}

fn golden_ratio() -> f64 {
    0.5 * (1.0 + 5.0_f64.sqrt())
}

/// Unit face normals of the regular dodecahedron: the even permutations of (0, ±1, ±φ).
fn dodecahedron_normals() -> [DVec3; 12] {
    let golden = golden_ratio();
    let length = golden.hypot(1.0);
    std::array::from_fn(|f| {
        let short = if f / 6 == 0 { 1.0 } else { -1.0 } / length;
        let long = if (f / 3).is_multiple_of(2) { golden } else { -golden } / length;
        match f % 3 {
            0 => DVec3::new(0.0, short, long),
            1 => DVec3::new(short, long, 0.0),
            _ => DVec3::new(long, 0.0, short),
        }
    })
}

/// Index of the face opposite to `f` in [`dodecahedron_normals`].
fn opposite(f: usize) -> usize {
    3 * (3 - f / 3) + f % 3
}

/// `x, −x, y, −y, z, −z`.
fn signed_axis(f: usize) -> DVec3 {
    let axis = [DVec3::X, DVec3::Y, DVec3::Z][f / 2];
    // Not a product with −1, which would leave zeros with a sign.
    if f.is_multiple_of(2) { axis } else { DVec3::ZERO - axis }
}

fn paired(plane: DVec4, partner: usize, pairing: DMat4) -> Face {
    Face { plane, pairing: Isometry::linear(pairing), partner: FaceId { cell: 0, face: partner } }
}

/// The matrix `u vᵀ`.
fn outer(u: DVec4, v: DVec4) -> DMat4 {
    DMat4::from_cols(u * v.x, u * v.y, u * v.z, u * v.w)
}
