//! What raygen asks before it has a segment traced: boxes about what is in a cell or, where geodesics are curved, its voxels.
//!
//! Where traversal is software, each step of it costs as much as looking at a dozen boxes that are the same for all rays, and
//! long thin objects, such as the edges of a cell, make hierarchies through which each ray takes many steps. So there
//! raygen looks at some boxes about what is in the cell first: instances of a kind that the segment does not come near are
//! masked out, a segment that comes near one box alone is traced among what is in that (`alone.rs`), and one that comes
//! near nothing is not traced. Arcs are short, and one bit says the same of them
//! (`src/render/world/voxels.rs`). Hardware has no guards.

use super::scene::box_about;
use crate::{
    render::{
        bvh::{Aabb, covers},
        world::{World, hierarchy::Hierarchy},
    },
    shader_io::{Box, GUARDS, Guard, KIND_ALL, KIND_MESHES, KIND_MOVING, KIND_QUADRICS, Specialization, types::uvec2},
    space::domain::Domain,
};
use glam::DVec3;
use std::f64::consts::TAU;

/// Most guards about one kind.
const MOST: usize = GUARDS as usize / 2;

/// What asking one guard costs, in units of tracing a segment (an estimate from core times of lavapipe, Mesa 26.1).
const ASKING: f64 = 0.01;

/// Guards are there if they bring the cost of a kind down to this.
const WORTH_IT: f64 = 0.6;

/// Up to so many resting triangles, where traversal is software, are one structure of a cell whatever they are images of: that is
/// 1 MB at most, and no instance is entered whose box is loose because it is turned with what is in it. And what guards hold of
/// them has structures as well.
pub const FEW: usize = 8192;

/// The guards of a world.
#[derive(Clone, Debug, Default)]
pub struct Guards {
    /// Kinds of instances that are not there or have guards.
    kinds: u32,
    meshes: Vec<Box>,
    quadrics: Vec<Box>,
    /// Voxels, if there are any.
    pub hierarchy: Hierarchy,
}

impl Guards {
    /// Guards for a device that traverses in software or not: voxels, if geodesics are curved and nothing moves, else boxes around
    /// what rests. Of these there are none in worlds of several cells, and about what most segments come near anyway.
    pub fn new(software: bool, world: &World) -> Self {
        let mut guards = Self::default();
        if !software {
            return guards;
        }
        if !world.geometry.is_straight() && world.rests() {
            guards.hierarchy = Hierarchy::voxels(&world.domain, world.meshes(), &world.quadrics);
            return guards;
        }
        if world.domain.cells.len() != 1 {
            return guards;
        }
        if world.rests() {
            guards.kinds |= KIND_MOVING;
        }
        let quadrics = if world.quadrics_move() { &[][..] } else { &world.quadrics };
        let quadrics: Vec<Aabb> = quadrics.iter().map(|quadric| quadric.bounds).collect();
        // Where quadrics have none, all segments are traced, and guards about meshes would spare next to nothing.
        if let Some(boxes) = best(&world.domain, &quadrics) {
            guards.kinds |= KIND_QUADRICS;
            guards.quadrics = boxes;
            if let Some(boxes) = best(&world.domain, &runs(world)) {
                guards.kinds |= KIND_MESHES;
                guards.meshes = boxes;
            }
        }
        guards
    }

    /// Constants of pipelines that ask them.
    pub fn specialize(&self, constants: Specialization) -> Specialization {
        let [mesh_guards, quadric_guards] = [&self.meshes, &self.quadrics].map(|boxes| boxes.len() as u32);
        Specialization { guarded: self.kinds, mesh_guards, quadric_guards, ..constants }
    }

    /// All boxes, those about meshes first.
    pub fn boxes(&self) -> [Box; GUARDS as usize] {
        let mut all = self.meshes.iter().chain(&self.quadrics).copied();
        std::array::from_fn(|_| all.next().unwrap_or_default())
    }

    /// What shaders ask: the boxes, with the structures of what is in each alone, if there are any.
    pub fn asked(&self, scenes: &[uvec2]) -> [Guard; GUARDS as usize] {
        let boxes = self.boxes();
        std::array::from_fn(|at| {
            let Box { lower, upper } = boxes[at];
            Guard { lower, upper, scene: scenes.get(at).copied().unwrap_or_default() }
        })
    }

    /// What each guard holds, in the order of [`boxes`](Self::boxes); nothing where a segment that comes near one guard alone
    /// may meet something that is in none, or where there is no other.
    pub fn held(&self, world: &World) -> Vec<Held> {
        if self.kinds != KIND_ALL || self.meshes.len() + self.quadrics.len() < 2 {
            return Vec::new();
        }
        let triangles = if world.still.triangles.len() > FEW { &[][..] } else { &world.still.triangles };
        let triangles: Vec<Aabb> = triangles.iter().map(|triangle| Aabb::around(triangle.iter().copied())).collect();
        let quadrics: Vec<Aabb> = world.quadrics.iter().map(|quadric| quadric.bounds).collect();
        let meshes = self.meshes.iter().map(|guard| Held::new(KIND_MESHES, guard, &triangles));
        meshes.chain(self.quadrics.iter().map(|guard| Held::new(KIND_QUADRICS, guard, &quadrics))).collect()
    }
}

/// What is in a guard.
#[derive(Clone, Debug)]
pub struct Held {
    /// Of which kind it is.
    pub kind: u32,
    /// Indices of resting triangles or of quadrics, in order.
    pub indices: Vec<u32>,
}

impl Held {
    fn new(kind: u32, guard: &Box, bounds: &[Aabb]) -> Self {
        let [lower, upper] = [guard.lower, guard.upper].map(|corner| DVec3::from(corner.map(f64::from)));
        let inside = |bounds: &Aabb| lower.cmple(bounds.lower).all() && bounds.upper.cmple(upper).all();
        let held = bounds.iter().zip(0..).filter(|(bounds, _)| inside(bounds));
        Self { kind, indices: held.map(|(_, index)| index).collect() }
    }
}

/// The guards about all of `about` that make a segment cheapest, if they are worth it: none about nothing.
fn best(domain: &Domain, about: &[Aabb]) -> Option<Vec<Box>> {
    if about.is_empty() {
        return Some(Vec::new());
    }
    let cost = |boxes: &[Aabb]| share_near(domain, boxes) + ASKING * boxes.len() as f64;
    let costs = covers(about, MOST).into_iter().map(|boxes| (cost(&boxes), boxes));
    let (_, best) = costs.filter(|(cost, _)| *cost <= WORTH_IT).min_by(|a, b| a.0.total_cmp(&b.0))?;
    // With some slack, so that rounding masks out nothing that a segment meets.
    Some(best.iter().map(|about| box_about(about.lower, about.upper, 0.0)).collect())
}

/// Boxes of the resting triangles, by runs of neighbours: few enough to be split quickly.
fn runs(world: &World) -> Vec<Aabb> {
    const RUNS: usize = 4096;
    let triangles: Vec<usize> = world.still.inside(&world.domain, 0).into_iter().map(|index| index as usize).collect();
    let run = triangles.len().div_ceil(RUNS).max(1);
    let around = |run: &[usize]| Aabb::around(run.iter().flat_map(|&index| world.still.triangles[index]));
    triangles.chunks(run).map(around).collect()
}

/// Share of segments of a bounded cell that come near one of the boxes: of chords from places that are spread over its faces,
/// in directions that are spread evenly. 1 if the cell has no end.
fn share_near(domain: &Domain, boxes: &[Aabb]) -> f64 {
    const CHORDS: usize = 512;
    let all = boxes.iter().copied().fold(Aabb::EMPTY, Aabb::union);
    let (mut chords, mut near) = (0_u32, 0_u32);
    for i in 0..CHORDS {
        // Points of the unit cube of seven dimensions that fill it evenly: multiples of powers of the inverse of the root of
        // x^8 = x + 1 (Roberts: The unreasonable effectiveness of quasirandom sequences, 2018).
        let mut power = 1.0;
        let [x, y, z, first, first_turn, second, second_turn] = std::array::from_fn(|_| {
            power /= 1.096_981_557_798_559_8;
            (0.5 + power * i as f64).fract()
        });
        let point = all.lower + DVec3::new(x, y, z) * (all.upper - all.lower);
        let Some([_, exit]) = clip(domain, point, towards(first, first_turn)) else { continue };
        let (start, direction) = (point + towards(first, first_turn) * exit, towards(second, second_turn));
        let Some(ends) = clip(domain, start, direction) else { continue };
        chords += 1;
        near += u32::from(boxes.iter().any(|about| passes(about, start, direction, ends)));
    }
    if chords == 0 { f64::from(u8::from(!boxes.is_empty())) } else { f64::from(near) / f64::from(chords) }
}

/// A unit vector, evenly spread where both numbers are between 0 and 1.
fn towards(height: f64, turn: f64) -> DVec3 {
    let (height, (sin, cos)) = (2.0 * height - 1.0, (turn * TAU).sin_cos());
    let across = (1.0 - height * height).sqrt();
    DVec3::new(across * cos, across * sin, height)
}

/// Where a line of the chart enters the cell and leaves it, in units of `direction`; none if it does not meet it, or not leave it.
fn clip(domain: &Domain, point: DVec3, direction: DVec3) -> Option<[f64; 2]> {
    let mut ends = [f64::NEG_INFINITY, f64::INFINITY];
    for face in &domain.faces {
        let (height, rate) = (face.plane.dot(point.extend(1.0)), face.plane.dot(direction.extend(0.0)));
        if rate > 0.0 {
            ends[1] = ends[1].min(-height / rate);
        } else if rate < 0.0 {
            ends[0] = ends[0].max(-height / rate);
        }
    }
    (ends[0] < ends[1] && ends.iter().all(|end| end.is_finite())).then_some(ends)
}

/// Whether a piece of a line meets a box.
fn passes(about: &Aabb, point: DVec3, direction: DVec3, ends: [f64; 2]) -> bool {
    let (a, b) = ((about.lower - point) / direction, (about.upper - point) / direction);
    let enter = a.min(b).max_element().max(ends[0]);
    let leave = a.max(b).min_element().min(ends[1]);
    enter <= leave
}
