//! Bounding volume hierarchies of the cells, for the backends that traverse themselves.

use super::{Meshes, WorldQuadric};
use crate::{
    render::bvh::{self, Aabb, Tree},
    shader_io::{Node, QUADRIC_BIT},
    space::domain::Domain,
};

/// The hierarchies of all cells.
#[derive(Clone, Debug, Default)]
pub struct Hierarchy {
    /// Nodes (boxes on a grid, rounded outwards).
    pub nodes: Vec<Node>,
    /// Primitive references in leaf order: a triangle's index, or a quadric's with `QUADRIC_BIT`.
    pub primitives: Vec<u32>,
    /// For each cell, its hierarchy, if it has anything in it.
    pub trees: Vec<Option<Tree>>,
}

impl Hierarchy {
    /// Builds the hierarchies of all cells.
    pub fn new(domain: &Domain, meshes: &Meshes, quadrics: &[WorldQuadric]) -> Self {
        let mut hierarchy = Self::default();
        for cell in 0..domain.cells.len() {
            let (mut boxes, mut names) = (Vec::new(), Vec::new());
            for index in meshes.inside(domain, cell) {
                boxes.push(Aabb::around(meshes.triangles[index]));
                names.push(index as u32);
            }
            for (index, quadric) in quadrics.iter().enumerate().filter(|(_, q)| q.cell == cell) {
                boxes.push(quadric.bounds);
                names.push(index as u32 | QUADRIC_BIT);
            }
            let tree = bvh::build(&boxes, &names, &mut hierarchy.nodes, &mut hierarchy.primitives);
            hierarchy.trees.push(tree);
        }
        hierarchy
    }
}
