//! A world's acceleration structures, with the hit records that lead from a primitive of a structure to the buffers.

use super::{
    super::{
        RenderError, StructureStats,
        bvh::{Aabb, halve},
        device::{Device, pack},
        plan::Feature,
        world::{
            World,
            meshes::{MeshCopy, Part},
        },
    },
    Group,
    alone::Alone,
    groups,
    guards::{FEW, Guards},
    moving::MovingMeshes,
};
use crate::{
    shader_io::{
        self as io, ARRAY_GUARDS, ARRAYS, KIND_MESHES, KIND_MOVING, KIND_QUADRICS, NONE, binding,
        types::{uvec2, uvec4},
    },
    vulkan::{
        VulkanError,
        descriptor::Bound,
        memory::Buffer,
        tracing::{
            bottom::{self, Blueprint, BottomLevel, INPUT_USAGE, Shapes},
            table::Record,
            top::{IDENTITY, Instance, TopLevel},
        },
    },
};
use bytemuck::cast_slice;
use glam::{DAffine3, DVec3};
use std::{ops::Range, sync::Arc};

/// What hit shaders read from their record: twin of `HitRecord` in `shaders/trace/payload.glsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct HitRecord {
    /// First primitive of the geometry in the buffers.
    pub first: u32,
    /// Its material; `NONE` where primitives have their own.
    pub material: u32,
}

/// Quadrics that there is room for beyond those of the first pose, where some move.
const SPARE_QUADRICS: usize = 16;

/// Acceleration structures of all cells.
#[derive(Debug)]
pub struct RtScene {
    still: Still,
    quadrics: Option<Quadrics>,
    alone: Alone,
    moving: MovingMeshes,
    /// About triangles, where segments are arcs.
    boxes: Option<Arc<Buffer>>,
    tops: Vec<TopLevel>,
    stats: StructureStats,
}

/// What a world brings to the device.
#[derive(Debug)]
pub struct Built {
    /// None if there is nothing to hit.
    pub scene: Option<RtScene>,
    /// Buffers that the shaders read.
    pub bound: Vec<Bound>,
    /// Hit records, by which instances name their geometries.
    pub records: Vec<Record<HitRecord>>,
}

/// Triangles of all meshes on the device.
#[derive(Debug)]
pub struct Triangles {
    /// Corners.
    pub corners: Arc<Buffer>,
    /// Shading data.
    pub shading: Arc<Buffer>,
    /// Boxes about them, where segments are arcs.
    pub boxes: Option<Arc<Buffer>>,
}

impl Triangles {
    /// What structures are built from.
    pub fn shapes(&self) -> (Shapes, Arc<Buffer>) {
        match &self.boxes {
            Some(boxes) => (Shapes::Boxes, boxes.clone()),
            None => (Shapes::Triangles, self.corners.clone()),
        }
    }
}

/// Meshes that rest.
#[derive(Debug, Default)]
struct Still {
    structures: Vec<BottomLevel>,
    instances: Vec<StillInstance>,
}

#[derive(Clone, Debug)]
struct StillInstance {
    cell: usize,
    structure: usize,
    transform: [[f32; 4]; 3],
    record: u32,
}

/// Quadrics of all cells, in one buffer with room for some more in each cell.
#[derive(Debug)]
pub(super) struct Quadrics {
    /// Places of each cell in the buffers.
    places: Vec<Range<usize>>,
    /// First hit record of each cell.
    records: Vec<u32>,
    /// The hit group of all.
    group: usize,
    /// One structure for each cell that has quadrics.
    structures: Vec<Option<BottomLevel>>,
    boxes: Arc<Buffer>,
    surfaces: Arc<Buffer>,
    shading: Arc<Buffer>,
    /// What was uploaded last.
    current: Vec<io::Quadric>,
}

impl RtScene {
    /// Builds everything.
    ///
    /// # Errors
    /// Driver failures; worlds beyond the device's limits.
    pub fn build(device: &mut Device, world: &World, guards: &Guards) -> Result<Built, RenderError> {
        let mut records = Vec::new();
        let mut bound = Vec::new();
        bound.extend(device.upload(&[(binding::voxels, "voxels", cast_slice(&guards.hierarchy.voxels.words))])?);
        if !world.plan.uses(Feature::Meshes) && !world.plan.uses(Feature::Quadrics) {
            put_guards(device, &mut bound, guards, &[])?;
            let cells = pack::cells(world, &guards.hierarchy, &[]);
            bound.extend(device.upload(&[(binding::cells, "cells", cast_slice(&cells))])?);
            return Ok(Built { scene: None, bound, records });
        }
        let mut stats = StructureStats::default();
        let mut still = Still::default();
        let mut moving = MovingMeshes::default();
        let mut triangles = None;
        if world.plan.uses(Feature::Meshes) {
            let slots = MovingMeshes::slots(world);
            let triangles = triangles.insert(Triangles::new(device, world, slots.triangles())?);
            still = Still::new(device, world, triangles, &mut records, &mut stats)?;
            moving = MovingMeshes::new(device, world, slots, triangles, &mut records)?;
            bound.push(Bound::whole(binding::triangles, &triangles.corners));
            bound.push(Bound::whole(binding::triangle_shading, &triangles.shading));
        }
        let quadrics = if world.plan.uses(Feature::Quadrics) {
            let quadrics = Quadrics::new(device, world, &mut records, &mut stats)?;
            bound.push(Bound::whole(binding::quadric_surfaces, &quadrics.surfaces));
            bound.push(Bound::whole(binding::quadric_shading, &quadrics.shading));
            Some(quadrics)
        } else {
            None
        };
        let mut tops = Vec::with_capacity(world.domain.cells.len());
        for cell in 0..world.domain.cells.len() {
            let instances = still.instances.iter().filter(|i| i.cell == cell).count();
            let capacity = instances + moving.capacity() + usize::from(quadrics.is_some());
            tops.push(TopLevel::new(&device.context, &format!("cell {cell}"), capacity)?);
        }
        let (meshes, round) = (triangles.as_ref(), quadrics.as_ref());
        let alone = Alone::new(device, world, guards, meshes, round, &mut records, &mut stats)?;
        put_guards(device, &mut bound, guards, &alone.addresses)?;
        let addresses: Vec<uvec2> = tops.iter().map(TopLevel::address).collect();
        let cells = pack::cells(world, &guards.hierarchy, &addresses);
        bound.extend(device.upload(&[(binding::cells, "cells", cast_slice(&cells))])?);
        let boxes = triangles.and_then(|triangles| triangles.boxes);
        let mut scene = Self { still, quadrics, alone, moving, boxes, tops, stats };
        scene.moving.pose(device, world, &mut scene.stats)?;
        scene.build_tops(device)?;
        Ok(Built { scene: Some(scene), bound, records })
    }

    /// Moves what moves; `false` if there is no room for it.
    pub fn pose(&mut self, device: &mut Device, world: &World) -> Result<bool, RenderError> {
        if !self.moving.pose(device, world, &mut self.stats)? {
            return Ok(false);
        }
        if let Some(quadrics) = &mut self.quadrics
            && !quadrics.pose(device, world, &mut self.stats)?
        {
            return Ok(false);
        }
        self.build_tops(device)?;
        Ok(true)
    }

    /// Builds or refits the top-level structures.
    fn build_tops(&mut self, device: &mut Device) -> Result<(), VulkanError> {
        let mut placed = Vec::with_capacity(self.tops.len());
        self.stats.instances = 0;
        for (cell, top) in self.tops.iter_mut().enumerate() {
            let mut instances: Vec<Instance<'_>> = Vec::with_capacity(top.capacity());
            instances.extend(self.still.instances.iter().filter(|i| i.cell == cell).map(|i| Instance {
                structure: &self.still.structures[i.structure],
                transform: i.transform,
                record: i.record,
                kind: KIND_MESHES,
            }));
            instances.extend(self.moving.instances(cell));
            instances.extend(self.quadrics.as_ref().and_then(|quadrics| quadrics.instance(cell)));
            self.stats.instances += instances.len() as u64;
            placed.push(top.place(&instances)?);
        }
        for placed in &placed {
            *(if placed.refit { &mut self.stats.refits } else { &mut self.stats.builds }) += 1;
        }
        let tops = &self.tops;
        device.submitter.submit("place instances", |r| {
            tops.iter().zip(placed).try_for_each(|(top, placed)| r.build(top, placed))
        })?;
        Ok(())
    }

    /// Bytes of all structures, and of buffers that are not bound.
    pub fn memory(&self) -> u64 {
        let still = self.still.structures.iter().map(BottomLevel::bytes).sum::<u64>();
        let quadrics = self.quadrics.as_ref().map_or(0, |quadrics| {
            quadrics.boxes.size() + quadrics.structures.iter().flatten().map(BottomLevel::bytes).sum::<u64>()
        });
        let boxes = self.boxes.as_ref().map_or(0, |boxes| boxes.size());
        let tops = self.tops.iter().map(TopLevel::bytes).sum::<u64>();
        still + quadrics + boxes + self.alone.bytes() + self.moving.memory() + tops
    }

    /// Numbers for `--stats`; the table is not known here.
    pub fn stats(&self) -> StructureStats {
        let quadrics = self.quadrics.iter().flat_map(|quadrics| quadrics.structures.iter().flatten());
        let moving = self.moving.structures().chain(quadrics.clone().filter(|structure| structure.moves()));
        StructureStats {
            bottom: (self.still.structures.len() + self.moving.structures().count() + quadrics.count()) as u64,
            bytes_moving: moving.map(BottomLevel::bytes).sum(),
            bytes_top: self.tops.iter().map(TopLevel::bytes).sum::<u64>() + self.alone.bytes_top(),
            ..self.stats
        }
    }
}

impl Triangles {
    /// The triangles that rest, with room for those that move behind them.
    fn new(device: &mut Device, world: &World, room: usize) -> Result<Self, RenderError> {
        let corners = pack::triangles(&world.still);
        let mut make = |name: &'static str, bytes: &[u8], size: usize| {
            let all = bytes.len() as u64 + (room * size) as u64;
            if all > device.limit() {
                return Err(device.too_large(name, all));
            }
            let buffer = Buffer::with_usage(&device.context, name, all, INPUT_USAGE, 16)?;
            buffer.upload(&mut device.submitter, bytes)?;
            Ok(Arc::new(buffer))
        };
        Ok(Self {
            corners: make("triangles", cast_slice(&corners), size_of::<io::Triangle>())?,
            shading: make("triangle shading", cast_slice(&world.still.shading), size_of::<io::TriangleShading>())?,
            boxes: if world.geometry.is_straight() {
                None
            } else {
                let boxes: Vec<io::Box> =
                    world.still.triangles.iter().map(|t| box_of_triangle(t, world.margin())).collect();
                Some(make("boxes", cast_slice(&boxes), size_of::<io::Box>())?)
            },
        })
    }
}

/// Geometries of a structure over some runs of triangles, and their hit records.
pub(super) fn geometries(world: &World, parts: &[Part]) -> (Vec<bottom::Part>, Vec<Record<HitRecord>>) {
    let groups = groups(world);
    let index = |group: Group| groups.iter().position(|g| *g == group).unwrap_or(0);
    let geometry = |part: &Part| {
        // Where an intersection shader meets triangles it looks for holes itself.
        let masked = world.plan.uses(Feature::AlphaMask)
            && world.geometry.is_straight()
            && world.materials.get(part.material as usize).is_some_and(|m| m.alpha_cutoff.is_some());
        let (first, count) = (part.triangles.start as u32, part.triangles.len() as u32);
        let group = index(if masked { Group::Masked } else { Group::Opaque });
        let record = Record { group, data: HitRecord { first, material: part.material } };
        (bottom::Part { first, count, opaque: !masked }, record)
    };
    parts.iter().map(geometry).unzip()
}

impl Still {
    fn new(
        device: &mut Device,
        world: &World,
        triangles: &Triangles,
        records: &mut Vec<Record<HitRecord>>,
        stats: &mut StructureStats,
    ) -> Result<Self, RenderError> {
        let copies = &world.still.copies;
        let made: Vec<_> = copies.iter().map(|copy| geometries(world, &copy.parts)).collect();
        let opaque = |index: usize| made[index].0.iter().map(|part| part.opaque);
        let images =
            triangles.boxes.is_none() && (!device.context.info().is_software() || world.still.triangles.len() > FEW);
        // Another material may make holes, and then the structure is another one; and the image of a box is none.
        let shared = |index: usize| {
            copies[index].image_of.filter(|(first, _)| {
                let same = *first < index && copies[*first].len() == copies[index].len();
                images && same && opaque(*first).eq(opaque(index))
            })
        };
        // Of its own is what others are images of; and, because software traverses large structures of boxes badly (1.2
        // times the instructions in Nil), each copy whose triangles have boxes.
        let mut own = vec![triangles.boxes.is_some(); copies.len()];
        (0..copies.len()).filter_map(shared).for_each(|(first, _)| own[first] = true);
        let mut blueprints: Vec<Blueprint> = Vec::new();
        // With the centres of their boxes.
        let mut placed: Vec<(DVec3, StillInstance)> = Vec::with_capacity(copies.len());
        let mut build = |name: String, parts: Vec<bottom::Part>| {
            let (shapes, buffer) = triangles.shapes();
            blueprints.push(Blueprint { name, shapes, buffer, parts, moves: false });
            blueprints.len() - 1
        };
        let centre = |copy: &MeshCopy| {
            let triangles = copy.parts.iter().flat_map(|part| &world.still.triangles[part.triangles.clone()]);
            Aabb::around(triangles.flatten().copied()).centre()
        };
        let mut known = vec![0; copies.len()];
        for (index, copy) in copies.iter().enumerate() {
            let (structure, transform) = match shared(index) {
                Some((first, map)) => (known[first], rows(&map)),
                None if own[index] => (build(format!("mesh copy {index}"), made[index].0.clone()), IDENTITY),
                None => continue,
            };
            known[index] = structure;
            if !copy.is_empty() {
                let record = records.len() as u32;
                placed.push((centre(copy), StillInstance { cell: copy.cell, structure, transform, record }));
                records.extend(&made[index].1);
            }
        }
        halve(&mut placed, |(_, instance)| instance.cell, |(centre, _)| *centre);
        let mut instances: Vec<_> = placed.into_iter().map(|(_, instance)| instance).collect();
        // The rest, which is there once only, is one structure: traversal need not enter several where they overlap.
        for cell in 0..world.domain.cells.len() {
            let alone = |index: &usize| {
                copies[*index].cell == cell && !copies[*index].is_empty() && !own[*index] && shared(*index).is_none()
            };
            let parts: Vec<_> = (0..copies.len()).filter(alone).flat_map(|index| made[index].0.clone()).collect();
            if !parts.is_empty() {
                let structure = build(format!("meshes of cell {cell}"), parts);
                let record = records.len() as u32;
                instances.push(StillInstance { cell, structure, transform: IDENTITY, record });
                records.extend((0..copies.len()).filter(alone).flat_map(|index| &made[index].1));
            }
        }
        stats.builds += blueprints.len() as u64;
        let (structures, bytes) = BottomLevel::build(&device.context, &mut device.submitter, blueprints)?;
        stats.bytes_built += bytes.built;
        stats.bytes_compacted += bytes.kept;
        Ok(Self { structures, instances })
    }
}

/// Brings the guards to the device.
fn put_guards(
    device: &mut Device,
    bound: &mut Vec<Bound>,
    guards: &Guards,
    scenes: &[uvec2],
) -> Result<(), RenderError> {
    let mut arrays = [uvec4::default(); ARRAYS as usize];
    let asked = guards.asked(scenes).to_vec();
    arrays[ARRAY_GUARDS as usize] = device.upload_addressed(bound, (binding::guards, "guards"), asked)?;
    bound.extend(device.upload(&[(binding::arrays, "addresses of arrays", cast_slice(&arrays))])?);
    Ok(())
}

fn rows(map: &DAffine3) -> [[f32; 4]; 3] {
    let (m, t) = (map.matrix3, map.translation);
    [0, 1, 2].map(|i| [m.x_axis[i], m.y_axis[i], m.z_axis[i], t[i]].map(|x| x as f32))
}

/// A box with room for the rounding of f32, and some more on all sides.
pub(super) fn box_about(lower: DVec3, upper: DVec3, margin: f64) -> io::Box {
    let slack = |x: DVec3| x.abs() * f64::from(io::BOX_SLACK) + f64::from(io::BOX_SLACK) + margin;
    io::Box { lower: pack::vec3(lower - slack(lower)), upper: pack::vec3(upper + slack(upper)) }
}

/// Twin: `shaders/entry/place.comp`.
fn box_of_triangle([a, b, c]: &[DVec3; 3], margin: f64) -> io::Box {
    box_about(a.min(*b).min(*c), a.max(*b).max(*c), margin)
}

impl Quadrics {
    fn new(
        device: &mut Device,
        world: &World,
        records: &mut Vec<Record<HitRecord>>,
        stats: &mut StructureStats,
    ) -> Result<Self, RenderError> {
        let group = groups(world).iter().position(|g| *g == Group::Quadric).unwrap_or(0);
        let spare = if world.quadrics_move() { SPARE_QUADRICS } else { 0 };
        let (mut places, mut first_records) = (Vec::new(), Vec::new());
        let mut next = 0;
        for cell in 0..world.domain.cells.len() {
            let count = world.quadrics.iter().filter(|q| q.cell == cell).count();
            first_records.push(records.len() as u32);
            records.push(Record { group, data: HitRecord { first: next as u32, material: NONE } });
            places.push(next..next + count + spare);
            next += count + spare;
        }
        let make = |name: &'static str, size: usize| {
            let bytes = (next.max(1) * size) as u64;
            if bytes > device.limit() {
                return Err(device.too_large(name, bytes));
            }
            Ok(Arc::new(Buffer::with_usage(&device.context, name, bytes, INPUT_USAGE, 16)?))
        };
        let mut quadrics = Self {
            boxes: make("quadric boxes", size_of::<io::Box>())?,
            surfaces: make("quadrics", size_of::<io::Quadric>())?,
            shading: make("quadric shading", size_of::<io::QuadricShading>())?,
            structures: Vec::new(),
            records: first_records,
            group,
            places,
            current: Vec::new(),
        };
        quadrics.pose(device, world, stats)?;
        Ok(quadrics)
    }

    /// Takes in the quadrics of a pose; `false` if there is no room for them.
    fn pose(&mut self, device: &mut Device, world: &World, stats: &mut StructureStats) -> Result<bool, RenderError> {
        let current: Vec<io::Quadric> = world.quadrics.iter().map(pack::quadric).collect();
        if current == self.current && !self.structures.is_empty() {
            return Ok(true);
        }
        let end = self.places.last().map_or(0, |range| range.end);
        let mut surfaces = vec![io::Quadric::default(); end];
        let mut shading = vec![io::QuadricShading::default(); end];
        let mut boxes = vec![io::Box::default(); end];
        let mut counts = vec![0; self.places.len()];
        for quadric in &world.quadrics {
            let at = self.places[quadric.cell].start + counts[quadric.cell];
            if at >= self.places[quadric.cell].end {
                return Ok(false);
            }
            counts[quadric.cell] += 1;
            surfaces[at] = pack::quadric(quadric);
            shading[at] = pack::quadric_shading(quadric);
            boxes[at] = box_about(quadric.bounds.lower, quadric.bounds.upper, 0.0);
        }
        self.surfaces.upload(&mut device.submitter, cast_slice(&surfaces))?;
        self.shading.upload(&mut device.submitter, cast_slice(&shading))?;
        self.boxes.upload(&mut device.submitter, cast_slice(&boxes))?;
        let filled: Vec<(usize, u32)> =
            counts.into_iter().enumerate().filter(|(_, n)| *n > 0).map(|(cell, n)| (cell, n as u32)).collect();
        let blueprints = filled.iter().map(|(cell, count)| Blueprint {
            name: format!("quadrics of cell {cell}"),
            shapes: Shapes::Boxes,
            buffer: self.boxes.clone(),
            parts: vec![bottom::Part { first: self.places[*cell].start as u32, count: *count, opaque: true }],
            moves: world.quadrics_move(),
        });
        // A few boxes are built as fast as they are refitted, and their number may change with each pose. The old
        // structures go before the new ones come.
        self.structures.clear();
        let (built, bytes) = BottomLevel::build(&device.context, &mut device.submitter, blueprints.collect())?;
        stats.builds += built.len() as u64;
        if !world.quadrics_move() {
            stats.bytes_built += bytes.built;
            stats.bytes_compacted += bytes.kept;
        }
        self.structures.resize_with(self.places.len(), || None);
        for ((cell, _), structure) in filled.into_iter().zip(built) {
            self.structures[cell] = Some(structure);
        }
        self.current = current;
        Ok(true)
    }

    /// What structures are built from.
    pub fn shapes(&self) -> (Shapes, Arc<Buffer>) {
        (Shapes::Boxes, self.boxes.clone())
    }

    /// The hit record of a geometry that begins with the quadric in that place of the buffers.
    pub fn record(&self, first: u32) -> Record<HitRecord> {
        Record { group: self.group, data: HitRecord { first, material: NONE } }
    }

    fn instance(&self, cell: usize) -> Option<Instance<'_>> {
        let structure = self.structures.get(cell)?.as_ref()?;
        let kind = if structure.moves() { KIND_MOVING } else { KIND_QUADRICS };
        Some(Instance { structure, transform: IDENTITY, record: self.records[cell], kind })
    }
}
