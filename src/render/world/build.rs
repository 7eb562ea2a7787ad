//! From a scene to a [`World`].

use super::{
    Mover, Pose, World, WorldCell, WorldError, WorldLight, WorldQuadric,
    meshes::{Meshes, RestMesh},
    place::{Balls, Copy, Corners, copies},
};
use crate::{
    geometry::{Geodesic, Geometry, Isometry, Quadric, Visitor, carry, visit},
    render::{
        bvh::{self, Aabb},
        plan::{Feature, Plan},
    },
    scene::{Object, Place, Scene, Shape},
    space::{deck, domain::Domain, observer::Frame, polyhedron::Polyhedron, reduce::reduce_frame},
};
use glam::{DMat3, DQuat, DVec3, DVec4};
use std::{
    collections::HashMap,
    sync::{Arc, OnceLock},
};

impl World {
    /// Prepares `scene` as seen by `observer` (attached objects are with him), at time 0.
    ///
    /// # Errors
    /// [`WorldError`]: an object or a light reaches into too many cells, or a cell is no polyhedron.
    pub fn new(scene: &Scene, plan: &Plan, observer: Frame) -> Result<Self, WorldError> {
        visit(scene.space.geometry, Build { scene, plan, pose: Pose { observer, time: 0.0 }, last: None })
    }

    /// Prepares `scene` for a sequence of pictures: objects in motion and objects attached to the observer can be
    /// posed again by [`World::posed`].
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn moving(scene: &Scene, plan: &Plan, pose: Pose) -> Result<Self, WorldError> {
        visit(scene.space.geometry, Build { scene, plan, pose, last: Some(&[]) })
    }

    /// The same scene in another pose; what rests is shared with this world. For worlds made by [`World::moving`].
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn posed(&self, scene: &Scene, pose: Pose) -> Result<Self, WorldError> {
        struct Again<'a>(&'a World, &'a Scene, Pose);
        impl Visitor for Again<'_> {
            type Output = Result<World, WorldError>;
            fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
                Builder::new(geometry, self.1, &self.0.plan)?.pose_again(self.0, self.2)
            }
        }
        visit(scene.space.geometry, Again(self, scene, pose))
    }
}

struct Build<'a> {
    scene: &'a Scene,
    plan: &'a Plan,
    pose: Pose,
    /// Movers of the last pose; none if nothing shall move.
    last: Option<&'a [Mover]>,
}

impl Visitor for Build<'_> {
    type Output = Result<World, WorldError>;
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        Builder::new(geometry, self.scene, self.plan)?.build(self.pose, self.last)
    }
}

struct Builder<'a, G> {
    geometry: G,
    scene: &'a Scene,
    plan: &'a Plan,
    domain: Domain,
    polyhedra: Vec<Polyhedron>,
    meshes: Meshes,
    /// For each mesh and scale, how its first copy came to its place: the frame of its object, the copy's isometry, and
    /// the copy's index.
    first_copies: HashMap<(usize, u64), (Frame, Isometry, usize)>,
    movers: Vec<Mover>,
    quadrics: Vec<WorldQuadric>,
}

impl<'a, G: Geometry> Builder<'a, G> {
    fn new(geometry: G, scene: &'a Scene, plan: &'a Plan) -> Result<Self, WorldError> {
        let polyhedra = scene.space.cells.iter().map(Polyhedron::new).collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            geometry,
            scene,
            plan,
            domain: Domain::new(&scene.space),
            polyhedra,
            meshes: Meshes::default(),
            first_copies: HashMap::new(),
            movers: Vec::new(),
            quadrics: Vec::new(),
        })
    }

    fn build(mut self, pose: Pose, last: Option<&[Mover]>) -> Result<World, WorldError> {
        self.place_objects(pose, |_| true, last)?;
        self.check_number(&self.meshes)?;
        let is_quadric = |object: &Object| !matches!(object.shape, Shape::Mesh(_));
        let quadrics_move = self.scene.objects.iter().any(|object| is_quadric(object) && object.moves());
        let (lights, light_ranges) = self.lights()?;
        let mut domain = self.domain;
        if self.plan.uses(Feature::Labels) {
            let bounces = self.scene.settings.bounces;
            domain.labels = deck::label_table(self.geometry, &domain, pose.observer.cell, bounces);
        }
        Ok(World {
            geometry: self.scene.space.geometry,
            plan: self.plan.clone(),
            settings: self.scene.settings,
            domain: Arc::new(domain),
            cells: light_ranges.into_iter().map(|lights| WorldCell { lights }).collect(),
            still: Arc::new(self.meshes),
            movers: self.movers,
            quadrics: self.quadrics,
            materials: Arc::new(self.scene.materials.clone()),
            textures: if self.plan.uses(Feature::Textures) {
                Arc::new(self.scene.textures.clone())
            } else {
                Arc::default()
            },
            lights: Arc::new(lights),
            posed: OnceLock::new(),
            quadrics_move: last.is_some() && quadrics_move,
            hierarchy: OnceLock::new(),
        })
    }

    /// The pose of `last` again: what rests is taken over.
    fn pose_again(mut self, last: &World, pose: Pose) -> Result<World, WorldError> {
        // Quadrics are few and are all placed again; meshes only where they move.
        let moves = |object: &Object| !matches!(object.shape, Shape::Mesh(_)) || object.moves();
        self.place_objects(pose, moves, Some(&last.movers))?;
        self.check_number(&last.still)?;
        Ok(World {
            geometry: last.geometry,
            plan: last.plan.clone(),
            settings: last.settings,
            domain: last.domain.clone(),
            cells: last.cells.clone(),
            still: last.still.clone(),
            movers: self.movers,
            quadrics: self.quadrics,
            materials: last.materials.clone(),
            textures: last.textures.clone(),
            lights: last.lights.clone(),
            posed: OnceLock::new(),
            quadrics_move: last.quadrics_move,
            hierarchy: OnceLock::new(),
        })
    }

    fn place_objects(
        &mut self,
        pose: Pose,
        placed: impl Fn(&Object) -> bool,
        last: Option<&[Mover]>,
    ) -> Result<(), WorldError> {
        for (index, object) in self.scene.objects.iter().enumerate().filter(|(_, object)| placed(object)) {
            let frame = self.frame_of(object, pose)?;
            match object.shape {
                Shape::Mesh(mesh) => match last.filter(|_| object.moves()) {
                    Some(last) => self.add_mover(index, object, mesh, frame, last)?,
                    None => self.add_mesh(index, object, mesh, frame)?,
                },
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
        self.quadrics.sort_by_key(|q| (q.cell, q.material));
        Ok(())
    }

    fn check_number(&self, meshes: &Meshes) -> Result<(), WorldError> {
        let moving: usize = self.movers.iter().map(|m| m.rest.triangles.len() * m.copies.len()).sum();
        let primitives = meshes.triangles.len() + moving + self.quadrics.len();
        if primitives >= bvh::MAX_PRIMITIVES {
            return Err(WorldError::TooManyPrimitives(primitives, bvh::MAX_PRIMITIVES));
        }
        Ok(())
    }

    /// Where an object's own frame is, with its point inside its cell.
    fn frame_of(&self, object: &Object, pose: Pose) -> Result<Frame, WorldError> {
        let frame = match object.place {
            Place::World(frame) => frame,
            Place::Viewer { offset, rotation } => pose.observer.moved(self.geometry, offset).rotated(rotation),
        };
        let frame = match object.motion {
            Some(motion) => {
                let turn = DMat3::from_quat(DQuat::from_scaled_axis(motion.turn * pose.time));
                frame.moved(self.geometry, motion.velocity * pose.time).rotated(turn)
            }
            None => frame,
        };
        reduce_frame(self.geometry, &self.domain, frame).ok_or_else(|| WorldError::Lost(object.name.clone()))
    }

    fn rest(&self, index: usize, object: &Object, mesh: usize, frame: Frame) -> RestMesh {
        let mesh = &self.scene.meshes[mesh];
        RestMesh::new(self.geometry, mesh, index as u32, frame, object.scale, object.material)
    }

    fn add_mesh(&mut self, index: usize, object: &Object, mesh: usize, frame: Frame) -> Result<(), WorldError> {
        let geometry = self.geometry;
        let rest = self.rest(index, object, mesh, frame);
        let corners = Corners { rest: &rest, carried: Isometry::IDENTITY };
        let key = (mesh, object.scale.to_bits());
        for copy in copies(geometry, &self.domain, frame.cell, &corners, &object.name)? {
            let image_of = match self.first_copies.get(&key) {
                Some((first, isometry, index)) => {
                    carry(geometry, first.axes_at(), frame.axes_at()).and_then(|carried| {
                        let here = geometry.compose(&copy.isometry, &carried);
                        let relative = geometry.compose(&here, &geometry.inverse(isometry));
                        Some((*index, geometry.chart_action(&relative)?))
                    })
                }
                None => {
                    self.first_copies.insert(key, (frame, copy.isometry, self.meshes.copies.len()));
                    None
                }
            };
            self.meshes.add(geometry, &self.domain, &rest, &copy, image_of);
        }
        Ok(())
    }

    /// Adds an object that moves. Where an isometry carries it from its rest in the last pose, it keeps that rest.
    fn add_mover(
        &mut self,
        index: usize,
        object: &Object,
        mesh: usize,
        frame: Frame,
        last: &[Mover],
    ) -> Result<(), WorldError> {
        let known = last.iter().find(|mover| mover.rest.object == index as u32);
        let kept = known.and_then(|mover| {
            let carried = carry(self.geometry, mover.rest.frame.axes_at(), frame.axes_at())?;
            Some((mover.rest.clone(), carried))
        });
        let (rest, carried) =
            kept.unwrap_or_else(|| (Arc::new(self.rest(index, object, mesh, frame)), Isometry::IDENTITY));
        let corners = Corners { rest: &rest, carried };
        let copies = copies(self.geometry, &self.domain, frame.cell, &corners, &object.name)?
            .into_iter()
            .map(|copy| Copy { isometry: self.geometry.compose(&copy.isometry, &carried), ..copy })
            .collect();
        self.movers.push(Mover { rest, copies });
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
                let ball = geometry.ball(image, radius);
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
                .map(|i| ball_box(&geometry.ball(geometry.flow(start, spacing * i as f64).point, wide)))
                .fold(Aabb::EMPTY, Aabb::union);
            let clips = [clip(start, 1.0), clip(end, -1.0)];
            self.add_quadric(index, object, copy, geometry.tube(start, radius), clips, bounds);
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
        let is_known = self.quadrics.iter().any(|known| {
            known.cell == copy.cell
                && known.object == index as u32
                && (0..4).all(|i| same(known.surface.matrix().col(i), form.col(i)))
                && (same(known.clip[0], clip[0]) && same(known.clip[1], clip[1])
                    || same(known.clip[0], clip[1]) && same(known.clip[1], clip[0]))
        });
        let bounds = bounds.intersection(Aabb::around(self.polyhedra[copy.cell].vertices.iter().copied()));
        if is_known || bounds.lower.cmpgt(bounds.upper).any() {
            return;
        }
        let object = index as u32;
        self.quadrics.push(WorldQuadric { surface, clip, bounds, cell: copy.cell, material, object });
    }

    /// All images of all lights that reach into each cell.
    fn lights(&self) -> Result<(Vec<WorldLight>, Vec<std::ops::Range<usize>>), WorldError> {
        let mut per_cell: Vec<Vec<WorldLight>> = self.polyhedra.iter().map(|_| Vec::new()).collect();
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
