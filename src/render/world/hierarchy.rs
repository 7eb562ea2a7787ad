//! Bounding volume hierarchies of the cells, for the backends that traverse themselves.

use super::{Meshes, WorldQuadric, voxels::Voxels};
use crate::{
    render::bvh::{self, Aabb, Effort, Grid, Primitive, Tree},
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
    /// Voxels of the cells, where geodesics are curved: without, segments are as long as cells.
    pub voxels: Voxels,
}

impl Hierarchy {
    /// Builds the hierarchies of all cells.
    pub fn new(domain: &Domain, meshes: &Meshes, quadrics: &[WorldQuadric], effort: Effort, straight: bool) -> Self {
        let mut hierarchy = Self::default();
        for cell in 0..domain.cells.len() {
            let primitives = inside(domain, meshes, quadrics, cell);
            let tree = bvh::build(&primitives, &mut hierarchy.nodes, effort);
            hierarchy.stack = hierarchy.stack.max(tree.map_or(0, |tree| tree.stack));
            hierarchy.trees.push(tree);
            if !straight {
                hierarchy.voxels.add(tree.map(|tree| tree.grid), &primitives, &meshes.triangles);
            }
        }
        hierarchy
    }

    /// Nothing but voxels, for a device that traverses by itself.
    pub fn voxels(domain: &Domain, meshes: &Meshes, quadrics: &[WorldQuadric]) -> Self {
        let mut hierarchy = Self::default();
        for cell in 0..domain.cells.len() {
            let primitives = inside(domain, meshes, quadrics, cell);
            let grid = primitives.iter().map(|(bounds, _)| *bounds).reduce(Aabb::union).map(Grid::new);
            hierarchy.voxels.add(grid, &primitives, &meshes.triangles);
            hierarchy.trees.push(grid.map(|grid| Tree { stack: 0, root: NONE, grid }));
        }
        hierarchy
    }
}

/// What is in a cell.
fn inside(domain: &Domain, meshes: &Meshes, quadrics: &[WorldQuadric], cell: usize) -> Vec<(Aabb, Primitive)> {
    let triangles = meshes
        .inside(domain, cell)
        .map(|index| (Aabb::around(meshes.triangles[index]), Primitive::Triangle(index as u32)));
    let inside = quadrics.iter().enumerate().filter(|(_, quadric)| quadric.cell == cell);
    let quadrics = inside.map(|(index, quadric)| (quadric.bounds, Primitive::Quadric(index as u32)));
    triangles.chain(quadrics).collect()
}
