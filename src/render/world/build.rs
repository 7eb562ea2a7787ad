//! From a scene to a [`World`].

use super::{
    Mover, Pose, World, WorldError, WorldQuadric,
    lights::Lights,
    meshes::{Meshes, RestMesh},
    place::{Copy, Corners, copies},
    shapes::{Solids, grid_lines},
};
use crate::{
    geometry::{Geodesic, Geometry, Isometry, Visitor, carry, visit},
    render::{
        bvh,
        plan::{Feature, Plan},
    },
    scene::{Object, Place, Scene, Shape},
    space::{deck, domain::Domain, observer::Frame, polyhedron::Polyhedron, reduce::reduce_frame},
};
use glam::{DAffine3, DMat3, DQuat, DVec3};
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
        visit(scene.space.geometry, Build { scene, plan, pose: Pose::new(observer, 0.0), moving: false })
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
        Builder::new(geometry, scene, plan, &Motions::Frozen)?.build(Pose::new(observer, 0.0))
    }

    /// Prepares `scene` for a sequence of pictures: objects in motion and objects attached to the observer can be
    /// posed again by [`World::posed`].
    ///
    /// # Errors
    /// As [`World::new`].
    pub fn moving(scene: &Scene, plan: &Plan, pose: Pose) -> Result<Self, WorldError> {
        visit(scene.space.geometry, Build { scene, plan, pose, moving: true })
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
                let motions = Motions::Again(&self.0.movers);
                Builder::new(geometry, self.1, &self.0.plan, &motions)?.pose_again(self.0, self.2)
            }
        }
        visit(scene.space.geometry, Again(self, scene, pose))
    }
}

/// How a copy of a mesh came to its place that others may be images of.
struct FirstCopy {
    /// The frame of its object.
    frame: Frame,
    /// What its object's lengths are multiplied by.
    scale: f64,
    /// The affine map of the chart back from the copy to the object's own place.
    back: DAffine3,
    /// The copy's index.
    index: usize,
}

impl FirstCopy {
    /// Images are at most as many times larger or smaller, so that f32 has the same places about as exactly.
    const MOST: f64 = 4.0;

    /// The index of this copy, and the affine map of the chart to another one of an object with the same mesh.
    fn image<G: Geometry>(&self, geometry: G, frame: Frame, scale: f64, copy: &Copy) -> Option<(usize, DAffine3)> {
        let factor = scale / self.scale;
        if !(1.0 / Self::MOST..=Self::MOST).contains(&factor) {
            return None;
        }
        let carried = carry(geometry, self.frame.axes_at(), frame.axes_at())?;
        let there = geometry.chart_action(&geometry.compose(&copy.isometry, &carried))?;
        let dilation = geometry.chart_dilation(self.frame.point, factor)?;
        Some((self.index, there * dilation * self.back))
    }
}

struct Build<'a> {
    scene: &'a Scene,
    plan: &'a Plan,
    pose: Pose,
    moving: bool,
}

/// What a world does about objects that move.
pub(super) enum Motions<'a> {
    /// It is for a single picture.
    Frozen,
    /// It is the first of a sequence.
    First,
    /// It is another pose of a world with these movers: what rests is there already.
    Again(&'a [Mover]),
}

impl Visitor for Build<'_> {
    type Output = Result<World, WorldError>;
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let motions = if self.moving { Motions::First } else { Motions::Frozen };
        Builder::new(geometry, self.scene, self.plan, &motions)?.build(self.pose)
    }
}

/// A world while it is built.
pub(super) struct Builder<'a, G> {
    pub geometry: G,
    scene: &'a Scene,
    plan: &'a Plan,
    motions: &'a Motions<'a>,
    pub domain: Domain,
    /// Shapes of the cells; a cell without end has none.
    pub polyhedra: Vec<Option<Polyhedron>>,
    meshes: Meshes,
    /// For each mesh the copies that others may be images of.
    first_copies: HashMap<usize, Vec<FirstCopy>>,
    movers: Vec<Mover>,
    pub quadrics: Vec<WorldQuadric>,
    /// What they are.
    pub solids: Solids,
}

impl<'a, G: Geometry> Builder<'a, G> {
    fn new(geometry: G, scene: &'a Scene, plan: &'a Plan, motions: &'a Motions<'a>) -> Result<Self, WorldError> {
        let polyhedra = scene.space.cells.iter().map(Polyhedron::bounded).collect::<Result<Vec<_>, _>>()?;
        Ok(Self {
            geometry,
            scene,
            plan,
            motions,
            domain: Domain::new(&scene.space),
            polyhedra,
            meshes: Meshes::default(),
            first_copies: HashMap::new(),
            movers: Vec::new(),
            quadrics: Vec::new(),
            solids: Solids::default(),
        })
    }

    fn build(mut self, pose: Pose) -> Result<World, WorldError> {
        self.place_objects(pose)?;
        self.check_number(&self.meshes)?;
        let is_quadric = |object: &Object| !object.shape.is_flat();
        let quadrics_move = self.scene.objects.iter().any(|object| is_quadric(object) && object.moves());
        let lights: &[_] = if self.plan.uses(Feature::Lights) { &self.scene.lights } else { &[] };
        let lights = Lights::new(self.geometry, &self.domain, &self.polyhedra, lights)?;
        let sagitta = sagitta(self.meshes.triangles.iter());
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
            sagitta,
            posed: OnceLock::new(),
            quadrics_move: !matches!(self.motions, Motions::Frozen) && quadrics_move,
            hierarchy: OnceLock::new(),
        })
    }

    /// The pose of `last` again: what rests is taken over.
    fn pose_again(mut self, last: &World, pose: Pose) -> Result<World, WorldError> {
        self.place_objects(pose)?;
        self.check_number(&last.still)?;
        Ok(World {
            geometry: last.geometry,
            plan: last.plan.clone(),
            settings: last.settings,
            domain: last.domain.clone(),
            still: last.still.clone(),
            movers: self.movers,
            quadrics: self.quadrics,
            materials: last.materials.clone(),
            textures: last.textures.clone(),
            lights: last.lights.clone(),
            sagitta: last.sagitta,
            posed: OnceLock::new(),
            quadrics_move: last.quadrics_move,
            hierarchy: OnceLock::new(),
        })
    }

    fn place_objects(&mut self, pose: Pose) -> Result<(), WorldError> {
        for (index, object) in self.scene.objects.iter().enumerate() {
            // Quadrics are few and are all placed again in each pose; triangles only where they move.
            let divided = object.shape.is_flat() || !self.has_quadrics();
            if divided && !object.moves() && matches!(self.motions, Motions::Again(_)) {
                continue;
            }
            let Some(frame) = self.frame_of(object, pose)? else {
                // A hand that is not tracked: its mesh keeps its place among those that move.
                if let (Shape::Mesh(mesh), false) = (object.shape, matches!(self.motions, Motions::Frozen)) {
                    self.add_absent(index, object, mesh, pose.observer);
                }
                continue;
            };
            match object.shape {
                Shape::Mesh(mesh) if object.moves() && !matches!(self.motions, Motions::Frozen) => {
                    self.add_mover(index, object, mesh, frame)?;
                }
                Shape::Mesh(mesh) => self.add_mesh(index, object, mesh, frame)?,
                Shape::Ball { radius } => {
                    self.add_ball(index, object, frame.cell, frame.point, radius)?;
                }
                Shape::Tube { radius, length } => {
                    let axis = Geodesic { point: frame.point, velocity: frame.axes[2] };
                    self.add_tube(index, object, frame.cell, axis, length, radius)?;
                }
                Shape::DomainEdges { radius } => self.add_edges(index, object, frame.cell, radius)?,
                Shape::DomainFaces { width, face } => self.add_faces(index, object, frame.cell, width, face)?,
                Shape::Grid { lower, upper, lines, radius } => {
                    for ends in grid_lines(lower, upper, lines) {
                        self.add_line(index, object, frame.cell, ends, radius)?;
                    }
                }
            }
        }
        self.drop_hidden_balls();
        bvh::halve(&mut self.quadrics, |q| q.cell, |q| q.bounds.centre());
        Ok(())
    }

    /// Whether balls and tubes are quadrics of the chart; else they are divided into triangles.
    fn has_quadrics(&self) -> bool {
        self.geometry.ball(self.geometry.base(), 0.1).is_some()
    }

    fn check_number(&self, meshes: &Meshes) -> Result<(), WorldError> {
        let moving: usize = self.movers.iter().map(|m| m.rest.triangles.len() * m.copies.len()).sum();
        let primitives = meshes.triangles.len() + moving + self.quadrics.len();
        if primitives >= bvh::MAX_PRIMITIVES {
            return Err(WorldError::TooManyPrimitives(primitives, bvh::MAX_PRIMITIVES));
        }
        Ok(())
    }

    /// Where an object's own frame is, with its point inside its cell; none for what hangs off a hand that is not tracked.
    fn frame_of(&self, object: &Object, pose: Pose) -> Result<Option<Frame>, WorldError> {
        let hung = |frame: Frame, offset, rotation| frame.moved(self.geometry, offset).rotated(rotation);
        let frame = match object.place {
            Place::World(frame) => frame,
            Place::Viewer { offset, rotation } => hung(pose.observer, offset, rotation),
            Place::Hand { hand, offset, rotation } => match pose.hands[hand as usize] {
                Some(grip) => hung(grip, offset, rotation),
                None => return Ok(None),
            },
        };
        let frame = match object.motion {
            Some(motion) => {
                let turn = DMat3::from_quat(DQuat::from_scaled_axis(motion.turn * pose.time));
                frame.moved(self.geometry, motion.velocity * pose.time).rotated(turn)
            }
            None => frame,
        };
        let reduced = reduce_frame(self.geometry, &self.domain, frame);
        reduced.map(Some).ok_or_else(|| WorldError::Lost(object.name.clone()))
    }

    fn rest(&self, index: usize, object: &Object, mesh: usize, frame: Frame) -> RestMesh {
        let mesh = &self.scene.meshes[mesh];
        RestMesh::new(self.geometry, mesh, index as u32, frame, object.scale, object.material)
    }

    fn add_mesh(&mut self, index: usize, object: &Object, mesh: usize, frame: Frame) -> Result<(), WorldError> {
        let geometry = self.geometry;
        let rest = self.rest(index, object, mesh, frame);
        let corners = Corners { rest: &rest, carried: Isometry::IDENTITY };
        for copy in copies(geometry, &self.domain, frame.cell, &corners, &object.name)? {
            let of_mesh = self.first_copies.entry(mesh).or_default();
            let image_of = of_mesh.iter().find_map(|first| first.image(geometry, frame, object.scale, &copy));
            // Where isometries act otherwise nothing is an image of anything.
            if image_of.is_none()
                && let Some(back) = geometry.chart_action(&geometry.inverse(&copy.isometry))
            {
                of_mesh.push(FirstCopy { frame, scale: object.scale, back, index: self.meshes.copies.len() });
            }
            self.meshes.add(geometry, &self.domain, &rest, &copy, image_of);
        }
        Ok(())
    }

    /// Adds an object that moves. Where an isometry carries it from its rest in the last pose, it keeps that rest.
    fn add_mover(&mut self, index: usize, object: &Object, mesh: usize, frame: Frame) -> Result<(), WorldError> {
        let last = if let Motions::Again(last) = self.motions { *last } else { &[] };
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

    /// Adds an object that moves and is not there at present.
    fn add_absent(&mut self, index: usize, object: &Object, mesh: usize, somewhere: Frame) {
        let last = if let Motions::Again(last) = self.motions { *last } else { &[] };
        let known = last.iter().find(|mover| mover.rest.object == index as u32).map(|mover| mover.rest.clone());
        let rest = known.unwrap_or_else(|| Arc::new(self.rest(index, object, mesh, somewhere)));
        self.movers.push(Mover { rest, copies: Vec::new() });
    }

    /// Adds a surface that was divided into triangles; returns the copies of it that reach into cells.
    pub(super) fn add_divided(&mut self, object: &Object, rest: RestMesh) -> Result<Vec<Copy>, WorldError> {
        let corners = Corners { rest: &rest, carried: Isometry::IDENTITY };
        let copies = copies(self.geometry, &self.domain, rest.frame.cell, &corners, &object.name)?;
        if object.moves() && !matches!(self.motions, Motions::Frozen) {
            self.movers.push(Mover { rest: Arc::new(rest), copies: copies.clone() });
        } else {
            for copy in &copies {
                self.meshes.add(self.geometry, &self.domain, &rest, copy, None);
            }
        }
        Ok(copies)
    }
}

/// How far pieces of arcs may bulge that a device's own traversal gets: boxes are larger than their triangles by half of it. So it
/// is half of the size that most triangles have, but not so little that fine meshes would cut arcs into many pieces.
fn sagitta<'a>(triangles: impl Iterator<Item = &'a [DVec3; 3]>) -> f64 {
    const LEAST: f64 = 1.0 / 1024.0;
    const NOTHING_RESTS: f64 = 1.0 / 128.0;
    let size = |[a, b, c]: &[DVec3; 3]| (a.max(*b).max(*c) - a.min(*b).min(*c)).max_element();
    let mut sizes: Vec<f64> = triangles.map(size).filter(|size| size.is_finite()).collect();
    let middle = sizes.len() / 2;
    if sizes.is_empty() {
        return NOTHING_RESTS;
    }
    let (_, median, _) = sizes.select_nth_unstable_by(middle, f64::total_cmp);
    // As f32, so that boxes have room for what the device has.
    f64::from((0.5 * *median).max(LEAST) as f32)
}
