//! From a scene to a [`World`].

use super::{
    World, WorldCell, WorldError, WorldLight, WorldQuadric,
    place::{Balls, Copy, Corners, all_beyond_one_face, copies},
};
use crate::{
    geometry::{Geodesic, Geometry, Quadric, Visitor, exponential, visit},
    render::{
        bvh::{self, Aabb},
        plan::{Feature, Plan},
    },
    scene::{Mesh, Object, Place, Scene, Shape},
    shader_io::{QUADRIC_BIT, TriangleShading},
    space::{deck, domain::Domain, observer::Frame, polyhedron::Polyhedron, reduce::reduce_frame},
};
use glam::{DMat3, DVec3, DVec4};
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
                Builder::new(geometry, self.0, self.1)?.build(self.2)
            }
        }
        visit(scene.space.geometry, Build(scene, plan, observer))
    }
}

/// Primitives of one cell while they are collected.
#[derive(Default)]
struct CellContent {
    boxes: Vec<Aabb>,
    names: Vec<u32>,
}

struct Builder<'a, G> {
    geometry: G,
    scene: &'a Scene,
    plan: &'a Plan,
    domain: Domain,
    polyhedra: Vec<Polyhedron>,
    contents: Vec<CellContent>,
    triangles: Vec<[DVec3; 3]>,
    triangle_shading: Vec<TriangleShading>,
    quadrics: Vec<WorldQuadric>,
    quadric_cells: Vec<usize>,
}

/// A point of a mesh in the space: position and normal, in the model.
#[derive(Clone, Copy)]
struct Placed {
    point: DVec4,
    normal: DVec4,
}

impl<'a, G: Geometry> Builder<'a, G> {
    fn new(geometry: G, scene: &'a Scene, plan: &'a Plan) -> Result<Self, WorldError> {
        let polyhedra = scene.space.cells.iter().map(Polyhedron::new).collect::<Result<Vec<_>, _>>()?;
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
                Shape::Ball { radius } => self.add_balls(index, object, frame.cell, &[frame.point], radius)?,
                Shape::Tube { radius, length } => {
                    let axis = Geodesic { point: frame.point, velocity: frame.axes[2] };
                    self.add_tube(index, object, frame.cell, axis, length, radius)?;
                    let ends = [frame.point, self.geometry.flow(axis, length).point];
                    self.add_balls(index, object, frame.cell, &ends, radius)?;
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
        let placed: Vec<Placed> = mesh
            .vertices
            .par_iter()
            .map(|vertex| place_vertex(geometry, frame, vertex.position * object.scale, vertex.normal))
            .collect();
        let points: Vec<DVec4> = placed.iter().map(|p| p.point).collect();
        let corners = Corners { points: &points, triangles: &mesh.triangles };
        for copy in copies(geometry, &self.domain, frame.cell, &corners, &object.name)? {
            let moved: Vec<Placed> = placed
                .par_iter()
                .map(|p| {
                    let g = geometry.apply(&copy.isometry, Geodesic { point: p.point, velocity: p.normal });
                    Placed { point: g.point, normal: g.velocity }
                })
                .collect();
            for (triangle, material) in &mesh.triangles {
                let corners = triangle.map(|i| moved[i as usize]);
                if all_beyond_one_face(geometry, &self.domain, copy.cell, &corners.map(|c| c.point)) {
                    continue;
                }
                let conormal = |c: Placed| geometry.lower(c.point, c.normal).as_vec3().to_array();
                let uv = triangle.map(|i| mesh.vertices[i as usize].uv);
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
        Ok(())
    }

    /// Tubes around the edges of a cell, and balls at its vertices.
    fn add_edges(&mut self, index: usize, object: &Object, cell: usize, radius: f64) -> Result<(), WorldError> {
        let polyhedron = self.polyhedra[cell].clone();
        let vertices: Vec<DVec4> = polyhedron.vertices.iter().filter_map(|c| self.geometry.unchart(*c)).collect();
        if vertices.len() != polyhedron.vertices.len() {
            return Err(WorldError::OutsideChart(object.name.clone()));
        }
        for edge in &polyhedron.edges {
            let [a, b] = edge.vertices.map(|v| vertices[v]);
            let (velocity, length) = self.geometry.log(a, b);
            self.add_tube(index, object, cell, Geodesic { point: a, velocity }, length, radius)?;
        }
        self.add_balls(index, object, cell, &vertices, radius)
    }

    fn add_balls(
        &mut self,
        index: usize,
        object: &Object,
        cell: usize,
        centres: &[DVec4],
        radius: f64,
    ) -> Result<(), WorldError> {
        let geometry = self.geometry;
        for centre in centres {
            let extent = Balls { centres: &[*centre], radius };
            for copy in copies(geometry, &self.domain, cell, &extent, &object.name)? {
                let image = geometry.apply(&copy.isometry, Geodesic { point: *centre, velocity: DVec4::ZERO }).point;
                let Some(ball) = geometry.ball(image, radius) else { continue };
                self.add_quadric(index, object, copy, ball, [DVec4::W; 2], ball_box(&ball));
            }
        }
        Ok(())
    }

    fn add_tube(
        &mut self,
        index: usize,
        object: &Object,
        cell: usize,
        axis: Geodesic,
        length: f64,
        radius: f64,
    ) -> Result<(), WorldError> {
        let geometry = self.geometry;
        // A tube lies inside the union of balls along its axis, with half of their spacing added to the radius.
        const BALLS: usize = 48;
        let spacing = length / BALLS as f64;
        let along: Vec<DVec4> = (0..=BALLS).map(|i| geometry.flow(axis, spacing * i as f64).point).collect();
        let wide = radius + 0.5 * spacing;
        let extent = Balls { centres: &along, radius: wide };
        for copy in copies(geometry, &self.domain, cell, &extent, &object.name)? {
            let start = geometry.apply(&copy.isometry, axis);
            let end = geometry.flow(start, length);
            let clip = |g: Geodesic, sign: f64| {
                let conormal = geometry.lower(g.point, g.velocity) * sign;
                conormal.extend(-conormal.dot(geometry.chart(g.point)))
            };
            let bounds = (0..=BALLS)
                .filter_map(|i| geometry.ball(geometry.flow(start, spacing * i as f64).point, wide))
                .map(|ball| ball_box(&ball))
                .fold(Aabb::EMPTY, Aabb::union);
            let clips = [clip(start, 1.0), clip(end, -1.0)];
            let Some(tube) = geometry.tube(start, radius) else { continue };
            self.add_quadric(index, object, copy, tube, clips, bounds);
        }
        Ok(())
    }

    /// Adds a quadric to a cell unless the same surface is there already (edges of a cell are copies of one another).
    fn add_quadric(
        &mut self,
        index: usize,
        object: &Object,
        copy: Copy,
        surface: Quadric,
        clip: [DVec4; 2],
        bounds: Aabb,
    ) {
        // Quadrics have a material of their own: the scene reader refuses them without.
        let material = object.material.unwrap_or(0) as u32;
        let same = |a: DVec4, b: DVec4| (a - b).abs().max_element() < 1e-9;
        // Frames that name the same surface may be turned against each other, so its matrix is compared.
        let form = surface.matrix();
        let is_known = self.quadrics.iter().zip(&self.quadric_cells).any(|(known, cell)| {
            *cell == copy.cell
                && known.object == index as u32
                && (0..4).all(|i| same(known.surface.matrix().col(i), form.col(i)))
                && (same(known.clip[0], clip[0]) && same(known.clip[1], clip[1])
                    || same(known.clip[0], clip[1]) && same(known.clip[1], clip[0]))
        });
        let inside = bounds.intersection(Aabb::around(self.polyhedra[copy.cell].vertices.iter().copied()));
        if is_known || inside.lower.cmpgt(inside.upper).any() {
            return;
        }
        let content = &mut self.contents[copy.cell];
        content.names.push(self.quadrics.len() as u32 | QUADRIC_BIT);
        content.boxes.push(inside);
        self.quadrics.push(WorldQuadric { surface, clip, material, object: index as u32 });
        self.quadric_cells.push(copy.cell);
    }

    /// All images of all lights that reach into each cell.
    fn lights(&self) -> Result<(Vec<WorldLight>, Vec<std::ops::Range<usize>>), WorldError> {
        let mut per_cell: Vec<Vec<WorldLight>> = self.contents.iter().map(|_| Vec::new()).collect();
        if self.plan.uses(Feature::Lights) {
            for (number, light) in self.scene.lights.iter().enumerate() {
                let extent = Balls { centres: &[light.point], radius: light.range };
                let name = format!("light {number}");
                for copy in copies(self.geometry, &self.domain, light.cell, &extent, &name)? {
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

/// A vertex brought into the space by the exponential map at the object's frame. Its normal follows as a covector
/// by the inverse transpose of the map's differential, taken by central differences: accurate to 1e-9 and valid in
/// every geometry.
fn place_vertex<G: Geometry>(geometry: G, frame: Frame, position: DVec3, normal: DVec3) -> Placed {
    let at = |x: DVec3| exponential(geometry, frame.point, frame.vector(x));
    let point = at(position);
    let h = 1e-5 * position.length().max(1e-3);
    let column = |e: DVec3| (geometry.chart(at(position + e * h)) - geometry.chart(at(position - e * h))) / (2.0 * h);
    let differential = DMat3::from_cols(column(DVec3::X), column(DVec3::Y), column(DVec3::Z));
    let conormal = differential.inverse().transpose() * normal;
    let usable = conormal.is_finite() && conormal.length_squared() > 0.0;
    Placed { point, normal: geometry.raise(point, if usable { conormal } else { DVec3::Z }) }
}

/// The box of an ellipsoid in the chart: its tangent planes are the zeros of the inverse matrix.
fn ball_box(ball: &Quadric) -> Aabb {
    let dual = ball.matrix().inverse();
    let mut bounds = Aabb { lower: DVec3::NEG_INFINITY, upper: DVec3::INFINITY };
    for axis in 0..3 {
        // Planes x_axis = s: dual_aa − 2 s dual_aw + s² dual_ww = 0.
        let (aa, aw, ww) = (dual.col(axis)[axis], dual.col(3)[axis], dual.col(3)[3]);
        let root = (aw * aw - aa * ww).max(0.0).sqrt();
        let ends = [(aw + root) / ww, (aw - root) / ww];
        // An unbounded quadric (a ball that reaches the horizon) keeps the infinite box.
        if ww < 0.0 && ends.iter().all(|e| e.is_finite()) {
            bounds.lower[axis] = ends[0].min(ends[1]);
            bounds.upper[axis] = ends[0].max(ends[1]);
        }
    }
    bounds
}
