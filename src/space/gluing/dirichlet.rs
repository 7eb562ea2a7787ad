//! Dirichlet domains: the points that are nearer to the base point than to any of its images under a group.
//!
//! Each element γ of the group cuts the domain by the bisector of the base point and its image; the face there is
//! paired by γ⁻¹. The elements that matter are found by growing a set: products of two elements that make faces
//! are brought back into the present polyhedron by the faces they lie beyond, and whatever still cuts it joins
//! (Riley, *Applications of a computer implementation of Poincaré's theorem*, 1983). When nothing cuts any more
//! every generator is a product of face elements, and the caller's check of the gluing, which is Poincaré's
//! theorem, proves that the polyhedron is the domain of exactly this group: elements that move the base point
//! farther than twice the circumradius could not reach it, and none of the nearer ones is missing.

use crate::geometry::{Geometry, GeometryId, Isometry, Visitor, visit};
use crate::space::check::{TOLERANCE, deviation, image, largest, within};
use crate::space::polyhedron::{Polyhedron, PolyhedronError};
use crate::space::{Cell, Face, FaceId};
use glam::{DVec4, Vec4Swizzles};

/// An element that moves the base point by less than this, in units of the largest move of a generator, means
/// that the group is not discrete.
const SMALLEST_MOVE: f64 = 1e-6;

/// Two elements with smaller differences, in units of their largest number (or of the generators' moves, where these
/// are small), are the same.
const SAME_ELEMENT: f64 = 1e-6;

/// Moves below this are none.
const NO_MOVE: f64 = 1e-9;

/// Products that are isometries no better than this are left out. They are long words, of elements that move the
/// base point far; the generators themselves may come with fewer digits.
const ROUNDED_AWAY: f64 = 1e-7;

/// A bisector must cut this much off a corner, in units of the circumradius, to count.
const SMALLEST_CUT: f64 = 1e-7;

/// Rounds of products before giving up. A round doubles the length of the words that are tried.
const MAX_ROUNDS: usize = 16;

/// Rounds of products that may pass until the bisectors bound anything.
const MAX_OPEN_ROUNDS: usize = 5;

/// While the polyhedron is open, products are made of this many elements: generators, then what moves the base
/// point least.
const MAX_OPEN_FACTORS: usize = 48;

/// While the polyhedron is open, elements kept beside the generators.
const MAX_OPEN_ELEMENTS: usize = 128;

/// Faces by which an element is brought back, at most.
const MAX_STEPS: usize = 4096;

/// Why generators have no Dirichlet domain that could be found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DirichletError {
    /// A generator that is no isometry.
    #[error("generators[{index}]: not an isometry (residual {residual:.3e})")]
    NotAnIsometry {
        /// Its index.
        index: usize,
        /// Deviation from the defining relation.
        residual: f64,
    },
    /// A generator that leaves the model.
    #[error("generators[{index}]: takes the base point off the model")]
    OffTheModel {
        /// Its index.
        index: usize,
    },
    /// The stabiliser of the base point is not trivial.
    #[error(
        "the base point is fixed by an element of the group other than the identity: conjugate the generators so that \
         it is not on a mirror or an axis"
    )]
    FixesTheBase,
    /// The orbit of the base point has points too close to each other.
    #[error("the group is not discrete: an element moves the base point by only {distance:.3e}")]
    NotDiscrete {
        /// Distance of the base point and its image.
        distance: f64,
    },
    /// No compact domain found.
    #[error(
        "the Dirichlet domain is not bounded in the chart after {elements} elements of the group: the quotient is not \
         compact, or the cell does not fit into the chart"
    )]
    NotCompact {
        /// Elements looked at.
        elements: usize,
    },
    /// The search ended with a polyhedron that is no domain.
    #[error(
        "no Dirichlet domain found: the nearest elements of the group bound a polyhedron whose faces have no partners"
    )]
    Unpaired,
    /// The search did not end.
    #[error("no Dirichlet domain found: after {rounds} rounds of products new faces still appear")]
    Endless {
        /// Rounds of products.
        rounds: usize,
    },
    /// The bisectors nearly coincide.
    #[error("the bisectors of the group bound no clean polyhedron: {0}")]
    Shape(PolyhedronError),
}

/// The Dirichlet domain of the base point under the group with these generators.
pub(super) fn domain(geometry: GeometryId, generators: &[Isometry]) -> Result<Cell, DirichletError> {
    struct Domain<'a>(&'a [Isometry]);
    impl Visitor for Domain<'_> {
        type Output = Result<Cell, DirichletError>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            Search::new(geometry, self.0)?.run()
        }
    }
    visit(geometry, Domain(generators))
}

/// An element of the group that moves the base point.
#[derive(Clone, Copy, Debug)]
struct Element {
    isometry: Isometry,
    /// How far it moves the base point.
    displacement: f64,
    /// Bisector of the base point and its image; `None` where it does not meet the chart.
    plane: Option<DVec4>,
}

struct Search<G> {
    geometry: G,
    generators: Vec<Element>,
    /// Largest displacement of a generator.
    scale: f64,
}

impl<G: Geometry> Search<G> {
    fn new(geometry: G, generators: &[Isometry]) -> Result<Self, DirichletError> {
        let base = geometry.base();
        let mut scale = 0.0_f64;
        for (index, m) in generators.iter().enumerate() {
            let residual = geometry.isometry_residual(m);
            if !within(residual, TOLERANCE * largest(m).max(1.0).powi(2)) {
                return Err(DirichletError::NotAnIsometry { index, residual });
            }
            let moved = image(geometry, m, base);
            let gap = geometry.settle(moved).map_or(f64::NAN, |p| (p - moved).abs().max_element());
            if !within(gap, TOLERANCE * largest(m).max(1.0)) {
                return Err(DirichletError::OffTheModel { index });
            }
            scale = scale.max(geometry.distance(base, moved));
        }
        let mut search = Self { geometry, generators: Vec::new(), scale };
        let mut elements = Vec::new();
        for m in generators {
            search.add(&mut elements, *m)?;
            search.add(&mut elements, geometry.inverse(m))?;
        }
        search.generators = elements;
        Ok(search)
    }

    /// The element, unless it is the identity or a product so long that rounding has eaten it.
    fn element(&self, isometry: Isometry) -> Result<Option<Element>, DirichletError> {
        if !within(self.geometry.isometry_residual(&isometry), ROUNDED_AWAY) {
            return Ok(None);
        }
        let base = self.geometry.base();
        let moved = image(self.geometry, &isometry, base);
        let displacement = self.geometry.distance(base, moved);
        if !displacement.is_finite() || displacement <= SMALLEST_MOVE * self.scale {
            // Rounding of products grows with their numbers; discrete groups keep far away from it.
            let identity = deviation(&isometry, &Isometry::IDENTITY);
            return if within(identity, self.same(&isometry)) && within(displacement, SMALLEST_MOVE * self.scale) {
                Ok(None)
            } else if within(displacement, NO_MOVE * self.scale) {
                Err(DirichletError::FixesTheBase)
            } else {
                Err(DirichletError::NotDiscrete { distance: displacement })
            };
        }
        let plane = self.geometry.bisector(moved).filter(|p| p.xyz().length() > 1e-9 * p.length());
        Ok(Some(Element { isometry, displacement, plane }))
    }

    /// Largest difference from another isometry that is the same element.
    fn same(&self, isometry: &Isometry) -> f64 {
        SAME_ELEMENT * largest(isometry).max(1.0) * self.scale.min(1.0)
    }

    /// Adds an element to a set that does not have it yet; true if it did.
    fn add(&self, elements: &mut Vec<Element>, isometry: Isometry) -> Result<bool, DirichletError> {
        let limit = self.same(&isometry);
        if elements.iter().any(|e| within(deviation(&e.isometry, &isometry), limit)) {
            return Ok(false);
        }
        let element = self.element(isometry)?;
        elements.extend(element);
        Ok(element.is_some())
    }

    fn run(&self) -> Result<Cell, DirichletError> {
        let (mut faces, mut shape) = self.first_polyhedron()?;
        for _ in 0..MAX_ROUNDS {
            let mut products = self.generators.clone();
            for generator in &self.generators {
                self.add(&mut products, self.brought_back(&faces, generator.isometry))?;
            }
            for a in &faces {
                self.add(&mut products, self.geometry.inverse(&a.isometry))?;
                for b in &faces {
                    let product = self.geometry.compose(&a.isometry, &b.isometry);
                    self.add(&mut products, product)?;
                    self.add(&mut products, self.brought_back(&faces, product))?;
                }
            }
            products.retain(|p| p.plane.is_some_and(|plane| cuts(plane, &shape)));
            if products.is_empty() {
                let Some(stray) = self.unpaired(&faces) else { return Ok(self.cell(faces)) };
                products = self.longer_words(&faces, &shape, stray)?;
                if products.is_empty() {
                    return Err(DirichletError::Unpaired);
                }
            }
            (faces, shape) = self.cut(faces, shape, products)?;
        }
        Err(DirichletError::Endless { rounds: MAX_ROUNDS })
    }

    /// The inverse of a face element that makes no face.
    fn unpaired(&self, faces: &[Element]) -> Option<Isometry> {
        let inverses = faces.iter().map(|e| self.geometry.inverse(&e.isometry));
        let mut missing = inverses.filter(|inverse| {
            let limit = self.same(inverse);
            !faces.iter().any(|e| within(deviation(&e.isometry, inverse), limit))
        });
        missing.next()
    }

    /// Products of the stray inverse of a face element with two others that cut the polyhedron: something does,
    /// where the face lands, unless the group is not discrete.
    fn longer_words(
        &self,
        faces: &[Element],
        shape: &Polyhedron,
        stray: Isometry,
    ) -> Result<Vec<Element>, DirichletError> {
        let mut found = Vec::new();
        for a in faces {
            let first = self.geometry.compose(&stray, &a.isometry);
            for b in faces {
                let product = self.geometry.compose(&first, &b.isometry);
                for word in [product, self.brought_back(faces, product)] {
                    let element = self.element(word)?.filter(|e| e.plane.is_some_and(|plane| cuts(plane, shape)));
                    found.extend(element);
                }
            }
        }
        Ok(found)
    }

    /// A compact polyhedron bounded by bisectors of a few elements, and those elements.
    fn first_polyhedron(&self) -> Result<(Vec<Element>, Polyhedron), DirichletError> {
        let mut elements = self.generators.clone();
        let mut seen = elements.len();
        for _ in 0..MAX_OPEN_ROUNDS {
            // Few bisectors are quick, so try as few as do.
            for count in [0, 8, 16, 32, 64, MAX_OPEN_ELEMENTS] {
                let some = &elements[..elements.len().min(self.generators.len() + count)];
                if let Some((faces, shape)) = self.bounding(some.to_vec())?
                    && shape.vertices.iter().all(|&v| self.geometry.unchart(v).is_some_and(|p| p.is_finite()))
                {
                    return Ok((faces, shape));
                }
            }
            let mut products = elements.clone();
            for a in elements.iter().take(MAX_OPEN_FACTORS) {
                for b in elements.iter().take(MAX_OPEN_FACTORS) {
                    self.add(&mut products, self.geometry.compose(&a.isometry, &b.isometry))?;
                }
            }
            seen += products.len() - elements.len();
            products[self.generators.len()..].sort_by(|a, b| a.displacement.total_cmp(&b.displacement));
            products.truncate(self.generators.len() + MAX_OPEN_ELEMENTS);
            elements = products;
        }
        Err(DirichletError::NotCompact { elements: seen })
    }

    /// Cuts a polyhedron by the bisectors of more elements, the nearest first.
    fn cut(
        &self,
        mut faces: Vec<Element>,
        mut shape: Polyhedron,
        mut more: Vec<Element>,
    ) -> Result<(Vec<Element>, Polyhedron), DirichletError> {
        more.sort_by(|a, b| a.displacement.total_cmp(&b.displacement));
        for element in more {
            if element.plane.is_some_and(|plane| cuts(plane, &shape)) {
                faces.push(element);
                // A cut leaves a bounded polyhedron bounded.
                if let Some(next) = self.bounding(std::mem::take(&mut faces))? {
                    (faces, shape) = next;
                }
            }
        }
        Ok((faces, shape))
    }

    /// The polyhedron of the elements' bisectors and the elements that make its faces; `None` if it is unbounded.
    fn bounding(&self, mut elements: Vec<Element>) -> Result<Option<(Vec<Element>, Polyhedron)>, DirichletError> {
        elements.retain(|e| e.plane.is_some());
        loop {
            let planes: Vec<DVec4> = elements.iter().filter_map(|e| e.plane).collect();
            match Polyhedron::from_planes(&planes) {
                Ok(shape) => return Ok(Some((elements, shape))),
                Err(PolyhedronError::Unbounded { .. }) => return Ok(None),
                Err(PolyhedronError::Redundant { face }) => {
                    elements.remove(face);
                }
                Err(other) => return Err(DirichletError::Shape(other)),
            }
        }
    }

    /// The element times face elements on the left, until it takes the base point into the polyhedron.
    fn brought_back(&self, faces: &[Element], mut isometry: Isometry) -> Isometry {
        for _ in 0..MAX_STEPS {
            let moved = image(self.geometry, &isometry, self.geometry.base());
            let limit = NO_MOVE * moved.abs().max_element();
            let side = |e: &Element| e.plane.map_or(f64::NEG_INFINITY, |plane| self.geometry.side(moved, plane));
            let farthest = faces.iter().max_by(|a, b| side(a).total_cmp(&side(b)));
            match farthest.filter(|e| side(e) > limit) {
                Some(face) => isometry = self.geometry.compose(&self.geometry.inverse(&face.isometry), &isometry),
                None => break,
            }
        }
        isometry
    }

    /// The cell with its faces in an order that rounding does not change.
    fn cell(&self, mut faces: Vec<Element>) -> Cell {
        let key = |e: &Element| {
            let plane = e.plane.unwrap_or_default();
            [e.displacement / self.scale, -plane.x, -plane.y, -plane.z].map(|x| (x * 1e6).round() as i64)
        };
        faces.sort_by_key(key);
        let inverses: Vec<Isometry> = faces.iter().map(|e| self.geometry.inverse(&e.isometry)).collect();
        let partner = |f: usize| {
            let misfit = |g: &usize| deviation(&faces[*g].isometry, &inverses[f]);
            (0..faces.len()).min_by(|a, b| misfit(a).total_cmp(&misfit(b))).unwrap_or(f)
        };
        let partners: Vec<usize> = (0..faces.len()).map(partner).collect();
        let face = |f: usize| {
            // The later one of two partners takes the first one's element, so that they are inverse to the last digit.
            let first = partners[f] < f && partners[partners[f]] == f;
            let pairing = if first { faces[partners[f]].isometry } else { inverses[f] };
            Face { plane: faces[f].plane.unwrap_or_default(), pairing, partner: FaceId { cell: 0, face: partners[f] } }
        };
        Cell { faces: (0..faces.len()).map(face).collect() }
    }
}

/// Whether a plane cuts off a corner.
fn cuts(plane: DVec4, shape: &Polyhedron) -> bool {
    let limit = SMALLEST_CUT * shape.circumradius * plane.xyz().length();
    shape.vertices.iter().any(|v| plane.dot(v.extend(1.0)) > limit)
}
