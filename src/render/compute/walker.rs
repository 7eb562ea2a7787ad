//! Rays walked through the faces by the shaders' own stages, with no scene to meet: for `holonomy stability`.

use crate::{
    geometry::GeometryId,
    render::{
        device::{NULL_BYTES, pack},
        plan,
    },
    shader_io::{Cell, PROBE_GROUP, Specialization, View, Walk, binding},
    space::domain::Domain,
    vulkan::{
        Context, VulkanError,
        command::Submitter,
        descriptor::{Bound, BufferSet},
        memory::{Buffer, Direction, HostBuffer},
        record::Access,
        shader::{ComputePipeline, ComputeShader},
    },
};
use bytemuck::cast_slice;
use std::sync::Arc;

/// Faces that a ray passes in one submission: rays without end must not run into a driver's watchdog.
const PIECE: u32 = 1000;

/// Evaluates `shaders/entry/walk.comp`.
#[derive(Debug)]
pub struct Walker {
    context: Arc<Context>,
    submitter: Submitter,
    pipeline: ComputePipeline,
    /// What the shader reads of the space.
    space: Vec<Bound>,
    /// For the bindings that it only names.
    nothing: Arc<Buffer>,
}

impl Walker {
    /// A walker in a space. Arcs of curved geodesics are made for a tolerance that is this angle seen from the start.
    ///
    /// # Errors
    /// Driver failures.
    pub fn new(
        context: &Arc<Context>,
        geometry: GeometryId,
        domain: &Domain,
        tolerance: f64,
    ) -> Result<Self, VulkanError> {
        let mut submitter = Submitter::new(context, "the walker")?;
        let constants = Specialization {
            faces: plan::unrolled_faces(domain.cells.iter().map(|faces| faces.len())),
            labels: u32::from(!domain.labels.is_empty()),
            ..Specialization::default()
        };
        let pipeline = ComputePipeline::new(
            context,
            &ComputeShader { entry: "walk.comp", geometry, constants: &constants.words(), push_bytes: 0 },
        )?;
        let view = View { tolerance: tolerance as f32, ..View::default() };
        let faces: Vec<_> = domain.faces.iter().map(pack::face).collect();
        let cell = |faces: &std::ops::Range<usize>| Cell {
            first_face: faces.start as u32,
            face_count: faces.len() as u32,
            ..Cell::default()
        };
        let cells: Vec<Cell> = domain.cells.iter().map(cell).collect();
        let mut bound = |binding, name, bytes: &[u8]| -> Result<Bound, VulkanError> {
            Ok(Bound::whole(binding, &Arc::new(Buffer::from_slice(context, &mut submitter, name, bytes)?)))
        };
        let mut space = vec![
            bound(binding::view, "view of walks", bytemuck::bytes_of(&view))?,
            bound(binding::faces, "faces of walks", cast_slice(&faces))?,
            bound(binding::cells, "cells of walks", cast_slice(&cells))?,
            bound(binding::planes, "planes of walks", cast_slice(&pack::planes(&domain.faces)))?,
        ];
        if !domain.labels.is_empty() {
            space.push(bound(binding::label_table, "labels of walks", cast_slice(&domain.labels))?);
        }
        let nothing = Arc::new(Buffer::new(context, "nothing", NULL_BYTES)?);
        Ok(Self { context: context.clone(), submitter, pipeline, space, nothing })
    }

    /// Walks on until each ray has passed as many faces as it says. Returns, for each, the first `record` faces that it
    /// passes in this call.
    ///
    /// # Errors
    /// Driver failures.
    pub fn run(&mut self, walks: &mut [Walk], record: usize) -> Result<Vec<Vec<u32>>, VulkanError> {
        let mut passed = vec![Vec::new(); walks.len()];
        if walks.is_empty() {
            return Ok(passed);
        }
        let count = walks.len();
        let walk_bytes = size_of_val(walks) as u64;
        let room = record.clamp(1, PIECE as usize);
        let passage_bytes = (count * room * size_of::<u32>()) as u64;
        let buffer = Arc::new(Buffer::new(&self.context, "walks", walk_bytes)?);
        let passages = Arc::new(Buffer::new(&self.context, "passages", passage_bytes)?);
        let mut walks_back = HostBuffer::new(&self.context, "walks", walk_bytes, Direction::Readback)?;
        let mut passages_back = HostBuffer::new(&self.context, "passages", passage_bytes, Direction::Readback)?;
        let mut bound = self.space.clone();
        bound.push(Bound::whole(binding::walks, &buffer));
        bound.push(Bound::whole(binding::passages, &passages));
        for unused in [binding::counts, binding::label_table] {
            if bound.iter().all(|b| b.binding != unused) {
                bound.push(Bound { binding: unused, buffer: self.nothing.clone(), bytes: 4 });
            }
        }
        let set = BufferSet::new(self.pipeline.layout(), &bound)?;
        let groups = [(count as u32).div_ceil(PROBE_GROUP), 1, 1];
        let ends: Vec<u32> = walks.iter().map(|walk| walk.until).collect();
        loop {
            let before: Vec<u32> = walks.iter().map(|walk| walk.bounces).collect();
            for (walk, end) in walks.iter_mut().zip(&ends) {
                let next = (walk.bounces + PIECE).min(*end).max(walk.bounces);
                walk.until = if walk.lost == 0 { next } else { walk.bounces };
            }
            buffer.upload(&mut self.submitter, cast_slice(walks))?;
            let pipeline = &self.pipeline;
            self.submitter.submit("walk", |r| {
                r.barrier(&[Access::Shaders, Access::Transfer], &[Access::Shaders]);
                r.dispatch::<u32>(pipeline, &set, None, groups)?;
                r.readback(&buffer, &mut walks_back, walk_bytes)?;
                r.readback(&passages, &mut passages_back, passage_bytes)
            })?;
            let lost: Vec<u32> = walks.iter().map(|walk| walk.lost).collect();
            walks.copy_from_slice(&walks_back.read::<Walk>(count)?);
            let faces: Vec<u32> = passages_back.read(count * room)?;
            let mut moved = false;
            for (index, walk) in walks.iter_mut().enumerate() {
                // Once lost a ray stays lost, though a piece of no length ends well.
                walk.lost |= lost[index];
                let now = ((walk.bounces - before[index]) as usize).min(room);
                let wanted = now.min(record.saturating_sub(passed[index].len()));
                passed[index].extend_from_slice(&faces[index * room..index * room + wanted]);
                moved |= walk.bounces > before[index] && walk.bounces < ends[index] && walk.lost == 0;
            }
            if !moved {
                break;
            }
        }
        walks.iter_mut().zip(ends).for_each(|(walk, end)| walk.until = end);
        Ok(passed)
    }
}
