//! Vertex classes and their links.
//!
//! The link of a vertex is the surface glued from small polygons, one across each corner that meets in it: a side
//! for each face at the corner, a corner for each edge.

use super::Glued;
use crate::geometry::Geometry;
use std::collections::{HashMap, HashSet};

/// The link of a vertex of the glued space.
pub(super) struct Link {
    /// Cell of one of the corners that meet in it.
    pub(super) cell: usize,
    /// That corner.
    pub(super) vertex: usize,
    /// Euler characteristic of the surface.
    pub(super) characteristic: i64,
}

/// The links of all vertex classes.
pub(super) fn vertex_links<G: Geometry>(glued: &Glued<'_, G>) -> Vec<Link> {
    // Elements: corners (cell, vertex, vertex) and ends of edges (cell, vertex, other end).
    let mut ids: HashMap<(usize, usize, usize), usize> = HashMap::new();
    let mut keys = Vec::new();
    let mut add = |key| {
        ids.entry(key).or_insert_with(|| {
            keys.push(key);
            keys.len() - 1
        });
    };
    for (cell, shape) in glued.shapes.iter().enumerate() {
        (0..shape.vertices.len()).for_each(|v| add((cell, v, v)));
        for edge in &shape.edges {
            let [a, b] = edge.vertices;
            add((cell, a, b));
            add((cell, b, a));
        }
    }

    let mut classes = Classes::new(keys.len());
    for (id, face) in glued.space.faces() {
        let outline = &glued.shapes[id.cell].face_vertices[id.face];
        let images = &glued.images[id.cell][id.face];
        let cell = face.partner.cell;
        let n = outline.len();
        for i in 0..n {
            for j in [i, (i + 1) % n, (i + n - 1) % n] {
                let here = ids.get(&(id.cell, outline[i], outline[j]));
                if let (Some(&a), Some(&b)) = (here, ids.get(&(cell, images[i], images[j]))) {
                    classes.join(a, b);
                }
            }
        }
    }

    // Corners of the link: classes of edge ends; sides: faces at corners, two by two, mirrors alone; polygons:
    // corners.
    let mut links: HashMap<usize, Link> = HashMap::new();
    let mut order = Vec::new();
    for (index, &(cell, vertex, other)) in keys.iter().enumerate() {
        if vertex == other {
            let class = classes.find(index);
            let link = links.entry(class).or_insert_with(|| {
                order.push(class);
                Link { cell, vertex, characteristic: 0 }
            });
            link.characteristic += 1;
        }
    }
    let mut bump = |classes: &mut Classes, cell: usize, vertex: usize, by: i64| {
        let class = ids.get(&(cell, vertex, vertex)).map(|&i| classes.find(i));
        if let Some(link) = class.and_then(|class| links.get_mut(&class)) {
            link.characteristic += by;
        }
    };
    let mut edge_ends = HashSet::new();
    for (index, &(cell, vertex, other)) in keys.iter().enumerate() {
        if vertex != other && edge_ends.insert(classes.find(index)) {
            bump(&mut classes, cell, vertex, 1);
        }
    }
    for (id, face) in glued.space.faces().filter(|(id, face)| *id <= face.partner) {
        let outline = &glued.shapes[id.cell].face_vertices[id.face];
        let images = &glued.images[id.cell][id.face];
        for (&v, &w) in outline.iter().zip(images) {
            // A face that is its own partner glues corners two by two, or leaves them alone.
            if face.partner != id || v <= w {
                bump(&mut classes, id.cell, v, -1);
            }
        }
    }
    order.iter().filter_map(|class| links.remove(class)).collect()
}

/// Classes of an equivalence relation.
struct Classes {
    parent: Vec<usize>,
}

impl Classes {
    fn new(count: usize) -> Self {
        Self { parent: (0..count).collect() }
    }

    fn find(&mut self, mut i: usize) -> usize {
        while self.parent[i] != i {
            self.parent[i] = self.parent[self.parent[i]];
            i = self.parent[i];
        }
        i
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.parent[a.max(b)] = a.min(b);
    }
}
