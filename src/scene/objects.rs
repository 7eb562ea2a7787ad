//! The `[[object]]` tables of a scene file.

use super::{
    Hand, Motion, Object, Place, Shape,
    file::Builder,
    gltf,
    places::{self, Local},
    reader::{Bounds, SceneError, Table, Value, suggestion},
};
use crate::space::observer::Frame;
use glam::{DMat3, DVec3};

pub(super) const KEYS: &[&str] = &[
    "name", "kind", "file", "position", "cell", "frame", "look", "up", "rotate", "scale", "radius", "length",
    "material", "attach", "offset", "motion", "width", "face", "lower", "upper", "lines",
];

/// How far a mesh may reach from its origin, as a length in the space.
const MAX_REACH: f64 = 1000.0;

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Mesh,
    Tube,
    Ball,
    DomainEdges,
    DomainFaces,
    Grid,
}

impl Kind {
    /// What is said of those that belong to a cell.
    fn stays(self) -> Option<&'static str> {
        match self {
            Self::DomainEdges => Some("the edges of a cell stay where they are"),
            Self::DomainFaces => Some("the faces of a cell stay where they are"),
            Self::Grid => Some("the lines of a grid stay where they are"),
            Self::Mesh | Self::Tube | Self::Ball => None,
        }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Attach {
    World,
    Viewer,
    Hand(Hand),
}

const KINDS: &[(&str, Kind)] = &[
    ("mesh", Kind::Mesh),
    ("tube", Kind::Tube),
    ("ball", Kind::Ball),
    ("domain-edges", Kind::DomainEdges),
    ("domain-faces", Kind::DomainFaces),
    ("grid", Kind::Grid),
];

/// Most places of a grid along one axis.
const MAX_LINES: u32 = 32;

const ATTACHMENTS: &[(&str, Attach)] = &[
    ("world", Attach::World),
    ("viewer", Attach::Viewer),
    ("left-hand", Attach::Hand(Hand::Left)),
    ("right-hand", Attach::Hand(Hand::Right)),
];

/// Adds an object to the scene.
pub(super) fn read(mut table: Table, builder: &mut Builder) -> Result<(), SceneError> {
    let kind_value = table.need("kind")?;
    let kind = kind_value.choice(KINDS)?;
    let kind_name = kind_value.string()?;
    let name = table.take("name").map(|v| v.string().map(str::to_owned)).transpose()?;
    let material = table.take("material").map(|v| material(&v, builder)).transpose()?;
    if material.is_none() && kind != Kind::Mesh {
        return Err(table.error(format!("[[object]] of kind {kind_name:?} needs \"material\"")));
    }
    let radius = Bounds::above(0.0, MAX_REACH);
    let mut scale = 1.0;
    let shape = match kind {
        Kind::Mesh => {
            let file = table.need("file")?;
            let mesh = mesh(&file, builder)?;
            let scale_value = table.take("scale");
            scale = scale_value.as_ref().map_or(Ok(1.0), |v| v.number(Bounds::above(0.0, 1e6)))?;
            let reach = builder.reach[mesh] * scale;
            if reach > MAX_REACH {
                let place = scale_value.as_ref().unwrap_or(&file);
                let message = format!("the mesh reaches {reach:.3e} from its origin, at most {MAX_REACH} are allowed");
                return Err(place.error(message));
            }
            Shape::Mesh(mesh)
        }
        Kind::Tube => Shape::Tube {
            radius: table.need("radius")?.number(radius)?,
            length: table.need("length")?.number(Bounds::above(0.0, MAX_REACH))?,
        },
        Kind::Ball => Shape::Ball { radius: table.need("radius")?.number(radius)? },
        Kind::DomainEdges => Shape::DomainEdges { radius: table.need("radius")?.number(radius)? },
        Kind::DomainFaces => Shape::DomainFaces {
            width: table.take("width").map_or(Ok(1.0), |v| v.number(Bounds::above(0.0, 1.0)))?,
            face: table.take("face").map(|v| Ok::<_, SceneError>(v.integer(0, u32::MAX)? as usize)).transpose()?,
        },
        Kind::Grid => grid(&mut table)?,
    };
    let (place, attach_name) = place(&mut table, kind, builder)?;
    let motion = table.take("motion").map(|v| motion(&v, kind)).transpose()?;
    table.finish(&format!("for an object of kind {kind_name:?} with attach = {attach_name:?}"))?;
    let default_name = || format!("{kind_name} {}", builder.objects.len());
    let name = name.unwrap_or_else(default_name);
    builder.objects.push(Object { name, shape, place, scale, material, motion });
    Ok(())
}

/// The keys of a grid.
fn grid(table: &mut Table) -> Result<Shape, SceneError> {
    let mut corner = |key| {
        let value = table.need(key)?;
        let n = value.numbers(&[3], Bounds::closed(-MAX_REACH, MAX_REACH))?;
        Ok::<_, SceneError>((value, DVec3::new(n[0], n[1], n[2])))
    };
    let ((_, lower), (value, upper)) = (corner("lower")?, corner("upper")?);
    if lower.cmpgt(upper).any() || lower == upper {
        return Err(value.error(format!("the corner {upper} is not beyond the corner \"lower\", {lower}")));
    }
    let value = table.need("lines")?;
    let counts = value.array("an array of 3 numbers of lines")?;
    if counts.len() != 3 {
        return Err(value.expected("an array of 3 numbers of lines"));
    }
    let mut lines = [0; 3];
    for (count, value) in lines.iter_mut().zip(&counts) {
        *count = value.integer(1, MAX_LINES)?;
    }
    let radius = table.need("radius")?.number(Bounds::above(0.0, MAX_REACH))?;
    Ok(Shape::Grid { lower, upper, lines, radius })
}

/// `motion = { velocity = [x, y, z], spin = [x, y, z, degrees] }`, both per unit of time and in the object's own axes.
fn motion(value: &Value, kind: Kind) -> Result<Motion, SceneError> {
    if let Some(stays) = kind.stays() {
        return Err(value.error(format!("{stays}: they cannot move")));
    }
    let mut table = value.table("motion", &["velocity", "spin"])?;
    let velocity =
        table.take("velocity").map(|v| v.numbers(&[3], Bounds::closed(-MAX_REACH, MAX_REACH))).transpose()?;
    let spin = table.take("spin");
    table.finish("in motion")?;
    let turn = match spin {
        Some(value) => {
            let n = value.numbers(&[4], Bounds::closed(-1e6, 1e6))?;
            let axis = DVec3::new(n[0], n[1], n[2]).try_normalize();
            axis.ok_or_else(|| value.error("the axis is zero"))? * n[3].to_radians()
        }
        None => DVec3::ZERO,
    };
    Ok(Motion { velocity: velocity.map_or(DVec3::ZERO, |v| DVec3::new(v[0], v[1], v[2])), turn })
}

fn place(table: &mut Table, kind: Kind, builder: &Builder) -> Result<(Place, &'static str), SceneError> {
    let attach_value = table.take("attach");
    let attach = attach_value.as_ref().map_or(Ok(Attach::World), |v| v.choice(ATTACHMENTS))?;
    match (attach, &attach_value) {
        (Attach::Viewer | Attach::Hand(_), value) => {
            if let (Some(stays), Some(value)) = (kind.stays(), value) {
                return Err(value.error(format!("{stays}: they cannot be attached to the viewer")));
            }
            let offset = table.take("offset");
            let offset = offset.map_or(Ok(vec![0.0; 3]), |v| v.numbers(&[3], Bounds::closed(-MAX_REACH, MAX_REACH)))?;
            let offset = DVec3::new(offset[0], offset[1], offset[2]);
            let rotation = table.take("rotate").map_or(Ok(DMat3::IDENTITY), |v| places::turns(&v))?;
            Ok(match attach {
                Attach::Hand(hand) => {
                    let name = ["left-hand", "right-hand"][hand as usize];
                    (Place::Hand { hand, offset, rotation }, name)
                }
                _ => (Place::Viewer { offset, rotation }, "viewer"),
            })
        }
        _ if kind.stays().is_some() => {
            let cell = places::cell(table, &builder.space)?;
            Ok((Place::World(Local::base(&builder.space, cell).frame(DMat3::IDENTITY)), "world"))
        }
        _ => Ok((Place::World(world(table, builder)?), "world")),
    }
}

/// Position and axes: from one of `frame`, `look` with `up`, and `rotate`.
fn world(table: &mut Table, builder: &Builder) -> Result<Frame, SceneError> {
    let local = Local::read(table, &builder.space)?;
    let ways = ["frame", "look", "rotate"].iter().filter(|key| table.has(key)).count();
    if ways > 1 {
        return Err(table.error("[[object]] takes only one of \"frame\", \"look\" and \"rotate\""));
    }
    if let Some(frame) = table.take("frame") {
        return Ok(local.frame(local.orthonormal(&frame)?));
    }
    if let Some(turns) = table.take("rotate") {
        return Ok(local.frame(places::turns(&turns)?));
    }
    if let Some(look) = table.take("look") {
        let forward = local.direction(&look)?;
        return Ok(local.frame(local.upright(forward, table.take("up").as_ref())?));
    }
    Ok(local.frame(DMat3::IDENTITY))
}

fn material(value: &Value, builder: &Builder) -> Result<usize, SceneError> {
    let name = value.string()?;
    let known = builder.material_names.iter().position(|known| known == name);
    known.ok_or_else(|| {
        let hint = suggestion(name, &builder.material_names, "materials of the scene");
        value.error(format!("unknown material {name:?}: {hint}"))
    })
}

/// The mesh in a file; a file that is named twice is read once.
fn mesh(value: &Value, builder: &mut Builder) -> Result<usize, SceneError> {
    let file = value.string()?;
    if let Some(known) = builder.meshes.iter().position(|mesh| mesh.name == file) {
        return Ok(known);
    }
    let loaded = gltf::read(builder.folder, file, builder.materials.len(), &builder.textures);
    let loaded = loaded.map_err(|e| value.error(e))?;
    builder.materials.extend(loaded.materials);
    builder.textures.extend(loaded.textures);
    let reach = loaded.mesh.vertices.iter().map(|vertex| vertex.position.length()).fold(0.0, f64::max);
    builder.reach.push(reach);
    builder.meshes.push(loaded.mesh);
    Ok(builder.meshes.len() - 1)
}
