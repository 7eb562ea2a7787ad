//! Bounding volume hierarchies of the cells, for the backends that traverse themselves.

use super::{Meshes, WorldQuadric, voxels::Voxels};
use crate::{
    render::bvh::{
        self, Aabb, Effort, Grid, Primitive, Tree,
        pairs::{Pair, pairs},
    },
    shader_io::{NONE, Node},
    space::domain::Domain,
};

/// The hierarchies of all cells.
#[derive(Clone, Debug, Default)]
pub struct Hierarchy {
    /// Nodes (boxes on a grid, rounded outwards).
    pub nodes: Vec<Node>,
    /// Entries that a stack needs to walk any of them.
    pub stack: u32,
    /// For each cell, its hierarchy, if it has anything in it.
    pub trees: Vec<Option<Tree>>,
    /// Triangles as leaves have them.
    pub pairs: Vec<Pair>,
    /// Voxels of the cells, where geodesics are curved: without, segments are as long as cells.
    pub voxels: Voxels,
}

impl Hierarchy {
    /// Builds the hierarchies of all cells.
    pub fn new(domain: &Domain, meshes: &Meshes, quadrics: &[WorldQuadric], effort: Effort, straight: bool) -> Self {
        let mut hierarchy = Self::default();
        for cell in 0..domain.cells.len() {
            let triangles = meshes.inside(domain, cell);
            let first = hierarchy.pairs.len();
            hierarchy.pairs.extend(pairs(&meshes.triangles, &triangles));
            let leaves = hierarchy.pairs[first..]
                .iter()
                .zip(first as u32..)
                .map(|(pair, index)| (pair.bounds(&meshes.triangles), Primitive::Triangle(2 * index)));
            let leaves: Vec<_> = leaves.chain(quadrics_inside(quadrics, cell)).collect();
            let tree = bvh::build(&leaves, &mut hierarchy.nodes, effort);
            hierarchy.stack = hierarchy.stack.max(tree.map_or(0, |tree| tree.stack));
            hierarchy.trees.push(tree);
            if !straight {
                let corners = triangles.iter().map(|&index| meshes.triangles[index as usize]);
                let boxes = quadrics_inside(quadrics, cell).map(|(bounds, _)| bounds);
                hierarchy.voxels.add(tree.map(|tree| tree.grid), corners, boxes);
            }
        }
        hierarchy
    }

    /// Nothing but voxels, for a device that traverses by itself.
    pub fn voxels(domain: &Domain, meshes: &Meshes, quadrics: &[WorldQuadric]) -> Self {
        let mut hierarchy = Self::default();
        for cell in 0..domain.cells.len() {
            let triangles = meshes.inside(domain, cell);
            let corners = || triangles.iter().map(|&index| meshes.triangles[index as usize]);
            let boxes = || quadrics_inside(quadrics, cell).map(|(bounds, _)| bounds);
            let bounds = boxes().fold(Aabb::around(corners().flatten()), Aabb::union);
            let grid = (bounds != Aabb::EMPTY).then(|| Grid::new(bounds));
            hierarchy.voxels.add(grid, corners(), boxes());
            hierarchy.trees.push(grid.map(|grid| Tree { stack: 0, root: NONE, grid }));
        }
        hierarchy
    }
}

/// The quadrics in a cell.
fn quadrics_inside(quadrics: &[WorldQuadric], cell: usize) -> impl Iterator<Item = (Aabb, Primitive)> {
    let inside = (0..).zip(quadrics).filter(move |(_, quadric)| quadric.cell == cell);
    inside.map(|(index, quadric)| (quadric.bounds, Primitive::Quadric(index)))
}
