//! From a scene to a [`World`].

use super::{
    World, WorldCell, WorldError, WorldLight, WorldQuadric,
    embed::{Placed, embed},
    place::{Balls, Copy, Corners, Sphere, all_beyond_one_face, copies},
};
use crate::{
    geometry::{Geodesic, Geometry, Visitor, exponential, visit},
    render::{
        bvh::{self, Aabb},
        plan::{Feature, Plan},
    },
    scene::{Mesh, Object, Place, Scene, Shape, Vertex},
    shader_io::TriangleShading,
    space::{deck, domain::Domain, observer::Frame, polyhedron::Polyhedron, reduce::reduce_frame},
};
use glam::{DVec3, DVec4};
use rayon::prelude::*;

impl World {
    /// Prepares `scene` as seen by `observer` (attached objects move with him).
    ///
    /// # Errors
    /// [`WorldError`]: an object or a light reaches into too many cells, or a cell is no polyhedron.
    pub fn new(scene: &Scene, plan: &Plan, observer: Frame) -> Result<Self, WorldError> {
        struct Build<'a>(&'a Scene, &'a Plan, Frame);
        impl Visitor for Build<'_> {
            type Output = Result<World, WorldError>;
            fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
                World::in_geometry(geometry, self.0, self.1, self.2)
            }
        }
        visit(scene.space.geometry, Build(scene, plan, observer))
    }

    /// The same with a geometry in place of that of the scene's space, whose coordinates it must share.
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn in_geometry<G: Geometry>(
        geometry: G,
        scene: &Scene,
        plan: &Plan,
        observer: Frame,
    ) -> Result<Self, WorldError> {
        Builder::new(geometry, scene, plan)?.build(observer)
    }
}

/// Primitives of one cell while they are collected.
#[derive(Default)]
pub(super) struct CellContent {
    pub boxes: Vec<Aabb>,
    pub names: Vec<u32>,
}

/// A world while it is built.
pub(super) struct Builder<'a, G> {
    pub geometry: G,
    scene: &'a Scene,
    plan: &'a Plan,
    pub domain: Domain,
    /// Shapes of the cells; a cell without end has none.
    pub polyhedra: Vec<Option<Polyhedron>>,
    pub contents: Vec<CellContent>,
    triangles: Vec<[DVec3; 3]>,
    triangle_shading: Vec<TriangleShading>,
    pub quadrics: Vec<WorldQuadric>,
    pub quadric_cells: Vec<usize>,
}

impl<'a, G: Geometry> Builder<'a, G> {
    fn new(geometry: G, scene: &'a Scene, plan: &'a Plan) -> Result<Self, WorldError> {
        let polyhedra = scene.space.cells.iter().map(Polyhedron::bounded).collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            geometry,
            scene,
            plan,
            domain: Domain::new(&scene.space),
            contents: polyhedra.iter().map(|_| CellContent::default()).collect(),
            polyhedra,
            triangles: Vec::new(),
            triangle_shading: Vec::new(),
            quadrics: Vec::new(),
            quadric_cells: Vec::new(),
        })
    }

    fn build(mut self, observer: Frame) -> Result<World, WorldError> {
        for (index, object) in self.scene.objects.iter().enumerate() {
            let frame = self.frame_of(object, observer)?;
            match object.shape {
                Shape::Mesh(mesh) => self.add_mesh(index, object, &self.scene.meshes[mesh], frame)?,
                Shape::Ball { radius } => {
                    self.add_ball(index, object, frame.cell, frame.point, radius)?;
                }
                Shape::Tube { radius, length } => {
                    let axis = Geodesic { point: frame.point, velocity: frame.axes[2] };
                    self.add_tube(index, object, frame.cell, axis, length, radius)?;
                }
                Shape::DomainEdges { radius } => self.add_edges(index, object, frame.cell, radius)?,
            }
        }
        self.finish(observer)
    }

    fn finish(self, observer: Frame) -> Result<World, WorldError> {
        let primitives = self.triangles.len() + self.quadrics.len();
        if primitives >= bvh::MAX_PRIMITIVES {
            return Err(WorldError::TooManyPrimitives(primitives, bvh::MAX_PRIMITIVES));
        }
        let (lights, light_ranges) = self.lights()?;
        let mut domain = self.domain;
        if self.plan.uses(Feature::Labels) {
            domain.labels = deck::label_table(self.geometry, &domain, observer.cell, self.scene.settings.bounces);
        }
        let (mut nodes, mut primitives) = (Vec::new(), Vec::new());
        let cells = self
            .contents
            .iter()
            .zip(light_ranges)
            .map(|(content, lights)| WorldCell {
                tree: bvh::build(&content.boxes, &content.names, &mut nodes, &mut primitives),
                lights,
            })
            .collect();
        Ok(World {
            geometry: self.scene.space.geometry,
            plan: self.plan.clone(),
            settings: self.scene.settings,
            domain,
            cells,
            nodes,
            primitives,
            triangles: self.triangles,
            triangle_shading: self.triangle_shading,
            quadrics: self.quadrics,
            materials: self.scene.materials.clone(),
            textures: if self.plan.uses(Feature::Textures) { self.scene.textures.clone() } else { Vec::new() },
            lights,
        })
    }

    /// Where an object's own frame is, with its point inside its cell.
    fn frame_of(&self, object: &Object, observer: Frame) -> Result<Frame, WorldError> {
        let frame = match object.place {
            Place::World(frame) => frame,
            Place::Viewer { offset, rotation } => observer.moved(self.geometry, offset).rotated(rotation),
        };
        reduce_frame(self.geometry, &self.domain, frame).ok_or_else(|| WorldError::Lost(object.name.clone()))
    }

    fn add_mesh(&mut self, index: usize, object: &Object, mesh: &Mesh, frame: Frame) -> Result<(), WorldError> {
        let geometry = self.geometry;
        let map = |x: DVec3| exponential(geometry, frame.point, frame.vector(x));
        let place = |vertex: &Vertex| {
            let position = vertex.position * object.scale;
            embed(geometry, map, position, vertex.normal, 1e-5 * position.length().max(1e-3))
        };
        let placed: Vec<Placed> = mesh.vertices.par_iter().map(place).collect();
        let uv = |vertex: u32| mesh.vertices[vertex as usize].uv;
        self.add_triangles(index, object, frame.cell, &placed, &mesh.triangles, uv).map(|_| ())
    }

    /// Adds all copies of a surface that reach into a cell; returns which.
    pub(super) fn add_triangles(
        &mut self,
        index: usize,
        object: &Object,
        cell: usize,
        placed: &[Placed],
        triangles: &[([u32; 3], usize)],
        uv: impl Fn(u32) -> [f32; 2],
    ) -> Result<Vec<Copy>, WorldError> {
        let geometry = self.geometry;
        let points: Vec<DVec4> = placed.iter().map(|p| p.point).collect();
        let corners = Corners { points: &points, triangles };
        let copies = copies(geometry, &self.domain, cell, &corners, &object.name)?;
        for copy in &copies {
            let moved: Vec<Placed> = placed
                .par_iter()
                .map(|p| {
                    let g = geometry.apply(&copy.isometry, Geodesic { point: p.point, velocity: p.normal });
                    Placed { point: g.point, normal: g.velocity }
                })
                .collect();
            for (triangle, material) in triangles {
                let corners = triangle.map(|i| moved[i as usize]);
                if all_beyond_one_face(geometry, &self.domain, copy.cell, &corners.map(|c| c.point)) {
                    continue;
                }
                let conormal = |c: Placed| geometry.lower(c.point, c.normal).as_vec3().to_array();
                let uv = triangle.map(&uv);
                let chart = corners.map(|c| geometry.chart(c.point));
                let content = &mut self.contents[copy.cell];
                content.names.push(self.triangles.len() as u32);
                content.boxes.push(Aabb::around(chart));
                self.triangles.push(chart);
                self.triangle_shading.push(TriangleShading {
                    conormal_a: conormal(corners[0]),
                    conormal_b: conormal(corners[1]),
                    conormal_c: conormal(corners[2]),
                    uv_a: uv[0],
                    uv_b: uv[1],
                    uv_c: uv[2],
                    material: object.material.unwrap_or(*material) as u32,
                    object: index as u32,
                });
            }
        }
        Ok(copies)
    }

    /// All images of all lights that reach into each cell.
    fn lights(&self) -> Result<(Vec<WorldLight>, Vec<std::ops::Range<usize>>), WorldError> {
        let mut per_cell: Vec<Vec<WorldLight>> = self.contents.iter().map(|_| Vec::new()).collect();
        if self.plan.uses(Feature::Lights) {
            for (number, light) in self.scene.lights.iter().enumerate() {
                let name = format!("light {number}");
                let copies = if self.geometry.ball(light.point, light.range).is_some() {
                    let extent = Balls { centres: &[light.point], radius: light.range };
                    copies(self.geometry, &self.domain, light.cell, &extent, &name)?
                } else {
                    let extent = Sphere::new(self.geometry, light.point, light.range);
                    copies(self.geometry, &self.domain, light.cell, &extent, &name)?
                };
                for copy in copies {
                    let velocity = light.spot.map_or(DVec4::ZERO, |spot| spot.direction);
                    let image = self.geometry.apply(&copy.isometry, Geodesic { point: light.point, velocity });
                    per_cell[copy.cell].push(WorldLight {
                        point: image.point,
                        color: light.color,
                        range: light.range,
                        closest: closeness_at(self.geometry, light.range),
                        spot: light.spot.map(|spot| (image.velocity, spot.cos_angle)),
                        shadows: light.shadows,
                    });
                }
            }
        }
        let mut next = 0;
        let ranges = per_cell
            .iter()
            .map(|lights| {
                next += lights.len();
                next - lights.len()..next
            })
            .collect();
        Ok((per_cell.concat(), ranges))
    }
}

/// The closeness of points at a distance; less than that of any two points where none are so far apart.
fn closeness_at<G: Geometry>(geometry: G, distance: f64) -> f64 {
    let base = geometry.base();
    let point = geometry.flow(Geodesic { point: base, velocity: geometry.frame(base)[0] }, distance).point;
    let reached = geometry.distance(base, point) > distance * (1.0 - 1e-9);
    if reached { geometry.closeness(base, point) } else { f64::NEG_INFINITY }
}
