//! Acceleration structures of what single guards hold.
//!
//! A segment that comes near one guard only meets nothing but what is in that one: so it is traced in a structure of that
//! alone, and spared the way down to it through what is elsewhere.

use super::{
    guards::{Guards, Held},
    scene::{HitRecord, Quadrics, Triangles, geometries},
};
use crate::{
    render::{
        StructureStats,
        device::Device,
        world::{World, meshes::Part},
    },
    shader_io::{KIND_MESHES, types::uvec2},
    vulkan::{
        VulkanError,
        tracing::{
            bottom::{self, Blueprint, BottomLevel},
            table::Record,
            top::{IDENTITY, Instance, TopLevel},
        },
    },
};
use std::ops::Range;

/// The structures of guards.
#[derive(Debug, Default)]
pub struct Alone {
    /// Where shaders find them, in the order of the guards; 0 for those that have none.
    pub addresses: Vec<uvec2>,
    /// What is in them.
    pub structures: Vec<BottomLevel>,
    /// Top levels, with one of these each.
    pub tops: Vec<TopLevel>,
}

impl Alone {
    /// Builds them, where the guards hold all that a segment can meet.
    ///
    /// # Errors
    /// Driver failures.
    pub fn new(
        device: &mut Device,
        world: &World,
        guards: &Guards,
        triangles: Option<&Triangles>,
        quadrics: Option<&Quadrics>,
        records: &mut Vec<Record<HitRecord>>,
        stats: &mut StructureStats,
    ) -> Result<Self, VulkanError> {
        let mut alone = Self::default();
        let mut blueprints = Vec::new();
        // Of each blueprint: its guard, its first record and its kind.
        let mut places = Vec::new();
        for (guard, Held { kind, indices }) in guards.held(world).into_iter().enumerate() {
            alone.addresses.push(uvec2::default());
            let geometries = if kind == KIND_MESHES {
                triangles.map(|triangles| (triangles.shapes(), geometries(world, &mesh_parts(world, &indices))))
            } else {
                quadrics.map(|quadrics| (quadrics.shapes(), quadric_parts(quadrics, &indices)))
            };
            if let Some(((shapes, buffer), (parts, made))) = geometries.filter(|(_, (parts, _))| !parts.is_empty()) {
                places.push((guard, records.len() as u32, kind));
                records.extend(made);
                blueprints.push(Blueprint { name: format!("guard {guard}"), shapes, buffer, parts, moves: false });
            }
        }
        let (structures, bytes) = BottomLevel::build(&device.context, &mut device.submitter, blueprints)?;
        stats.builds += 2 * structures.len() as u64;
        stats.bytes_built += bytes.built;
        stats.bytes_compacted += bytes.kept;
        let mut placed = Vec::with_capacity(structures.len());
        for (structure, (guard, record, kind)) in structures.iter().zip(places) {
            let mut top = TopLevel::new(&device.context, &format!("guard {guard}"), 1)?;
            placed.push(top.place(&[Instance { structure, transform: IDENTITY, record, kind }])?);
            alone.addresses[guard] = top.address();
            alone.tops.push(top);
        }
        alone.structures = structures;
        if !alone.tops.is_empty() {
            let tops = &alone.tops;
            device.submitter.submit("place what guards hold", |r| {
                tops.iter().zip(placed).try_for_each(|(top, placed)| r.build(top, placed))
            })?;
        }
        Ok(alone)
    }

    /// Bytes of the top levels.
    pub fn bytes_top(&self) -> u64 {
        self.tops.iter().map(TopLevel::bytes).sum()
    }

    /// Bytes of everything.
    pub fn bytes(&self) -> u64 {
        self.bytes_top() + self.structures.iter().map(BottomLevel::bytes).sum::<u64>()
    }
}

/// Runs of neighbours among indices in order.
fn runs(indices: &[u32]) -> impl Iterator<Item = Range<u32>> {
    indices.chunk_by(|a, b| a + 1 == *b).map(|run| run[0]..run[0] + run.len() as u32)
}

/// Some of the resting triangles, by material.
fn mesh_parts(world: &World, indices: &[u32]) -> Vec<Part> {
    let parts = world.still.copies.iter().flat_map(|copy| &copy.parts);
    let held = |part: &Part| {
        let [start, end] =
            [part.triangles.start, part.triangles.end].map(|end| indices.partition_point(|&i| (i as usize) < end));
        let material = part.material;
        runs(&indices[start..end]).map(move |run| Part { material, triangles: run.start as usize..run.end as usize })
    };
    parts.flat_map(held).collect()
}

/// Geometries over some quadrics of the only cell, and their hit records.
fn quadric_parts(quadrics: &Quadrics, indices: &[u32]) -> (Vec<bottom::Part>, Vec<Record<HitRecord>>) {
    let part = |run: Range<u32>| bottom::Part { first: run.start, count: run.len() as u32, opaque: true };
    runs(indices).map(|run| (part(run.clone()), quadrics.record(run.start))).unzip()
}
