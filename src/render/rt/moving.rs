//! Meshes that move: each has room for some copies. A compute shader places the triangles of a copy from the mesh at
//! rest and an isometry, and the copy's structure is refitted. Nothing but isometries travels to the device.

use super::{
    super::{
        RenderError, StructureStats,
        device::{Device, pack},
        world::{
            World,
            meshes::{Part, RestMesh},
        },
    },
    scene::{HitRecord, Triangles, geometries},
};
use crate::{
    shader_io::{self as io, KIND_MOVING, PLACE_GROUP, Placement, RestVertex, binding},
    vulkan::{
        VulkanError,
        descriptor::{Bound, BufferSet},
        memory::Buffer,
        record::Access,
        shader::{ComputePipeline, ComputeShader},
        tracing::{
            bottom::{Blueprint, BottomLevel},
            table::Record,
            top::{IDENTITY, Instance},
        },
    },
};
use bytemuck::cast_slice;
use std::sync::Arc;

/// Copies of a mesh that there is room for at least: as many cells meet at a corner of a cube.
const LEAST_SLOTS: usize = 8;

/// How much room moving meshes get in the buffers of triangles.
#[derive(Clone, Debug, Default)]
pub struct Slots {
    /// First triangle of the first slot and number of slots of each mover.
    meshes: Vec<(usize, usize)>,
    triangles: usize,
}

impl Slots {
    /// Triangles in all slots.
    pub fn triangles(&self) -> usize {
        self.triangles
    }
}

/// Moving meshes on the device; nothing if no mesh moves.
#[derive(Debug, Default)]
pub struct MovingMeshes {
    meshes: Vec<MovingMesh>,
    placer: Option<Placer>,
}

#[derive(Debug)]
struct MovingMesh {
    rest: Arc<RestMesh>,
    first_vertex: u32,
    first_corner: u32,
    slots: Vec<Slot>,
    /// Cells of the copies, which take the first slots.
    cells: Vec<usize>,
}

/// Room for a copy. Its structure is built when it is used first.
#[derive(Debug)]
struct Slot {
    first_triangle: u32,
    blueprint: Blueprint,
    record: u32,
    structure: Option<BottomLevel>,
}

/// The shader that places triangles, with the meshes at rest.
#[derive(Debug)]
struct Placer {
    pipeline: ComputePipeline,
    set: BufferSet,
    vertices: Arc<Buffer>,
    corners: Arc<Buffer>,
}

impl MovingMeshes {
    /// Room for the movers of a world.
    pub fn slots(world: &World) -> Slots {
        let mut slots = Slots::default();
        for mover in &world.movers {
            let count = (2 * mover.copies.len()).max(LEAST_SLOTS);
            slots.meshes.push((world.still.triangles.len() + slots.triangles, count));
            slots.triangles += count * mover.rest.triangles.len();
        }
        slots
    }

    /// Brings the meshes at rest to the device.
    pub fn new(
        device: &mut Device,
        world: &World,
        slots: Slots,
        triangles: &Triangles,
        records: &mut Vec<Record<HitRecord>>,
    ) -> Result<Self, RenderError> {
        let (mut vertices, mut corners) = (Vec::new(), Vec::new());
        let mut meshes = Vec::with_capacity(world.movers.len());
        for (mover, (first, count)) in world.movers.iter().zip(slots.meshes) {
            let rest = mover.rest.clone();
            let shading = shading(&rest);
            let slots = (0..count).map(|slot| {
                let first_triangle = first + slot * rest.triangles.len();
                let shift = |part: Part| Part {
                    material: part.material,
                    triangles: part.triangles.start + first_triangle..part.triangles.end + first_triangle,
                };
                let parts: Vec<Part> = rest.parts().into_iter().map(shift).collect();
                let (parts, own) = geometries(world, &parts);
                let record = records.len() as u32;
                records.extend(own);
                let offset = (first_triangle * size_of::<io::TriangleShading>()) as u64;
                triangles.shading.upload_at(&mut device.submitter, offset, cast_slice(&shading))?;
                let (shapes, buffer) = triangles.shapes();
                let blueprint = Blueprint {
                    name: format!("copy {slot} of moving object {}", rest.object),
                    shapes,
                    buffer,
                    parts,
                    moves: true,
                };
                Ok(Slot { first_triangle: first_triangle as u32, blueprint, record, structure: None })
            });
            let slots = slots.collect::<Result<Vec<_>, VulkanError>>()?;
            let (first_vertex, first_corner) = (vertices.len() as u32, corners.len() as u32);
            vertices.extend(rest_vertices(&rest));
            corners.extend(rest.triangles.iter().flat_map(|t| t.corners));
            meshes.push(MovingMesh { rest, first_vertex, first_corner, slots, cells: Vec::new() });
        }
        let placer =
            if meshes.is_empty() { None } else { Some(Placer::new(device, world, &vertices, &corners, triangles)?) };
        Ok(Self { meshes, placer })
    }

    /// Copies that there is room for.
    pub fn capacity(&self) -> usize {
        self.meshes.iter().map(|mesh| mesh.slots.len()).sum()
    }

    /// Places the copies of a pose; `false` if there is no room for them.
    pub fn pose(
        &mut self,
        device: &mut Device,
        world: &World,
        stats: &mut StructureStats,
    ) -> Result<bool, RenderError> {
        let Some(placer) = &self.placer else { return Ok(world.movers.is_empty()) };
        let fits = self.meshes.len() == world.movers.len()
            && self.meshes.iter().zip(&world.movers).all(|(mesh, mover)| {
                mover.copies.len() <= mesh.slots.len()
                    && mover.rest.object == mesh.rest.object
                    && mover.rest.triangles.len() == mesh.rest.triangles.len()
            });
        if !fits {
            return Ok(false);
        }
        let mut placements = Vec::new();
        for (mesh, mover) in self.meshes.iter_mut().zip(&world.movers) {
            if !Arc::ptr_eq(&mesh.rest, &mover.rest) {
                // No isometry carried it, so it rests in another place now.
                mesh.rest = mover.rest.clone();
                let offset = u64::from(mesh.first_vertex) * size_of::<RestVertex>() as u64;
                let vertices = rest_vertices(&mesh.rest);
                placer.vertices.upload_at(&mut device.submitter, offset, cast_slice(&vertices))?;
            }
            mesh.cells = mover.copies.iter().map(|copy| copy.cell).collect();
            placements.extend(mover.copies.iter().zip(&mesh.slots).map(|(copy, slot)| Placement {
                linear: copy.isometry.linear.as_mat4().to_cols_array_2d(),
                shift: pack::vec4(copy.isometry.shift),
                first_vertex: mesh.first_vertex,
                first_corner: mesh.first_corner,
                first_triangle: slot.first_triangle,
                count: mesh.rest.triangles.len() as u32,
                margin: world.margin() as f32,
            }));
        }
        let (pipeline, set) = (&placer.pipeline, &placer.set);
        device.submitter.submit("place moving meshes", |r| {
            r.barrier(&[Access::Shaders, Access::Transfer, Access::Build], &[Access::Shaders]);
            for placement in &placements {
                r.dispatch(pipeline, set, Some(placement), [placement.count.div_ceil(PLACE_GROUP), 1, 1])?;
            }
            r.barrier(&[Access::Shaders], &[Access::Build, Access::Shaders]);
            Ok(())
        })?;
        self.build(device, stats)?;
        Ok(true)
    }

    /// Refits the structures of the copies, and builds those of copies that are the first in their slots.
    fn build(&mut self, device: &mut Device, stats: &mut StructureStats) -> Result<(), VulkanError> {
        let used = |mesh: &MovingMesh| mesh.cells.len();
        let refitted: Vec<&BottomLevel> = self
            .meshes
            .iter()
            .flat_map(|mesh| mesh.slots[..used(mesh)].iter().filter_map(|s| s.structure.as_ref()))
            .collect();
        stats.refits += refitted.len() as u64;
        if !refitted.is_empty() {
            device.submitter.submit("refit moving meshes", |r| r.refit(refitted.iter().copied()))?;
        }
        let mut fresh: Vec<&mut Slot> = self
            .meshes
            .iter_mut()
            .flat_map(|mesh| mesh.slots[..mesh.cells.len()].iter_mut().filter(|slot| slot.structure.is_none()))
            .collect();
        let blueprints = fresh.iter().map(|slot| slot.blueprint.clone()).collect();
        let (built, _) = BottomLevel::build(&device.context, &mut device.submitter, blueprints)?;
        stats.builds += built.len() as u64;
        for (slot, structure) in fresh.iter_mut().zip(built) {
            slot.structure = Some(structure);
        }
        Ok(())
    }

    /// Copies in a cell.
    pub fn instances(&self, cell: usize) -> impl Iterator<Item = Instance<'_>> {
        self.meshes.iter().flat_map(move |mesh| {
            let copies = mesh.cells.iter().zip(&mesh.slots).filter(move |(c, _)| **c == cell);
            copies.filter_map(|(_, slot)| {
                let structure = slot.structure.as_ref()?;
                Some(Instance { structure, transform: IDENTITY, record: slot.record, kind: KIND_MOVING })
            })
        })
    }

    /// Structures that exist.
    pub fn structures(&self) -> impl Iterator<Item = &BottomLevel> + Clone {
        self.meshes.iter().flat_map(|mesh| mesh.slots.iter().filter_map(|slot| slot.structure.as_ref()))
    }

    /// Bytes of structures and of the meshes at rest.
    pub fn memory(&self) -> u64 {
        let rest = self.placer.as_ref().map_or(0, |placer| placer.vertices.size() + placer.corners.size());
        rest + self.structures().map(BottomLevel::bytes).sum::<u64>()
    }
}

impl Placer {
    fn new(
        device: &mut Device,
        world: &World,
        vertices: &[RestVertex],
        corners: &[u32],
        triangles: &Triangles,
    ) -> Result<Self, RenderError> {
        let mut bound = device.upload(&[
            (binding::rest, "vertices at rest", cast_slice(vertices)),
            (binding::rest_corners, "corners at rest", cast_slice(corners)),
        ])?;
        let [vertices, corners] = [0, 1].map(|i| bound[i].buffer.clone());
        bound.push(Bound::whole(binding::placed, &triangles.corners));
        bound.push(Bound::whole(binding::placed_shading, &triangles.shading));
        // The shader text names the boxes everywhere.
        bound.push(Bound::whole(binding::placed_boxes, triangles.boxes.as_ref().unwrap_or(&triangles.shading)));
        let pipeline = ComputePipeline::new(
            &device.context,
            &ComputeShader {
                entry: "place.comp",
                geometry: world.geometry,
                constants: &[],
                push_bytes: size_of::<Placement>() as u32,
            },
        )?;
        let set = BufferSet::new(pipeline.layout(), &bound)?;
        Ok(Self { pipeline, set, vertices, corners })
    }
}

fn rest_vertices(rest: &RestMesh) -> Vec<RestVertex> {
    rest.vertices.iter().map(|v| RestVertex { point: pack::vec4(v.point), normal: pack::vec4(v.normal) }).collect()
}

/// Shading data of a copy; its conormals are written when it is placed.
fn shading(rest: &RestMesh) -> Vec<io::TriangleShading> {
    let shading = |t: &crate::render::world::meshes::RestTriangle| io::TriangleShading {
        uv_a: t.uv[0],
        uv_b: t.uv[1],
        uv_c: t.uv[2],
        material: t.material,
        object: rest.object,
        ..io::TriangleShading::default()
    };
    rest.triangles.iter().map(shading).collect()
}
