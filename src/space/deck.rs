//! Deck transformations, enumerated from the pairings.
//!
//! An element is a cell together with the isometry that carries the start cell's coordinates into its own: the
//! product of the pairings along a path of faces. Where pairings are integers in a suitable basis (module [`integers`])
//! that product is exact, and elements are told apart by it however far away they are. Elsewhere two paths lead to the
//! same element exactly if they carry a point without symmetry to the same place, so elements are recognised by the image
//! of such a point, as long as numbers name it well enough.

pub mod integers;

use super::domain::Domain;
use crate::{
    geometry::{Geodesic, Geometry, Isometry},
    shader_io::NONE,
};
use integers::Integers;
use std::collections::{HashMap, VecDeque};

/// A cell reached from the start cell.
#[derive(Clone, Copy, Debug)]
pub struct Element {
    /// The cell.
    pub cell: usize,
    /// Carries points of the start cell's coordinates to this cell's.
    pub isometry: Isometry,
    /// The same in whole numbers, where the space has them and they fit.
    pub integers: Option<Integers>,
}

/// Set of elements that grows by crossing faces.
pub struct Elements<G> {
    geometry: G,
    witness: Geodesic,
    /// Elements by their integers.
    exact: HashMap<(usize, Integers), usize>,
    /// The others by the image of the witness.
    known: HashMap<(usize, [i64; 4]), usize>,
    /// All elements found, the identity first.
    pub list: Vec<Element>,
}

impl<G: Geometry> Elements<G> {
    /// The identity of `cell` alone.
    pub fn new(geometry: G, domain: &Domain, cell: usize) -> Self {
        // No mirror, axis or centre of a reasonable domain passes through a point with such coordinates.
        let base = geometry.base();
        let axes = geometry.frame(base);
        let direction = axes[0] * 0.632_455_1 + axes[1] * 0.591_607_9 + axes[2] * 0.5;
        let velocity = direction / geometry.norm(base, direction);
        let witness = geometry.flow(Geodesic { point: base, velocity }, 0.012_345_67);
        let mut elements = Self { geometry, witness, exact: HashMap::new(), known: HashMap::new(), list: Vec::new() };
        let integers = domain.lattice.as_ref().map(|_| Integers::IDENTITY);
        elements.insert(Element { cell, isometry: Isometry::IDENTITY, integers });
        elements
    }

    /// The element behind face `face` of element `index`, and whether it is new.
    pub fn cross(&mut self, domain: &Domain, index: usize, face: usize) -> (usize, bool) {
        let passed = &domain.faces[face];
        let from = &self.list[index];
        let isometry = self.geometry.compose(&passed.pairing, &from.isometry);
        let pairing = domain.lattice.as_ref().map(|lattice| &lattice.pairings[face]);
        let integers = pairing.zip(from.integers).and_then(|(pairing, element)| pairing.after(&element));
        self.insert(Element { cell: passed.cell, isometry, integers })
    }

    fn insert(&mut self, element: Element) -> (usize, bool) {
        if let Some(integers) = element.integers {
            let next = self.list.len();
            let known = *self.exact.entry((element.cell, integers)).or_insert(next);
            if known == next {
                self.list.push(element);
            }
            return (known, known == next);
        }
        let image = self.geometry.apply(&element.isometry, self.witness).point;
        // Images of one element differ by rounding, which grows with the coordinates: 1e-6 for coordinates of 1e9. Those of
        // two elements differ by a length of order 1, and by as much in coordinates however far away they are (relative to
        // the coordinates they come ever closer). An image next to the border of its grid cell is looked up in the
        // neighbouring cell as well.
        const GRID: f64 = 1e-3;
        let scaled = image / GRID;
        let (low, high) = ((scaled - 0.4).floor().to_array(), (scaled + 0.4).floor().to_array());
        for corner in 0..16_u32 {
            let key = std::array::from_fn(|i| if corner & (1 << i) == 0 { low[i] } else { high[i] } as i64);
            if let Some(&known) = self.known.get(&(element.cell, key)) {
                return (known, false);
            }
        }
        let index = self.list.len();
        self.known.insert((element.cell, scaled.floor().to_array().map(|x| x as i64)), index);
        self.list.push(element);
        (index, true)
    }
}

/// Most elements in a label table.
pub const MAX_LABELS: usize = 65_536;

/// The automaton that names cells: for each element and each face the element behind it, or [`NONE`] beyond the
/// elements that `bounces` faces reach or beyond [`MAX_LABELS`]. Elements are numbered in breadth-first order from
/// the identity 0, so labels are exact however long a ray is: it only walks through a table.
pub fn label_table<G: Geometry>(geometry: G, domain: &Domain, start: usize, bounces: u32) -> Vec<u32> {
    let width = domain.faces.len();
    let mut elements = Elements::new(geometry, domain, start);
    let mut table = vec![NONE; width];
    let mut queue = VecDeque::from([(0, 0)]);
    while let Some((index, depth)) = queue.pop_front() {
        if depth == bounces {
            continue;
        }
        for face in domain.cells[elements.list[index].cell].clone() {
            if elements.list.len() >= MAX_LABELS {
                break;
            }
            let (behind, is_new) = elements.cross(domain, index, face);
            if is_new {
                queue.push_back((behind, depth + 1));
                table.resize(table.len() + width, NONE);
            }
            table[index * width + face] = behind as u32;
            // The way back is known at the same time.
            let partner = domain.faces[face].partner;
            table[behind * width + partner] = index as u32;
        }
    }
    table
}
