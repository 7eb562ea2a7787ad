//! Labels of cells against exact deck elements.
//!
//! A label is where a ray has come to in a table: it cannot drift, but it can be wrong. Here the deck element of each cell
//! that a ray passes is multiplied out from the pairings, and must be the element that the label stands for, as far as the
//! table reaches. The ray's own steps are the stages', on the host and on the device.

use super::{Bench, Case, Family, NUMBERS, On, Reading, Trouble, walk};
use crate::{
    geometry::{Geodesic, Geometry, Isometry, Visitor, visit},
    shader_io::NONE,
    space::{
        Space,
        deck::label_table,
        domain::Domain,
        walk::{Path, Status},
    },
};
use glam::DVec4;
use std::collections::VecDeque;

/// Faces that each ray passes, beyond the depth of most tables.
const FACES: u32 = 24;

/// Depth of the tables.
const DEPTH: u32 = 16;

const RAYS: usize = 64;

pub(super) fn cases() -> Vec<Case> {
    let family = Family { name: "label", quantity: "labels that name another deck element", on: NUMBERS };
    walk::closed_spaces()
        .map(|space| {
            family.case(&space.name.clone(), "against exact deck elements", move |bench, on| {
                Ok(Reading::new(wrong_labels(bench, on, &space)?, 0.0))
            })
        })
        .collect()
}

/// A ray's label after each face.
struct Trail {
    faces: Vec<usize>,
    labels: Vec<u32>,
}

fn wrong_labels(bench: &mut Bench, on: On, space: &Space) -> Result<f64, Trouble> {
    // Tables count from one cell: only rays that start there.
    struct Table<'a>(&'a Space, &'a Domain);
    impl Visitor for Table<'_> {
        type Output = (Vec<u32>, Vec<(usize, Geodesic)>);
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let rays = walk::rays(geometry, self.0, RAYS * self.0.cells.len(), 77);
            (label_table(geometry, self.1, 0, DEPTH), rays.into_iter().filter(|(cell, _)| *cell == 0).collect())
        }
    }
    let mut domain = Domain::new(space);
    let (table, rays) = visit(space.geometry, Table(space, &domain));
    domain.labels = table;
    let trails: Vec<Trail> = match on {
        On::Cpu => rays.iter().map(|(cell, ray)| visit(space.geometry, Follow(&domain, *cell, *ray))).collect(),
        _ => {
            let mut walks: Vec<_> = rays.iter().map(|(cell, ray)| walk::walk(*cell, *ray, 0)).collect();
            let mut trails: Vec<Trail> = rays.iter().map(|_| Trail { faces: Vec::new(), labels: Vec::new() }).collect();
            for until in 1..=FACES {
                walks.iter_mut().for_each(|walk| walk.until = until);
                let passed = bench.walk(&space.name, space.geometry, &domain, &mut walks, 64)?;
                for ((trail, walk), faces) in trails.iter_mut().zip(&walks).zip(passed) {
                    if walk.lost > 0 {
                        return Err(Trouble(String::from("a ray is lost")));
                    }
                    trail.faces.extend(faces.iter().map(|face| *face as usize));
                    // Several faces at once have one label between them, the last.
                    trail.labels.resize(trail.faces.len(), NONE);
                    if let Some(last) = trail.labels.last_mut() {
                        *last = walk.label;
                    }
                }
            }
            trails
        }
    };
    visit(space.geometry, Judge(&domain, &trails))
        .ok_or_else(|| Trouble(String::from("no label is within the table, so nothing is shown")))
}

struct Follow<'a>(&'a Domain, usize, Geodesic);

impl Visitor for Follow<'_> {
    type Output = Trail;
    fn visit<G: Geometry>(self, geometry: G) -> Trail {
        let Self(domain, cell, ray) = self;
        let mut path = Path::new(ray, cell, f64::INFINITY);
        let mut trail = Trail { faces: Vec::new(), labels: Vec::new() };
        for until in 1..=FACES {
            let mut faces = Vec::new();
            walk::until(geometry, domain, &mut path, until, |face| faces.push(face));
            trail.faces.extend(faces);
            trail.labels.resize(trail.faces.len(), NONE);
            if let Some(last) = trail.labels.last_mut() {
                *last = path.label;
            }
            if path.status != Status::Flying {
                break;
            }
        }
        trail
    }
}

struct Judge<'a>(&'a Domain, &'a [Trail]);

impl Visitor for Judge<'_> {
    type Output = Option<f64>;
    fn visit<G: Geometry>(self, geometry: G) -> Option<f64> {
        let Self(domain, trails) = self;
        let elements = elements(geometry, domain);
        // Where a point without symmetry goes.
        let [x, y, z] = geometry.frame(geometry.base());
        let velocity = x * 0.48 + y * 0.6 + z * 0.64;
        let witness = geometry.flow(Geodesic { point: geometry.base(), velocity }, 0.123);
        let image = |m: &Isometry| geometry.apply(m, witness).point;
        // Elements move the point to places that differ by lengths of order 1, and by as much in coordinates.
        let same = |a: DVec4, b: DVec4| (a - b).abs().max_element() <= 1e-2;
        let (mut compared, mut wrong) = (0_usize, 0_usize);
        for trail in trails {
            let mut product = Isometry::IDENTITY;
            for (face, label) in trail.faces.iter().zip(&trail.labels) {
                product = geometry.compose(&domain.faces[*face].pairing, &product);
                let cell = domain.faces[*face].cell;
                if *label == NONE {
                    continue;
                }
                compared += 1;
                let named = elements.get(*label as usize).and_then(Option::as_ref);
                let right = named.is_some_and(|(known, m)| *known == cell && same(image(m), image(&product)));
                wrong += usize::from(!right);
            }
        }
        (compared >= trails.len()).then_some(wrong as f64)
    }
}

/// The element of each label: the product of the pairings along the shortest way to it in the table.
fn elements<G: Geometry>(geometry: G, domain: &Domain) -> Vec<Option<(usize, Isometry)>> {
    let width = domain.faces.len();
    let mut elements = vec![None; domain.labels.len() / width];
    let mut queue = VecDeque::from([(0_usize, 0_usize, Isometry::IDENTITY)]);
    if let Some(first) = elements.first_mut() {
        *first = Some((0, Isometry::IDENTITY));
    }
    while let Some((label, cell, isometry)) = queue.pop_front() {
        for face in domain.cells[cell].clone() {
            let behind = domain.labels[label * width + face];
            let Some(element) = elements.get_mut(behind as usize).filter(|element| element.is_none()) else { continue };
            let passed = &domain.faces[face];
            let product = geometry.compose(&passed.pairing, &isometry);
            *element = Some((passed.cell, product));
            queue.push_back((behind as usize, passed.cell, product));
        }
    }
    elements
}
