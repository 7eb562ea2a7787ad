//! A scene prepared for tracing: everything in the charts of its cells, in f64, with its hierarchy.
//!
//! Objects are placed by the exponential map and cut to the cells they reach into: a mesh that sticks out of its
//! cell appears whole because every deck transformation that brings a part of it into the cell contributes its
//! triangles there. Triangles outside of the cell are dropped, so copies cost no more than the mesh itself.

mod build;
mod embed;
mod place;
mod shapes;
pub mod tessellate;

use crate::{
    geometry::{GeometryId, Quadric},
    render::{bvh::Tree, plan::Plan},
    scene::{Material, Settings, Texture},
    shader_io::{Node, TriangleShading},
    space::domain::Domain,
};
use glam::{DVec3, DVec4};

/// A prepared scene.
#[derive(Clone, Debug)]
pub struct World {
    /// The model geometry.
    pub geometry: GeometryId,
    /// What pictures of the scene need.
    pub plan: Plan,
    /// Render settings.
    pub settings: Settings,
    /// Faces and their pairings.
    pub domain: Domain,
    /// The cells, parallel to [`Domain::cells`].
    pub cells: Vec<WorldCell>,
    /// Bounding volume hierarchies of all cells (boxes on a grid, rounded outwards).
    pub nodes: Vec<Node>,
    /// Primitive references in leaf order: a triangle's index, or a quadric's with `QUADRIC_BIT`.
    pub primitives: Vec<u32>,
    /// Corners in the chart.
    pub triangles: Vec<[DVec3; 3]>,
    /// Shading data of the triangles.
    pub triangle_shading: Vec<TriangleShading>,
    /// Quadrics.
    pub quadrics: Vec<WorldQuadric>,
    /// Materials.
    pub materials: Vec<Material>,
    /// Textures; empty if the plan has none.
    pub textures: Vec<Texture>,
    /// Light images of all cells; cells hold ranges.
    pub lights: Vec<WorldLight>,
}

/// What is in a cell.
#[derive(Clone, Debug)]
pub struct WorldCell {
    /// The hierarchy in [`World::nodes`], if the cell has anything in it.
    pub tree: Option<Tree>,
    /// Into [`World::lights`].
    pub lights: std::ops::Range<usize>,
}

/// A quadric between two planes.
#[derive(Clone, Copy, Debug)]
pub struct WorldQuadric {
    /// The surface.
    pub surface: Quadric,
    /// Homogeneous points with a negative product are cut off.
    pub clip: [DVec4; 2],
    /// Index of the material.
    pub material: u32,
    /// Index of the scene's object.
    pub object: u32,
}

/// An image of a light.
#[derive(Clone, Copy, Debug)]
pub struct WorldLight {
    /// Position, possibly outside of the cell.
    pub point: DVec4,
    /// Linear colour times intensity.
    pub color: [f32; 3],
    /// Fades to nothing here.
    pub range: f64,
    /// [`crate::geometry::Geometry::closeness`] of points at that distance.
    pub closest: f64,
    /// Spot: axis at `point` and cosine of half the opening angle.
    pub spot: Option<(DVec4, f64)>,
    /// Throws shadows.
    pub shadows: bool,
}

/// Why a scene could not be prepared.
#[derive(Clone, Debug, thiserror::Error)]
pub enum WorldError {
    /// An object or a light is so large that its copies fill the space.
    #[error("{0} reaches into more than {1} cells: make it smaller")]
    TooManyCopies(String, usize),
    /// An object's place cannot be brought into the domain.
    #[error("{0} has no place in the domain: the pairings do not lead back to it")]
    Lost(String),
    /// A ball or a tube is wider than the geodesics that make it can be drawn.
    #[error("{0}: the radius {1} is too large here: geodesics of this length meet again or leave the chart")]
    TooWide(String, f64),
    /// The edges of a cell without end.
    #[error("{0}: the cell has no end, and so its edges cannot be drawn")]
    NoEdges(String),
    /// A cell's vertices lie outside of the chart.
    #[error("{0}: a vertex of the cell lies outside of the chart")]
    OutsideChart(String),
    /// More primitives than references can name.
    #[error("the scene has {0} triangles and quadrics in its cells, but at most {1} can be told apart")]
    TooManyPrimitives(usize, usize),
    /// A cell is not a bounded polyhedron.
    #[error(transparent)]
    Polyhedron(#[from] crate::space::polyhedron::PolyhedronError),
}
