//! Scenes: what is in a space and how it is looked at. No Vulkan here, and no geometry's name: a scene holds
//! points and frames in the coordinates of whatever geometry its space has.
//!
//! [`mod@file`] reads the TOML format with line and column in every message, [`gltf`] reads meshes, [`shipped`] holds
//! the scenes that come with the program, [`folder`] keeps scenes from reading files that are none of their business.

mod accessor;
pub mod avatar;
pub mod file;
pub mod folder;
mod glb;
pub mod gltf;
mod normals;
mod objects;
mod path;
mod places;
mod reader;
pub mod shipped;
mod texture;

use crate::geometry::{Geometry, Visitor, visit};
use crate::integrate::Method;
use crate::space::{
    Space,
    domain::Domain,
    observer::{Frame, Leg},
    reduce::reduce_frame,
};
use glam::{DMat3, DVec3, DVec4};
use half::f16;

/// A scene, complete and checked.
#[derive(Clone, Debug)]
pub struct Scene {
    /// For messages and statistics: the catalogue name or the file's path.
    pub name: String,
    /// The space.
    pub space: Space,
    /// Where the picture is taken from.
    pub observer: Observer,
    /// Camera path from there; empty for none.
    pub path: Vec<Leg>,
    /// Point lights.
    pub lights: Vec<PointLight>,
    /// Materials of objects and meshes.
    pub materials: Vec<Material>,
    /// Textures of materials.
    pub textures: Vec<Texture>,
    /// Meshes of objects.
    pub meshes: Vec<Mesh>,
    /// What is to be seen.
    pub objects: Vec<Object>,
    /// How it is to be seen.
    pub settings: Settings,
}

impl Scene {
    /// Left and right eye: half of their distance along the observer's right axis, by parallel transport.
    ///
    /// # Errors
    /// [`NoPlaceForEye`].
    pub fn eyes(&self) -> Result<[Frame; 2], NoPlaceForEye> {
        struct Eyes<'a>(&'a Scene);
        impl Visitor for Eyes<'_> {
            type Output = [Option<Frame>; 2];
            fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
                let domain = Domain::new(&self.0.space);
                let observer = &self.0.observer;
                [-0.5, 0.5].map(|side| {
                    let step = DVec3::X * (side * observer.eye_distance);
                    reduce_frame(geometry, &domain, observer.frame.moved(geometry, step))
                })
            }
        }
        match visit(self.space.geometry, Eyes(self)) {
            [Some(left), Some(right)] => Ok([left, right]),
            _ => Err(NoPlaceForEye),
        }
    }
}

/// No pairing brings an eye of the observer back into the domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("an eye has no place in the domain")]
pub struct NoPlaceForEye;

/// The observer of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    /// Position and axes right, up, back.
    pub frame: Frame,
    /// Vertical field of view in degrees, in (0, 180).
    pub fov: f64,
    /// Distance of the eyes for `--stereo`, in units of length of the space.
    pub eye_distance: f64,
}

impl Observer {
    /// Metres in a unit of length, if the observer is a human being: by the distance of the eyes.
    pub fn unit_in_metres(&self) -> f64 {
        /// The mean of adults (Dodgson, Variation and extrema of human interpupillary distance, 2004).
        const EYE_DISTANCE: f64 = 0.063;
        EYE_DISTANCE / if self.eye_distance > 0.0 { self.eye_distance } else { 0.03 }
    }
}

/// A light without extent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointLight {
    /// Cell of the position.
    pub cell: usize,
    /// Position, in the geometry's coordinates.
    pub point: DVec4,
    /// Linear colour times intensity (radiance of a white surface facing the light at unit area density, times π).
    pub color: [f32; 3],
    /// Its light fades to nothing at this distance. Images of the light under the deck group count up to it.
    pub range: f64,
    /// Whether objects throw shadows in it.
    pub shadows: bool,
    /// The cone that it shines into, or everything.
    pub spot: Option<Spot>,
}

/// The cone of a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Unit tangent vector at the light's position, along the axis of the cone.
    pub direction: DVec4,
    /// Cosine of the angle between the axis and the edge of the cone, in (−1, 1).
    pub cos_angle: f64,
}

/// The metallic-roughness model of glTF 2.0.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the scene or glTF file.
    pub name: String,
    /// Linear base colour and opacity.
    pub base_color: [f32; 4],
    /// Linear light given off.
    pub emission: [f32; 3],
    /// 0 dielectric, 1 metal.
    pub metallic: f32,
    /// Perceptual roughness in [0, 1].
    pub roughness: f32,
    /// Opacity below which the surface has a hole.
    pub alpha_cutoff: Option<f32>,
    /// Base colour texture (index into [`Scene::textures`]), multiplied with `base_color`.
    pub base_texture: Option<usize>,
    /// Metallic-roughness texture: green times roughness, blue times metallic.
    pub surface_texture: Option<usize>,
    /// Colour from place: red, green and blue of the base colour are multiplied with numbers that go from 0 to 1 while
    /// the chart's x, y and z go from the first to the second number.
    pub coordinates: Option<[[f64; 2]; 3]>,
}

/// How a texture goes on outside [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// Again and again.
    Repeat,
    /// With its edge.
    Clamp,
    /// Back and forth.
    Mirror,
}

/// An image with linear values, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Width in texels, 1 to [`MAX_TEXTURE_SIZE`].
    pub width: u32,
    /// Height in texels, 1 to [`MAX_TEXTURE_SIZE`].
    pub height: u32,
    /// Linear RGBA. Colour textures are decoded from sRGB when they are read.
    pub texels: Vec<[f16; 4]>,
    /// Wrap modes across and down.
    pub wrap: [Wrap; 2],
}

/// Largest side of a texture, the limit that every Vulkan 1.2 desktop driver grants to images.
pub const MAX_TEXTURE_SIZE: u32 = 16384;

/// A vertex of a mesh, in the mesh's own space (glTF: right-handed, y up, metres).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Position.
    pub position: DVec3,
    /// Unit normal.
    pub normal: DVec3,
    /// Texture coordinates, origin at the top left.
    pub uv: [f32; 2],
}

/// Triangles with one material each.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// File it came from.
    pub name: String,
    /// Vertices; node transforms are applied.
    pub vertices: Vec<Vertex>,
    /// Corners, as indices into `vertices`, and material, as index into [`Scene::materials`].
    pub triangles: Vec<([u32; 3], usize)>,
}

/// What an object is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// Index into [`Scene::meshes`].
    Mesh(usize),
    /// A metric ball.
    Ball {
        /// Radius as a length in the space.
        radius: f64,
    },
    /// A tube around a piece of geodesic that starts at the placement's point along its third axis.
    Tube {
        /// Radius as a length in the space.
        radius: f64,
        /// Length of the axis.
        length: f64,
    },
    /// Tubes around all edges of the object's cell, with balls of the same radius at its vertices.
    DomainEdges {
        /// Radius as a length in the space.
        radius: f64,
    },
    /// The faces of the object's cell, or frames along their edges.
    DomainFaces {
        /// Width of the frames, as a share of the way from the edge to the centre of the face; 1 for whole faces.
        width: f64,
        /// One face alone; else all, of two that are glued to each other the first.
        face: Option<usize>,
    },
    /// Tubes along the coordinate lines of the chart.
    Grid {
        /// Corner of the box with the least chart coordinates.
        lower: DVec3,
        /// The opposite corner.
        upper: DVec3,
        /// Numbers of places along x, y and z, evenly from one end of the box to the other (or in the middle, for one),
        /// through which lines go.
        lines: [u32; 3],
        /// Radius of the tubes as a length in the space.
        radius: f64,
    },
}

impl Shape {
    /// Whether it is made of triangles in every geometry.
    pub fn is_flat(&self) -> bool {
        matches!(self, Self::Mesh(_) | Self::DomainFaces { .. })
    }
}

/// Where an object is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Place {
    /// Fixed in the space.
    World(Frame),
    /// Fixed to the observer: reached from his point by the exponential map of `offset`, with parallel transport
    /// of his frame, turned by `rotation`.
    Viewer {
        /// Components right, up, back; a length in the space.
        offset: DVec3,
        /// Columns are the object's axes in the observer's frame.
        rotation: DMat3,
    },
    /// Fixed to a hand that a headset tracks, in the same way; not there while the hand is not tracked.
    Hand {
        /// Which hand.
        hand: Hand,
        /// Components right, up, back of the hand's grip; a length in the space.
        offset: DVec3,
        /// Columns are the object's axes in the grip's frame.
        rotation: DMat3,
    },
}

/// A hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hand {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

/// Something to be seen.
#[derive(Clone, Debug, PartialEq)]
pub struct Object {
    /// Name for messages.
    pub name: String,
    /// What it is.
    pub shape: Shape,
    /// Where it is.
    pub place: Place,
    /// Lengths of a mesh are multiplied by this before the exponential map; positive.
    pub scale: f64,
    /// Material instead of the mesh's own (required for quadrics).
    pub material: Option<usize>,
    /// How it moves in a sequence of pictures.
    pub motion: Option<Motion>,
}

impl Object {
    /// Whether its place changes from picture to picture of a sequence.
    pub fn moves(&self) -> bool {
        self.motion.is_some() || !matches!(self.place, Place::World(_))
    }
}

/// A steady motion: along a geodesic with parallel transport of the object's frame, while it turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// Initial velocity in the object's own axes, in units of length per unit of time.
    pub velocity: DVec3,
    /// Axis times angle in radians per unit of time, in the object's own axes.
    pub turn: DVec3,
}

/// What a picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shading {
    /// Lambert and specular light with the metric of the space.
    Riemannian,
    /// The unit chart conormal on the viewer's side as a colour, `0.5 + 0.5 n`.
    Normals,
    /// Geodesic length to the first hit; infinity where nothing was hit.
    Distance,
    /// Passages through faces.
    Bounces,
    /// Segments traced.
    Segments,
    /// Deck element of the cell in which the ray ended; 0 is the observer's own cell.
    Cell,
    /// Index of the object hit, −1 where nothing was hit.
    Object,
}

impl Shading {
    /// All shadings with their names on the command line and in scenes.
    pub const NAMES: &[(&'static str, Shading)] = &[
        ("riemannian", Self::Riemannian),
        ("normals", Self::Normals),
        ("distance", Self::Distance),
        ("bounces", Self::Bounces),
        ("segments", Self::Segments),
        ("cell", Self::Cell),
        ("object", Self::Object),
    ];

    /// Whether pixels hold a value and not a colour.
    pub fn is_raw(self) -> bool {
        !matches!(self, Self::Riemannian | Self::Normals)
    }
}

/// The `[render]` table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Largest number of face passages, 1 to [`MAX_BOUNCES`].
    pub bounces: u32,
    /// Geodesics end at this length.
    pub max_distance: Option<f64>,
    /// Fog density per unit length, 0 for none: of what is at distance d, exp(−fog d) is left. Rays end where that is less
    /// than 1/8000 ([`FOG_HIDES`](crate::shader_io::FOG_HIDES)).
    pub fog: f64,
    /// Linear colour of the fog and of what lies beyond.
    pub background: [f32; 3],
    /// Linear light from everywhere.
    pub ambient: [f32; 3],
    /// Linear colour times intensity of the light at the viewer, black for none.
    pub headlight: [f32; 3],
    /// What the picture shows.
    pub shading: Shading,
    /// Largest deviation of an arc from its geodesic, as a share of a pixel's footprint.
    pub tolerance: f64,
    /// How rays are followed.
    pub method: Method,
}

/// Largest accepted bounce count.
pub const MAX_BOUNCES: u32 = 100_000;

impl Default for Settings {
    fn default() -> Self {
        Self {
            bounces: 8,
            max_distance: None,
            fog: 0.0,
            background: [0.0; 3],
            ambient: [0.03; 3],
            headlight: [0.0; 3],
            shading: Shading::Riemannian,
            tolerance: 0.005,
            method: Method::Exact,
        }
    }
}

/// What chart coordinates are multiplied with, and what is added then, to colour a material by place; nothing and one
/// for a material that is not.
pub fn coordinate_ramp(material: &Material) -> (DVec3, DVec3) {
    let Some(ranges) = material.coordinates else { return (DVec3::ZERO, DVec3::ONE) };
    let scale = DVec3::from_array(ranges.map(|[from, to]| 1.0 / (to - from)));
    (scale, -DVec3::from_array(ranges.map(|[from, _]| from)) * scale)
}

impl Material {
    /// A plain surface of one linear colour.
    pub fn plain(name: &str, color: [f32; 3]) -> Self {
        Self {
            name: name.to_owned(),
            base_color: [color[0], color[1], color[2], 1.0],
            emission: [0.0; 3],
            metallic: 0.0,
            roughness: 0.6,
            alpha_cutoff: None,
            base_texture: None,
            surface_texture: None,
            coordinates: None,
        }
    }
}
