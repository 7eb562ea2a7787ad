//! Deck transformations in whole numbers.
//!
//! Where isometries act on points by matrices, and the deck group keeps a lattice of R⁴, pairings are matrices of integers
//! in a basis of that lattice, and products of any number of them are exact. The lattice is the one that the orbit of the
//! base point spans: in the coordinates (x, y, z, 1) of flat spaces it comes from their translations; for the integer
//! Heisenberg group it is Z⁴; for a torus bundle with the eigenvalues φ^{±2} of Sol it is a module of rank two over `Z[φ]`
//! next to the heights and the ones, and pairs of integers are numbers of `Z[φ]`. A group without such a lattice, as those
//! of most hyperbolic spaces, has dense orbits in R⁴: then vectors without end get shorter, and there is no lattice.

use crate::{
    geometry::{Geodesic, Geometry, Isometry, exponential},
    space::domain::DomainFace,
};
use glam::{DMat4, DVec4};

/// A coordinate this near to a whole number is one, in units of the largest number around; what is farther than
/// [`SHARED`] away, and only that, is a fraction. In between the numbers say nothing.
const WHOLE: f64 = 1e-9;
const SHARED: f64 = 1e-3;

/// Vectors of the orbit that are looked at for four independent ones.
const MAX_VECTORS: usize = 256;

/// A vector with such a share outside of the span of others is independent of them.
const INDEPENDENT: f64 = 1e-3;

/// Times that a basis is made finer. Each halves its volume at least.
const MAX_REFINEMENTS: usize = 24;

/// Entries of pairings beyond this are not taken for exact.
const MAX_ENTRY: f64 = 1e9;

/// A matrix of integers, row by row.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Integers(pub [[i128; 4]; 4]);

impl Integers {
    /// The identity.
    pub const IDENTITY: Self = Self([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]);

    /// `self` after `first`; `None` where a number outgrows 128 bits.
    pub fn after(&self, first: &Self) -> Option<Self> {
        let mut product = [[0_i128; 4]; 4];
        for (row, out) in self.0.iter().zip(&mut product) {
            for (column, entry) in out.iter_mut().enumerate() {
                for (k, factor) in row.iter().enumerate() {
                    *entry = entry.checked_add(factor.checked_mul(first.0[k][column])?)?;
                }
            }
        }
        Some(Self(product))
    }
}

/// The pairings of a space in whole numbers.
#[derive(Clone, Debug)]
pub struct Lattice {
    /// A basis of the lattice, as columns.
    pub basis: DMat4,
    /// The pairings in it, in the order of the domain's faces.
    pub pairings: Vec<Integers>,
}

impl Lattice {
    /// The lattice that pairings keep, if there is one.
    pub fn new<G: Geometry>(geometry: G, faces: &[DomainFace]) -> Option<Self> {
        let pairings: Vec<&Isometry> = faces.iter().map(|face| &face.pairing).collect();
        // Isometries must move points as their matrices do.
        let witnesses = witnesses(geometry);
        let plain = |m: &&Isometry| {
            witnesses.iter().all(|&point| {
                let image = geometry.apply(m, Geodesic { point, velocity: DVec4::ZERO }).point;
                (image - m.linear * point).abs().max_element() <= WHOLE * (1.0 + image.abs().max_element())
            })
        };
        if !pairings.iter().all(plain) {
            return None;
        }
        let mut basis = independent(geometry.base(), &pairings)?;
        let mut refinements = 0;
        while let Some(vector) = outside(basis, &pairings)? {
            let mut left = vec![vector];
            while let Some(vector) = left.pop() {
                let Some((axis, rest)) = fraction(basis, vector)? else { continue };
                left.push(*basis.col_mut(axis));
                *basis.col_mut(axis) = basis * rest;
                refinements += 1;
                if refinements > MAX_REFINEMENTS {
                    return None;
                }
            }
        }
        let integers = |m: &&Isometry| {
            let matrix = basis.inverse() * m.linear * basis;
            let entry = |row: usize, column: usize| {
                let x = matrix.col(column)[row];
                (x.abs() < MAX_ENTRY).then(|| x.round() as i128)
            };
            let mut rows = [[0; 4]; 4];
            for (row, out) in rows.iter_mut().enumerate() {
                for (column, number) in out.iter_mut().enumerate() {
                    *number = entry(row, column)?;
                }
            }
            Some(Integers(rows))
        };
        let pairings = pairings.iter().map(integers).collect::<Option<_>>()?;
        Some(Self { basis, pairings })
    }

    /// The element behind a row of faces, indices into the domain's list, from the first one crossed to the last; `None`
    /// where a number outgrows 128 bits.
    pub fn word(&self, faces: impl IntoIterator<Item = usize>) -> Option<Integers> {
        faces.into_iter().try_fold(Integers::IDENTITY, |element, face| self.pairings[face].after(&element))
    }
}

/// Points in general position about the base point.
fn witnesses<G: Geometry>(geometry: G) -> [DVec4; 6] {
    let base = geometry.base();
    let [x, y, z] = geometry.frame(base);
    let steps =
        [[0.3, 0.1, 0.2], [-0.2, 0.3, 0.1], [0.1, -0.3, 0.2], [0.2, 0.2, -0.3], [-0.1, -0.2, -0.2], [0.4, -0.1, 0.1]];
    steps.map(|[a, b, c]| exponential(geometry, base, x * a + y * b + z * c))
}

/// Four independent vectors of the orbit.
fn independent(base: DVec4, pairings: &[&Isometry]) -> Option<DMat4> {
    let mut orbit = vec![base];
    let mut next = 0;
    // Gram–Schmidt keeps what each vector has outside of those before it.
    let (mut chosen, mut normals): (Vec<DVec4>, Vec<DVec4>) = (Vec::new(), Vec::new());
    while let Some(&v) = orbit.get(next) {
        next += 1;
        let rest = normals.iter().fold(v, |rest, n| rest - *n * n.dot(rest));
        if rest.length() > INDEPENDENT * v.length() {
            chosen.push(v);
            normals.push(rest.normalize());
        }
        if let [a, b, c, d] = chosen[..] {
            return Some(DMat4::from_cols(a, b, c, d));
        }
        for image in pairings.iter().map(|m| m.linear * v) {
            let near = WHOLE * (1.0 + image.abs().max_element());
            if orbit.len() < MAX_VECTORS && orbit.iter().all(|v| (*v - image).abs().max_element() > near) {
                orbit.push(image);
            }
        }
    }
    None
}

/// An image of a vector of the basis that the basis does not reach with whole numbers; the inner `None` where there is no
/// such image, the outer one where numbers do not tell.
#[allow(clippy::option_option)]
fn outside(basis: DMat4, pairings: &[&Isometry]) -> Option<Option<DVec4>> {
    for m in pairings {
        for axis in 0..4 {
            let image = m.linear * basis.col(axis);
            if fraction(basis, image)?.is_some() {
                return Some(Some(image));
            }
        }
    }
    Some(None)
}

/// The axis with the largest fraction among a vector's coordinates, and the fractions; the inner `None` where all
/// coordinates are whole, the outer one where numbers do not tell.
#[allow(clippy::option_option)]
fn fraction(basis: DMat4, vector: DVec4) -> Option<Option<(usize, DVec4)>> {
    let coordinates = basis.inverse() * vector;
    let rest = coordinates - coordinates.round();
    let size = 1.0 + coordinates.abs().max_element();
    let axis = (0..4).max_by(|&a, &b| rest[a].abs().total_cmp(&rest[b].abs()))?;
    match rest[axis].abs() {
        largest if largest <= WHOLE * size => Some(None),
        largest if largest >= SHARED => {
            // Noise on the others would be taken for fractions in the next round.
            let clean = |x: f64| if x.abs() <= WHOLE * size { 0.0 } else { x };
            Some(Some((axis, DVec4::from_array(rest.to_array().map(clean)))))
        }
        _ => None,
    }
}
