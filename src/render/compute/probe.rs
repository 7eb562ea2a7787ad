//! Functions of a geometry as the device computes them, one by one: for the tests that compare them with their
//! Rust twins, and for `holonomy geodesic --backend compute`.

use crate::{
    geometry::{GeometryId, Isometry},
    render::device::pack::pairing,
    shader_io::{PROBE_GROUP, ProbeIn, ProbeOut, binding},
    vulkan::{
        Context, VulkanError,
        command::Submitter,
        descriptor::{Bound, BufferSet},
        memory::{Buffer, Direction, HostBuffer},
        record::Access,
        shader::{ComputePipeline, ComputeShader},
    },
};
use std::sync::Arc;

/// Evaluations of one dispatch: a few megabytes.
const CHUNK: usize = 1 << 16;

/// Evaluates `shaders/entry/probe.comp`.
#[derive(Debug)]
pub struct Probe {
    context: Arc<Context>,
    submitter: Submitter,
    pipeline: ComputePipeline,
    faces: Arc<Buffer>,
    batch: Option<Batch>,
}

/// Buffers of one batch size.
#[derive(Debug)]
struct Batch {
    count: usize,
    arguments: Arc<Buffer>,
    results: Arc<Buffer>,
    readback: HostBuffer,
    set: BufferSet,
}

impl Probe {
    /// A probe of one geometry, with the identity for the isometry.
    ///
    /// # Errors
    /// Driver failures.
    pub fn new(context: &Arc<Context>, geometry: GeometryId) -> Result<Self, VulkanError> {
        let mut submitter = Submitter::new(context, "the probe")?;
        let pipeline = ComputePipeline::new(
            context,
            &ComputeShader { entry: "probe.comp", geometry, constants: &[], push_bytes: 0 },
        )?;
        let face = pairing(&Isometry::IDENTITY);
        let faces = Arc::new(Buffer::from_slice(context, &mut submitter, "probe faces", &[face])?);
        Ok(Self { context: context.clone(), submitter, pipeline, faces, batch: None })
    }

    /// The isometry that [`PROBE_APPLY`](crate::shader_io::PROBE_APPLY) applies from now on.
    ///
    /// # Errors
    /// Driver failures.
    pub fn with_isometry(mut self, isometry: &Isometry) -> Result<Self, VulkanError> {
        self.faces.upload(&mut self.submitter, bytemuck::bytes_of(&pairing(isometry)))?;
        Ok(self)
    }

    /// One result for each argument.
    ///
    /// # Errors
    /// Driver failures.
    pub fn run(&mut self, arguments: &[ProbeIn]) -> Result<Vec<ProbeOut>, VulkanError> {
        let mut results = Vec::with_capacity(arguments.len());
        for chunk in arguments.chunks(self.chunk()) {
            let mut batch = match self.batch.take() {
                Some(batch) if batch.count == chunk.len() => batch,
                // The old one goes before the new one comes.
                old => {
                    drop(old);
                    self.allocate(chunk.len())?
                }
            };
            batch.arguments.upload(&mut self.submitter, bytemuck::cast_slice(chunk))?;
            let groups = [(chunk.len() as u32).div_ceil(PROBE_GROUP), 1, 1];
            let Batch { results: buffer, readback, set, .. } = &mut batch;
            let bytes = buffer.size();
            let pipeline = &self.pipeline;
            self.submitter.submit("run the probe", |r| {
                // The readback of the batch before, and the upload of this one.
                r.barrier(&[Access::Shaders, Access::Transfer], &[Access::Shaders]);
                r.dispatch::<u32>(pipeline, set, None, groups)?;
                r.readback(buffer, readback, bytes)
            })?;
            results.extend(batch.readback.read::<ProbeOut>(batch.count)?);
            self.batch = Some(batch);
        }
        Ok(results)
    }

    /// The largest batch that the device takes.
    fn chunk(&self) -> usize {
        let info = self.context.info();
        let ranges = info.max_storage_range / size_of::<ProbeIn>().max(size_of::<ProbeOut>()) as u64;
        let groups = u64::from(info.max_workgroups[0]) * u64::from(PROBE_GROUP);
        CHUNK.min(usize::try_from(ranges.min(groups)).unwrap_or(CHUNK)).max(1)
    }

    /// Buffers whose sizes are exact, because the shader takes the number of evaluations from `.length()`.
    fn allocate(&self, count: usize) -> Result<Batch, VulkanError> {
        let argument_bytes = (count * size_of::<ProbeIn>()) as u64;
        let result_bytes = (count * size_of::<ProbeOut>()) as u64;
        let arguments = Arc::new(Buffer::new(&self.context, "probe arguments", argument_bytes)?);
        let results = Arc::new(Buffer::new(&self.context, "probe results", result_bytes)?);
        let readback = HostBuffer::new(&self.context, "probe results", result_bytes, Direction::Readback)?;
        let bound = [
            Bound::whole(binding::faces, &self.faces),
            Bound { binding: binding::probe_in, buffer: arguments.clone(), bytes: argument_bytes },
            Bound { binding: binding::probe_out, buffer: results.clone(), bytes: result_bytes },
        ];
        let set = BufferSet::new(self.pipeline.layout(), &bound)?;
        Ok(Batch { count, arguments, results, readback, set })
    }
}
