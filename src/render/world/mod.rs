//! A scene prepared for tracing: everything in the charts of its cells, in f64, with its hierarchy.
//!
//! Objects are placed by the exponential map and cut to the cells they reach into: a mesh that sticks out of its
//! cell appears whole because every deck transformation that brings a part of it into the cell contributes its
//! triangles there. What only some backends need is made when they ask for it: the hierarchy ([`World::hierarchy`]),
//! and the triangles of objects that move ([`World::meshes`]), which devices place themselves.

mod build;
mod embed;
mod faces;
pub mod hierarchy;
pub mod lights;
pub mod meshes;
mod place;
mod shapes;
pub mod tessellate;
pub mod voxels;

use crate::{
    geometry::{Geometry, GeometryId, Quadric, Visitor, visit},
    render::{
        bvh::{Aabb, Effort},
        plan::Plan,
    },
    scene::{Material, Settings, Texture},
    space::{domain::Domain, observer::Frame},
};
use glam::DVec4;
use hierarchy::Hierarchy;
use lights::Lights;
use meshes::{Meshes, RestMesh};
pub use place::Copy;
use std::sync::{Arc, OnceLock};

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
    pub domain: Arc<Domain>,
    /// Meshes that rest.
    pub still: Arc<Meshes>,
    /// Meshes that move; none in a world for a single picture.
    pub movers: Vec<Mover>,
    /// Quadrics, by cell, and in each cell [halved](crate::render::bvh::halve).
    pub quadrics: Vec<WorldQuadric>,
    /// Materials.
    pub materials: Arc<Vec<Material>>,
    /// Textures; empty if the plan has none.
    pub textures: Arc<Vec<Texture>>,
    /// Light images of all cells.
    pub lights: Arc<Lights>,
    /// Largest way from the chord of a piece of an arc to the arc, in units of the chart, where a device's own traversal gets it.
    pub sagitta: f64,
    /// [`World::meshes`] where something moves.
    posed: OnceLock<Meshes>,
    quadrics_move: bool,
    hierarchy: OnceLock<Hierarchy>,
}

/// What changes between the pictures of a sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// The observer; attached objects are with him.
    pub observer: Frame,
    /// Time, for objects in motion.
    pub time: f64,
    /// Left and right hand, where a headset tracks them: the frames of their grips.
    pub hands: [Option<Frame>; 2],
}

impl Pose {
    /// A pose without hands.
    pub fn new(observer: Frame, time: f64) -> Self {
        Self { observer, time, hands: [None; 2] }
    }
}

/// A mesh that moves.
#[derive(Clone, Debug)]
pub struct Mover {
    /// The mesh where it was placed first, shared from pose to pose.
    pub rest: Arc<RestMesh>,
    /// Isometries that carry it from there to its copies.
    pub copies: Vec<Copy>,
}

impl World {
    /// Triangles of all meshes in this pose.
    pub fn meshes(&self) -> &Meshes {
        struct Place<'a>(&'a World);
        impl Visitor for Place<'_> {
            type Output = Meshes;
            fn visit<G: Geometry>(self, geometry: G) -> Meshes {
                let mut meshes = Meshes::clone(&self.0.still);
                for mover in &self.0.movers {
                    for copy in &mover.copies {
                        meshes.add(geometry, &self.0.domain, &mover.rest, copy, None);
                    }
                }
                meshes
            }
        }
        if self.movers.is_empty() { &self.still } else { self.posed.get_or_init(|| visit(self.geometry, Place(self))) }
    }

    /// Whether quadrics may change from pose to pose.
    pub fn quadrics_move(&self) -> bool {
        self.quadrics_move
    }

    /// Whether nothing may change from pose to pose.
    pub fn rests(&self) -> bool {
        self.movers.is_empty() && !self.quadrics_move
    }

    /// By how much boxes about triangles must be larger for a device's own traversal, in units of the chart: as far as an arc may
    /// be from the straight ray that stands for it, which halves its way from the chord.
    pub fn margin(&self) -> f64 {
        0.5 * self.sagitta
    }

    /// The hierarchies of the cells in this pose.
    pub fn hierarchy(&self) -> &Hierarchy {
        let effort = if self.rests() { Effort::High } else { Effort::Low };
        let straight = self.geometry.is_straight();
        self.hierarchy.get_or_init(|| Hierarchy::new(&self.domain, self.meshes(), &self.quadrics, effort, straight))
    }
}

/// A quadric between two planes.
#[derive(Clone, Copy, Debug)]
pub struct WorldQuadric {
    /// The surface.
    pub surface: Quadric,
    /// Homogeneous points with a negative product are cut off.
    pub clip: [DVec4; 2],
    /// Around the part that is inside of the cell.
    pub bounds: Aabb,
    /// The cell.
    pub cell: usize,
    /// Index of the material.
    pub material: u32,
    /// Index of the scene's object.
    pub object: u32,
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
    /// The edges or faces of a cell without end.
    #[error("{0}: the cell has no end, and so its edges and faces cannot be drawn")]
    NoEdges(String),
    /// A face that the cell does not have.
    #[error("{0}: the cell has no face {1}, its faces are 0 to {2}")]
    NoFace(String, usize, usize),
    /// A cell's vertices, or the ends of a grid's lines, lie outside of the chart.
    #[error("{0}: a vertex lies outside of the chart")]
    OutsideChart(String),
    /// More primitives than references can name.
    #[error("the scene has {0} triangles and quadrics in its cells, but at most {1} can be told apart")]
    TooManyPrimitives(usize, usize),
    /// A cell is not a bounded polyhedron.
    #[error(transparent)]
    Polyhedron(#[from] crate::space::polyhedron::PolyhedronError),
}
