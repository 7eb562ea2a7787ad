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
        bvh::{Tree, child_of},
        plan::{Feature, Heat},
        world::{World, WorldQuadric, hierarchy::Hierarchy, meshes::Meshes},
    },
    scene::Shading,
    shader_io::{COUNT_NODES, COUNT_QUADRICS, COUNT_TRIANGLES, QUADRIC_BIT, SHADOW_BOUNCES, STACK_SIZE},
    space::{
        stepped,
        walk::{Follow, Path, Status, stage_segment, stage_transport},
    },
};
use glam::DVec3;

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
            follow: Follow { tolerance: shot.tolerance(world.settings.tolerance), sagitta: world.sagitta },
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
        match self.traverse(segment, self.hierarchy.trees[path.cell], false, counts) {
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
        if self.traverse(segment, self.hierarchy.trees[path.cell], true, counts).is_some() {
            path.status = Status::Hit;
        } else {
            self.transport(path, SHADOW_BOUNCES, |_| ());
        }
    }

    /// Nearest hit at s ≤ `s_end` among the primitives of a leaf.
    fn leaf_hits(
        &self,
        segment: Segment,
        leaf: std::ops::Range<usize>,
        s_end: &mut f64,
        hit: &mut Option<u32>,
        counts: &mut Counts,
    ) {
        for &reference in &self.hierarchy.primitives[leaf] {
            let s = if reference & QUADRIC_BIT != 0 {
                self.count(counts, COUNT_QUADRICS);
                quadric_hit(segment, self.quadric(reference))
            } else {
                self.count(counts, COUNT_TRIANGLES);
                let (s, weights) = triangle_hit::<G>(segment, self.meshes.triangles[reference as usize]);
                let hole = self.uses.alpha_mask
                    && s < *s_end
                    && is_hole(self.world, &self.meshes.shading[reference as usize], weights);
                if hole { NO_HIT } else { s }
            };
            if s < *s_end {
                *s_end = s;
                *hit = Some(reference);
            }
        }
    }

    pub(super) fn quadric(&self, reference: u32) -> &WorldQuadric {
        &self.world.quadrics[(reference & !QUADRIC_BIT) as usize]
    }

    /// Walks the hierarchy front to back and returns the primitive hit; with `any_hit` the first one found will do.
    fn traverse(&self, segment: Segment, tree: Option<Tree>, any_hit: bool, counts: &mut Counts) -> Option<u32> {
        let mut hit = None;
        if !(self.uses.meshes || self.uses.quadrics) {
            return hit;
        }
        let Tree { root, grid } = tree?;
        let mut current = root;
        // The segment in units of the grid. A zero component would make 0 · ∞ = NaN at a box face; a tiny one behaves
        // as a parallel ray.
        let origins = box_origins::<G>(segment, grid.lower, grid.scale);
        let direction = segment.direction * grid.scale;
        let reciprocal = direction.to_array().map(|d| if d.abs() < 1e-20 { 1e20 } else { 1.0 / d }).into();
        let mut s_end = 1.0 + 1e-12;
        let mut stack = [0_u32; STACK_SIZE as usize];
        let mut depth = 0;
        loop {
            let node = &self.hierarchy.nodes[current as usize];
            self.count(counts, COUNT_NODES);
            let mut s0 = box_entry(node.box0, origins, reciprocal, s_end);
            let mut s1 = box_entry(node.box1, origins, reciprocal, s_end);
            let (child0, count0) = child_of(node.child0);
            let (child1, count1) = child_of(node.child1);
            if s0 != NO_HIT && count0 > 0 {
                self.leaf_hits(segment, child0 as usize..(child0 + count0) as usize, &mut s_end, &mut hit, counts);
                s0 = NO_HIT;
            }
            if s1 <= s_end && count1 > 0 {
                self.leaf_hits(segment, child1 as usize..(child1 + count1) as usize, &mut s_end, &mut hit, counts);
                s1 = NO_HIT;
            }
            if any_hit && hit.is_some() {
                return hit;
            }
            match (s0 <= s_end, s1 <= s_end) {
                (true, true) => {
                    let (near, far) = if s1 < s0 { (child1, child0) } else { (child0, child1) };
                    stack[depth] = far;
                    depth += 1;
                    current = near;
                }
                (true, false) => current = child0,
                (false, true) => current = child1,
                (false, false) if depth > 0 => {
                    depth -= 1;
                    current = stack[depth];
                }
                (false, false) => return hit,
            }
        }
    }
}

/// The segment's origin in units of the grid, for the lower and for the upper faces of boxes. An arc lies between its
/// chord and the chord shifted by a quarter of the bend, so a box that is as much larger to the other side is entered by
/// the chord no later than the box is by the arc.
fn box_origins<G: Geometry>(segment: Segment, lower: DVec3, scale: DVec3) -> [DVec3; 2] {
    let origin = (segment.origin - lower) * scale;
    if G::STRAIGHT {
        return [origin; 2];
    }
    let bulge = segment.bend * scale * 0.25;
    [origin + bulge.max(DVec3::ZERO), origin + bulge.min(DVec3::ZERO)]
}

/// Entry of a segment into a box, in s, or [`NO_HIT`] if it does not enter before `s_end`. All in units of the grid.
fn box_entry(lines: [u32; 3], [for_lower, for_upper]: [DVec3; 2], reciprocal: DVec3, s_end: f64) -> f64 {
    let low = lines.map(|line| f64::from(line & 0xffff));
    let high = lines.map(|line| f64::from(line >> 16));
    let a = (DVec3::from(low) - for_lower) * reciprocal;
    let b = (DVec3::from(high) - for_upper) * reciprocal;
    let enter = a.min(b).max_element().max(0.0);
    let leave = a.max(b).min_element().min(s_end);
    if enter <= leave { enter } else { NO_HIT }
}
