//! Which deck transformations bring something of an object into a cell.

use super::{WorldError, meshes::RestMesh};
use crate::{
    geometry::{Geodesic, Geometry, Isometry, exponential},
    render::bvh::Aabb,
    space::{deck::Elements, domain::Domain},
};
use glam::{DVec3, DVec4};
use std::collections::VecDeque;

/// Copies of one object, or images of one light, that may be made. A scene that needs more is a mistake in size.
pub const MAX_COPIES: usize = 4096;

/// A way for an object to reach into a cell.
#[derive(Clone, Copy, Debug)]
pub struct Copy {
    /// The cell.
    pub cell: usize,
    /// From the object's coordinates to the cell's.
    pub isometry: Isometry,
}

/// How an object stands to the cell that a copy of it is in.
pub trait Extent<G> {
    /// Whether a part of the copy may lie inside the cell.
    fn reaches_into(&self, geometry: G, domain: &Domain, copy: &Copy) -> bool;
    /// Whether a part of the copy lies beyond this face.
    fn reaches_beyond(&self, geometry: G, domain: &Domain, copy: &Copy, face: usize) -> bool;
}

/// What reaches everywhere.
pub struct Everywhere;

impl<G: Geometry> Extent<G> for Everywhere {
    fn reaches_into(&self, _geometry: G, _domain: &Domain, _copy: &Copy) -> bool {
        true
    }

    fn reaches_beyond(&self, _geometry: G, _domain: &Domain, _copy: &Copy, _face: usize) -> bool {
        true
    }
}

/// Whether a ball of this radius keeps to the chart about its centre. On the sphere a larger one than a hemisphere does
/// not, and its quadric is that of a smaller one about the antipode.
pub fn keeps_to_chart<G: Geometry>(geometry: G, radius: f64) -> bool {
    let base = geometry.base();
    let point = geometry.flow(Geodesic { point: base, velocity: geometry.frame(base)[0] }, radius).point;
    let reached = geometry.distance(base, point) >= (1.0 - 1e-6) * radius;
    reached && geometry.unchart(geometry.chart(point)).is_none_or(|back| back.dot(point) >= 0.0)
}

/// All copies of an object whose coordinates are those of `cell` (where its anchor lies).
///
/// # Errors
/// [`WorldError::TooManyCopies`] above [`MAX_COPIES`].
pub fn copies<G: Geometry>(
    geometry: G,
    domain: &Domain,
    cell: usize,
    extent: &impl Extent<G>,
    name: &str,
) -> Result<Vec<Copy>, WorldError> {
    let mut elements = Elements::new(geometry, domain, cell);
    let mut found = Vec::new();
    let mut queue = VecDeque::from([0]);
    while let Some(index) = queue.pop_front() {
        let element = elements.list[index];
        let copy = Copy { cell: element.cell, isometry: element.isometry };
        if extent.reaches_into(geometry, domain, &copy) {
            found.push(copy);
        } else if index != 0 {
            continue;
        }
        for face in domain.cells[copy.cell].clone() {
            if extent.reaches_beyond(geometry, domain, &copy, face)
                && let (next, true) = elements.cross(domain, index, face)
            {
                queue.push_back(next);
            }
        }
        if found.len() > MAX_COPIES {
            return Err(WorldError::TooManyCopies(name.to_owned(), MAX_COPIES));
        }
    }
    Ok(found)
}

/// A mesh, carried from its rest by an isometry.
pub struct Corners<'a> {
    /// The mesh.
    pub rest: &'a RestMesh,
    /// The isometry.
    pub carried: Isometry,
}

impl Corners<'_> {
    fn isometry<G: Geometry>(&self, geometry: G, copy: &Copy) -> Isometry {
        geometry.compose(&copy.isometry, &self.carried)
    }
}

/// Whether something lies beyond one of a cell's faces, by a test for each plane.
pub fn beyond_one_face(domain: &Domain, cell: usize, beyond: impl Fn(DVec4) -> bool) -> bool {
    domain.cells[cell].clone().any(|face| beyond(domain.faces[face].plane))
}

/// Whether all points lie beyond one and the same face.
pub fn all_beyond_one_face<G: Geometry>(geometry: G, domain: &Domain, cell: usize, points: &[DVec4]) -> bool {
    beyond_one_face(domain, cell, |plane| points.iter().all(|p| geometry.side(*p, plane) > TOUCHING))
}

/// A copy that only touches the cell counts as reaching into it.
pub const TOUCHING: f64 = 1e-5;

impl<G: Geometry> Extent<G> for Corners<'_> {
    fn reaches_into(&self, geometry: G, domain: &Domain, copy: &Copy) -> bool {
        let isometry = self.isometry(geometry, copy);
        self.rest.triangles.iter().any(|triangle| {
            let vertex = |i: u32| self.rest.vertices[i as usize].point;
            let points = triangle.corners.map(|i| geometry.apply(&isometry, at(vertex(i))).point);
            !all_beyond_one_face(geometry, domain, copy.cell, &points)
        })
    }

    fn reaches_beyond(&self, geometry: G, domain: &Domain, copy: &Copy, face: usize) -> bool {
        let plane = domain.faces[face].plane;
        let isometry = self.isometry(geometry, copy);
        let side = |p: DVec4| geometry.side(geometry.apply(&isometry, at(p)).point, plane);
        self.rest.vertices.iter().any(|vertex| side(vertex.point) > -TOUCHING)
    }
}

/// A union of metric balls.
pub struct Balls<'a> {
    /// Centres, in the model.
    pub centres: &'a [DVec4],
    /// The radius of all.
    pub radius: f64,
}

impl Balls<'_> {
    /// For one ball: beyond the plane altogether (1), cut by it (0), or inside altogether (−1).
    fn side<G: Geometry>(&self, geometry: G, centre: DVec4, plane: DVec4) -> i32 {
        // A plane touches the quadric exactly if it is on the dual quadric (inverse matrix).
        let dual = geometry.ball(centre, self.radius).map(|ball| plane.dot(ball.dual() * plane));
        if !dual.is_some_and(|dual| dual < -1e-9) {
            0
        } else if geometry.side(centre, plane) > 0.0 {
            1
        } else {
            -1
        }
    }

    /// Indices of those that reach into the cell of a copy.
    pub fn inside<G: Geometry>(&self, geometry: G, domain: &Domain, copy: &Copy) -> impl Iterator<Item = usize> {
        (0..self.centres.len()).filter(move |i| {
            let centre = geometry.apply(&copy.isometry, at(self.centres[*i])).point;
            domain.cells[copy.cell].clone().all(|f| self.side(geometry, centre, domain.faces[f].plane) <= 0)
        })
    }
}

impl<G: Geometry> Extent<G> for Balls<'_> {
    fn reaches_into(&self, geometry: G, domain: &Domain, copy: &Copy) -> bool {
        self.inside(geometry, domain, copy).next().is_some()
    }

    fn reaches_beyond(&self, geometry: G, domain: &Domain, copy: &Copy, face: usize) -> bool {
        let plane = domain.faces[face].plane;
        self.centres.iter().any(|centre| {
            let centre = geometry.apply(&copy.isometry, at(*centre)).point;
            self.side(geometry, centre, plane) >= 0
        })
    }
}

/// A metric ball that is no quadric, by points of its surface.
pub struct Sphere {
    points: Vec<DVec4>,
}

impl Sphere {
    /// Points of the sphere, so many that their hull is within [`SPHERE_SLACK`] of the ball.
    pub fn new<G: Geometry>(geometry: G, centre: DVec4, radius: f64) -> Self {
        const COUNT: usize = 400;
        let axes = geometry.frame(centre);
        // A spiral of points with equal areas (Saff and Kuijlaars, Distributing many points on a sphere, 1997).
        let point = |i: usize| {
            let z = 1.0 - (2.0 * i as f64 + 1.0) / COUNT as f64;
            let (sin, cos) = (i as f64 * std::f64::consts::PI * (3.0 - 5.0_f64.sqrt())).sin_cos();
            let across = (1.0 - z * z).sqrt();
            exponential(geometry, centre, (axes[0] * (cos * across) + axes[1] * (sin * across) + axes[2] * z) * radius)
        };
        Self { points: (0..COUNT).map(point).collect() }
    }

    /// The box of a copy in its cell's chart; all of the chart where the ball leaves the numbers.
    pub fn bounds<G: Geometry>(&self, geometry: G, copy: &Copy) -> Aabb {
        let place = |p: &DVec4| geometry.chart(geometry.apply(&copy.isometry, at(*p)).point);
        let places: Vec<DVec3> = self.points.iter().map(place).collect();
        if !places.iter().all(|place| place.is_finite()) {
            return Aabb::EVERYTHING;
        }
        let Aabb { lower, upper } = Aabb::around(places);
        let slack = SPHERE_SLACK * (upper - lower);
        Aabb { lower: lower - slack, upper: upper + slack }
    }

    /// Range of the plane's form over the ball; unbounded where the ball leaves the numbers.
    fn sides<G: Geometry>(&self, geometry: G, copy: &Copy, plane: DVec4) -> [f64; 2] {
        let side = |p: &DVec4| geometry.side(geometry.apply(&copy.isometry, at(*p)).point, plane);
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for side in self.points.iter().map(side) {
            if !side.is_finite() {
                return [f64::NEG_INFINITY, f64::INFINITY];
            }
            range = [range[0].min(side), range[1].max(side)];
        }
        let slack = SPHERE_SLACK * (range[1] - range[0]);
        [range[0] - slack, range[1] + slack]
    }
}

/// How far a ball may reach beyond the points of its sphere, in units of its width.
const SPHERE_SLACK: f64 = 0.01;

impl<G: Geometry> Extent<G> for Sphere {
    fn reaches_into(&self, geometry: G, domain: &Domain, copy: &Copy) -> bool {
        domain.cells[copy.cell].clone().all(|f| self.sides(geometry, copy, domain.faces[f].plane)[0] <= 0.0)
    }

    fn reaches_beyond(&self, geometry: G, domain: &Domain, copy: &Copy, face: usize) -> bool {
        self.sides(geometry, copy, domain.faces[face].plane)[1] >= 0.0
    }
}

/// A point as a state, for `apply`.
fn at(point: DVec4) -> crate::geometry::Geodesic {
    crate::geometry::Geodesic { point, velocity: DVec4::ZERO }
}
