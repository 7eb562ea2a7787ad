//! Traversal of the hierarchy. Twin: `shaders/trace/compute.glsl`.

use super::{
    Counts,
    surface::{NO_HIT, Surface, is_hole, quadric_hit, triangle_hit},
};
use crate::{
    geometry::{Geometry, Isometry, Segment},
    integrate::Method,
    render::{
        Shot,
        bvh::{Grid, Primitive, Reference, Tree},
        plan::{Feature, Heat},
        world::{World, hierarchy::Hierarchy, meshes::Meshes},
    },
    scene::Shading,
    shader_io::{COUNT_NODES, COUNT_QUADRICS, COUNT_TRIANGLES, Node, SHADOW_BOUNCES, STACK_SIZE},
    space::{
        stepped,
        walk::{Follow, Path, Status, stage_segment, stage_transport},
    },
};
use glam::{DVec3, Vec3, Vec4};

/// Everything that tracing reads: the world, the plan's switches, the shot.
pub struct Tracer<'a, G> {
    pub(super) geometry: G,
    pub(super) world: &'a World,
    pub(super) meshes: &'a Meshes,
    hierarchy: &'a Hierarchy,
    pub(super) shot: &'a Shot,
    /// Largest number of face passages.
    pub(super) bounces: u32,
    pub(super) follow: Follow,
    pub(super) uses: Uses,
}

/// The plan's decisions that matter here, looked up once.
#[derive(Clone, Copy)]
pub(super) struct Uses {
    pub meshes: bool,
    pub quadrics: bool,
    pub alpha_mask: bool,
    pub textures: bool,
    pub coordinates: bool,
    pub lights: bool,
    pub shadows: bool,
    pub headlight: bool,
    pub fog: bool,
    pub max_distance: bool,
    pub counters: bool,
    pub shading: Shading,
    pub method: Method,
    pub heat: Option<Heat>,
}

impl<'a, G: Geometry> Tracer<'a, G> {
    /// A tracer for one picture.
    pub fn new(geometry: G, world: &'a World, shot: &'a Shot) -> Self {
        let plan = &world.plan;
        let uses = Uses {
            meshes: plan.uses(Feature::Meshes),
            quadrics: plan.uses(Feature::Quadrics),
            alpha_mask: plan.uses(Feature::AlphaMask),
            textures: plan.uses(Feature::Textures),
            coordinates: plan.uses(Feature::Coordinates),
            lights: plan.uses(Feature::Lights),
            shadows: plan.uses(Feature::Shadows),
            headlight: plan.uses(Feature::Headlight),
            fog: plan.uses(Feature::Fog),
            max_distance: plan.uses(Feature::MaxDistance),
            counters: plan.uses(Feature::Counters),
            shading: plan.shading,
            method: plan.method,
            heat: plan.heat,
        };
        Self {
            geometry,
            world,
            meshes: world.meshes(),
            hierarchy: world.hierarchy(),
            shot,
            bounces: shot.bounces(world),
            follow: Follow { tolerance: shot.tolerance(world.settings.tolerance) },
            uses,
        }
    }

    /// The pairing of a face.
    pub fn pairing(&self, face: usize) -> &Isometry {
        &self.world.domain.faces[face].pairing
    }

    pub(super) fn count(&self, counts: &mut Counts, what: u32) {
        if self.uses.counters {
            counts[what as usize] += 1;
        }
    }

    /// The next segment of a path, by the plan's method.
    pub(super) fn segment(&self, path: &mut Path, bounces: u32, crossed: impl FnMut(usize)) -> Option<Segment> {
        let (geometry, domain, follow) = (self.geometry, &self.world.domain, self.follow);
        match self.uses.method {
            Method::Exact => stage_segment(geometry, domain, path, bounces, follow, crossed),
            method => stepped::stage_segment(geometry, domain, path, bounces, follow, method, crossed),
        }
    }

    /// Moves a path on to its segment's end, by the plan's method.
    fn transport(&self, path: &mut Path, bounces: u32, crossed: impl FnMut(usize)) {
        match self.uses.method {
            Method::Exact => stage_transport(self.geometry, &self.world.domain, path, bounces, crossed),
            method => stepped::stage_transport(self.geometry, &self.world.domain, path, bounces, method, crossed),
        }
    }

    /// Traces one segment of a primary ray: closest-hit or miss follows. Returns the surface that was hit.
    pub fn trace_segment(
        &self,
        path: &mut Path,
        segment: Segment,
        counts: &mut Counts,
        crossed: impl FnMut(usize),
    ) -> Option<Surface> {
        match self.traverse(segment, path.cell, false, counts) {
            Some(reference) => {
                let surface = self.stage_closest_hit(path, segment, reference);
                (path.status == Status::Hit).then_some(surface)
            }
            None => {
                self.transport(path, self.bounces, crossed);
                None
            }
        }
    }

    /// Traces one segment of a shadow ray: a hit ends it, a miss transports it.
    pub(super) fn trace_shadow_segment(&self, path: &mut Path, segment: Segment, counts: &mut Counts) {
        if self.traverse(segment, path.cell, true, counts).is_some() {
            path.status = Status::Hit;
        } else {
            self.transport(path, SHADOW_BOUNCES, |_| ());
        }
    }

    /// Where the segment meets a leaf, and what; holes only matter before `s_end`.
    fn meet(&self, segment: Segment, leaf: Primitive, s_end: f64, counts: &mut Counts) -> (f64, Primitive) {
        match leaf {
            Primitive::Quadric(index) => {
                self.count(counts, COUNT_QUADRICS);
                (quadric_hit(segment, &self.world.quadrics[index as usize]), leaf)
            }
            Primitive::Triangle(index) => {
                let first = (self.meet_triangle(segment, index, s_end, counts), leaf);
                if self.hierarchy.pairs[index as usize / 2].is_single() {
                    return first;
                }
                let second = (self.meet_triangle(segment, index + 1, s_end, counts), Primitive::Triangle(index + 1));
                if second.0 < first.0 { second } else { first }
            }
        }
    }

    fn meet_triangle(&self, segment: Segment, name: u32, s_end: f64, counts: &mut Counts) -> f64 {
        self.count(counts, COUNT_TRIANGLES);
        let index = self.triangle(name);
        let (s, weights) = triangle_hit::<G>(segment, self.meshes.triangles[index]);
        let hole = self.uses.alpha_mask && s < s_end && is_hole(self.world, &self.meshes.shading[index], weights);
        if hole { NO_HIT } else { s }
    }

    /// Index of the triangle that [`Primitive::Triangle`] names.
    pub(super) fn triangle(&self, name: u32) -> usize {
        self.hierarchy.pairs[name as usize / 2].triangles[name as usize % 2] as usize
    }

    /// Walks the hierarchy of a cell front to back and returns the primitive hit; with `any_hit` the first one found will do.
    fn traverse(&self, segment: Segment, cell: usize, any_hit: bool, counts: &mut Counts) -> Option<Primitive> {
        let mut hit = None;
        if !(self.uses.meshes || self.uses.quadrics) || !G::STRAIGHT && !self.hierarchy.voxels.near(cell, &segment) {
            return hit;
        }
        let Tree { root, grid, .. } = self.hierarchy.trees[cell]?;
        let slabs = Slabs::new::<G>(segment, grid);
        let mut s_end = 1.0 + 1e-12;
        let mut stack = [0_u32; STACK_SIZE as usize];
        let mut depth = 0;
        let mut next = root;
        while let Reference::Node(index, axis) = Reference::read(next) {
            let node = &self.hierarchy.nodes[index as usize];
            self.count(counts, COUNT_NODES);
            let entered = slabs.entered(node, s_end);
            let from_last = slabs.negative[axis as usize];
            next = Reference::Nothing.word();
            // Nodes from the far to the near ones, so that the nearest is on top; then primitives from near to far.
            for i in 0..4 {
                let i = if from_last { i } else { 3 - i };
                if entered[i] && matches!(Reference::read(node.children[i]), Reference::Node(..)) {
                    if next != Reference::Nothing.word() {
                        stack[depth] = next;
                        depth += 1;
                    }
                    next = node.children[i];
                }
            }
            for i in 0..4 {
                let i = if from_last { 3 - i } else { i };
                if !entered[i] {
                    continue;
                }
                let Reference::Primitive(leaf) = Reference::read(node.children[i]) else { continue };
                let (s, primitive) = self.meet(segment, leaf, s_end, counts);
                if s < s_end {
                    s_end = s;
                    hit = Some(primitive);
                    if any_hit {
                        return hit;
                    }
                }
            }
            if next == Reference::Nothing.word() && depth > 0 {
                depth -= 1;
                next = stack[depth];
            }
        }
        hit
    }
}

/// A segment in units of a grid, to be compared with the boxes of nodes, in f32.
struct Slabs {
    /// Origins for lower and for upper faces: an arc lies between its chord and the chord shifted by a quarter of the bend,
    /// so a box that is as much larger to the other side is entered by the chord no later than the box is by the arc.
    origins: [Vec3; 2],
    reciprocal: Vec3,
    /// Whether the segment goes down along an axis.
    negative: [bool; 3],
}

impl Slabs {
    fn new<G: Geometry>(segment: Segment, grid: Grid) -> Self {
        let origin = (segment.origin - grid.lower) * grid.scale;
        let bulge = if G::STRAIGHT { DVec3::ZERO } else { segment.bend * grid.scale * 0.25 };
        let origins = [origin + bulge.max(DVec3::ZERO), origin + bulge.min(DVec3::ZERO)].map(|o| o.as_vec3());
        let direction = (segment.direction * grid.scale).to_array();
        // A zero component would make 0 · ∞ = NaN at a box face; a tiny one behaves as a parallel ray.
        let reciprocal = direction.map(|d| if d.abs() < 1e-20 { 1e20 } else { (1.0 / d) as f32 });
        Self { origins, reciprocal: reciprocal.into(), negative: direction.map(|d| d < 0.0) }
    }

    /// Which boxes of a node the segment enters before `s_end`.
    fn entered(&self, node: &Node, s_end: f64) -> [bool; 4] {
        let [for_lower, for_upper] = self.origins;
        let mut enter = Vec4::ZERO;
        let mut leave = Vec4::splat(s_end as f32);
        for (axis, lines) in [node.x, node.y, node.z].into_iter().enumerate() {
            let low = Vec4::from(lines.map(|line| (line & 0xffff) as i32 as f32));
            let high = Vec4::from(lines.map(|line| (line >> 16) as i32 as f32));
            let a = (low - for_lower[axis]) * self.reciprocal[axis];
            let b = (high - for_upper[axis]) * self.reciprocal[axis];
            enter = enter.max(a.min(b));
            leave = leave.min(a.max(b));
        }
        enter.cmple(leave * SLAB_SLACK).into()
    }
}

/// Share by which boxes are left later than computed: the rounding of both ends (Ize: Robust BVH ray traversal, 2013).
const SLAB_SLACK: f32 = 1.0 + 4.0 * f32::EPSILON;
