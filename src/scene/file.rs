//! Scene files: TOML with line and column in every message.
//!
//! | table | keys |
//! | --- | --- |
//! | `[space]` | `manifold` (a name from the catalogue), `gluing` (a file) or `geometry` (the whole of it) |
//! | `[observer]` | `position`, `cell`, `look`, `up`, `fov` (vertical, degrees), `eye-distance` |
//! | `[[observer.path]]` | a key pose of the camera path: `step` with `rotate`, or `position`, `cell`, `look`, `up`; `frames` |
//! | `[[light]]` | `kind` (`point` or `viewer`), `color`, `intensity`, and for points `position`, `cell`, `range`, `shadows`, `direction` with `angle` (degrees from the axis of the cone to its edge) |
//! | `[[material]]` | `name`, `color`, `metallic`, `roughness`, `emission`, `alpha-cutoff`, `texture`, `surface-texture`, `coordinates` |
//! | `[[object]]` | `kind` (`mesh`, `tube`, `ball`, `domain-edges`, `domain-faces` or `grid`), `name`, `file`, `scale`, `radius`, `length`, `width` with `face`, `lower` with `upper` and `lines`, `material`; `attach = "world"`: `position`, `cell` and `frame`, `look` with `up`, or `rotate`; `attach = "viewer"`, and with a headset `"left-hand"` and `"right-hand"`: `offset`, `rotate`; `motion = { velocity = [x, y, z], spin = [x, y, z, degrees] }`: in its own axes, per unit of time |
//! | `[render]` | `bounces`, `max-distance`, `fog`, `background`, `ambient`, `shading`, `tolerance` |
//!
//! A camera path starts at the observer's own pose and goes from key to key along geodesics, with parallel transport,
//! setting out gently and coming to rest at each. `step` is where to walk, as right, up and back in the frame of the key
//! before; it may be longer than the cell, the way leads through the faces. `rotate` turns the frame on the way, as for
//! objects. `position` gives the pose as for the observer instead: the way is the shortest in the cell of the key before.
//! `frames` is the number of pictures from the key before to this one (48 if not given); picture 0 is the start.
//!
//! A whole geometry without end is seen up to `max-distance`, 8 if it is not given.
//!
//! `coordinates = [[a, b], [c, d], [e, f]]` colours a material by place: its red is multiplied with a number that goes
//! from 0 to 1 while the chart's x goes from a to b, its green by y, its blue by z.
//!
//! `domain-faces` are frames along the edges of the cell's faces, of a `width` from 0 to 1 (whole faces); of two faces
//! that are glued to each other the one with the lower number, or one `face` alone. A `grid` has tubes along the chart's
//! coordinate lines through the box from `lower` to `upper`, at so many places along x, y and z as `lines` says.
//!
//! Points have the geometry's own components; vectors have these or three components in the geometry's standard
//! frame at their point. `look` is where an observer looks, and the third axis (`z`) of an object. Colours are
//! linear numbers or `"#rrggbb"` in sRGB. Paths are relative to the scene's folder and stay in it.

use super::{
    MAX_BOUNCES, Material, Mesh, Object, Observer, PointLight, Scene, Settings, Shading, Spot, Texture, Wrap,
    folder::Folder,
    objects, path,
    places::Local,
    reader::{Bounds, Source, Table, Value, suggestion},
    shipped,
    texture::{Encoding, decode, texels},
};
use crate::{
    geometry::{GEOMETRIES, GeometryId},
    space::{Space, catalogue, gluing, observer::Leg, polyhedron::Polyhedron},
};
use std::{
    fs::File,
    io::{self, Read},
    path::Path,
};
use toml_edit::Document;

pub use super::reader::SceneError;

/// Largest scene file, in bytes.
const MAX_SCENE_SIZE: u64 = 1 << 24;

/// How far one sees in a space without end, unless the scene says otherwise: as far as numbers of 32 bits name points
/// in hyperbolic space.
const WHOLE_DISTANCE: f64 = 8.0;

/// Colours of lights, and numbers that multiply them.
const BRIGHT: Bounds = Bounds::closed(0.0, 1e6);

/// Loads a scene: the name of a shipped scene (each named space has one under its own name), or the path of a TOML
/// file.
///
/// # Errors
/// What is wrong, on one line, with the place in the file where there is one.
pub fn load(name_or_path: &str) -> Result<Scene, SceneError> {
    if let Some(bytes) = shipped::find(name_or_path) {
        let mut scene = read(&format!("{name_or_path}.toml"), bytes, &Folder::Embedded)?;
        scene.name = name_or_path.to_owned();
        return Ok(scene);
    }
    let path = Path::new(name_or_path);
    let io = |e: io::Error| match e.kind() {
        io::ErrorKind::NotFound => SceneError::file(name_or_path, no_such_scene(name_or_path)),
        _ => SceneError::file(name_or_path, e.to_string()),
    };
    let mut bytes = Vec::new();
    File::open(path).map_err(io)?.take(MAX_SCENE_SIZE + 1).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > MAX_SCENE_SIZE {
        return Err(SceneError::file(name_or_path, format!("more than {MAX_SCENE_SIZE} bytes")));
    }
    read(name_or_path, &bytes, &Folder::of(path).map_err(io)?)
}

/// The space that a name means: of the catalogue, a whole geometry, of a gluing file (`.json`), or of a scene as [`load`] finds it.
///
/// # Errors
/// As [`load`].
pub fn load_space(name_or_path: &str) -> Result<Space, SceneError> {
    if let Some(space) = catalogue::find(name_or_path) {
        return Ok(space);
    }
    if let Some(geometry) = GeometryId::from_name(name_or_path) {
        return Ok(catalogue::whole(geometry));
    }
    if name_or_path.to_ascii_lowercase().ends_with(".json") {
        return Ok(gluing::read(Path::new(name_or_path))?);
    }
    load(name_or_path).map(|scene| scene.space)
}

fn no_such_scene(name: &str) -> String {
    if name.contains(['/', '.']) {
        return "no such file".to_owned();
    }
    let names: Vec<&str> = shipped::names().collect();
    format!("no such file, and no scene of this name: {}", suggestion(name, &names, "scenes"))
}

/// Reads a scene from the bytes of its file; `name` is for messages.
///
/// # Errors
/// As [`load`].
pub fn read(name: &str, bytes: &[u8], folder: &Folder) -> Result<Scene, SceneError> {
    let text = std::str::from_utf8(bytes).map_err(|e| {
        let valid = String::from_utf8_lossy(&bytes[..e.valid_up_to()]);
        Source { name, text: &valid }.error(valid.len(), "the file is not UTF-8 text")
    })?;
    let source = Source { name, text };
    let document = Document::parse(text).map_err(|e| {
        source.error(e.span().map_or(0, |span| span.start), format!("TOML: {}", e.message().replace('\n', ", ")))
    })?;
    let keys = ["space", "observer", "light", "material", "object", "render"];
    let mut root = Table::open(source, "", 0, document.as_table(), &keys)?;

    let space = match root.take("space") {
        Some(value) => space(value.table("[space]", &["manifold", "gluing", "geometry"])?, folder)?,
        None => return Err(SceneError::file(name, "the table [space] is missing")),
    };
    let mut builder = Builder::new(folder, space);
    for table in all(&mut root, "material", "[[material]]", MATERIAL_KEYS)? {
        builder.material(table)?;
    }
    if let Some(value) = root.take("render") {
        builder.render(value.table("[render]", RENDER_KEYS)?)?;
    }
    for table in all(&mut root, "light", "[[light]]", LIGHT_KEYS)? {
        builder.light(table)?;
    }
    for table in all(&mut root, "object", "[[object]]", objects::KEYS)? {
        objects::read(table, &mut builder)?;
    }
    let (observer, path) = match root.take("observer") {
        Some(value) => builder.observer(value.table("[observer]", OBSERVER_KEYS)?)?,
        None => (builder.default_observer(), Vec::new()),
    };
    root.finish("in a scene")?;
    Ok(builder.finish(name, observer, path))
}

fn all<'a>(
    root: &mut Table<'a>,
    key: &'static str,
    name: &'static str,
    keys: &[&'static str],
) -> Result<Vec<Table<'a>>, SceneError> {
    root.take(key).map_or(Ok(Vec::new()), |value| value.tables(name, keys))
}

fn space(mut table: Table, folder: &Folder) -> Result<Space, SceneError> {
    let space = match (table.take("manifold"), table.take("gluing"), table.take("geometry")) {
        (Some(value), None, None) => {
            let name = value.string()?;
            catalogue::find(name).ok_or_else(|| {
                let catalogue = catalogue::NAMES.join(", ");
                let guess = suggestion(name, catalogue::NAMES, "");
                let guess = if guess.starts_with("did") { format!(": {guess}") } else { String::new() };
                value.error(format!("unknown space {name:?}{guess} (known: {catalogue})"))
            })?
        }
        (None, Some(value), None) => {
            let path = folder.path(value.string()?).map_err(|e| value.error(e))?;
            gluing::read(&path).map_err(|e| value.error(e))?
        }
        (None, None, Some(value)) => {
            let names: Vec<_> = GEOMETRIES.iter().map(|entry| (entry.name, entry.id)).collect();
            catalogue::whole(value.choice(&names)?)
        }
        (None, None, None) => return Err(table.error("[space] needs \"manifold\", \"gluing\" or \"geometry\"")),
        _ => return Err(table.error("[space] takes only one of \"manifold\", \"gluing\" and \"geometry\"")),
    };
    table.finish("in [space]")?;
    Ok(space)
}

const OBSERVER_KEYS: &[&str] = &["position", "cell", "look", "up", "fov", "eye-distance", "path"];
const LIGHT_KEYS: &[&str] =
    &["kind", "position", "cell", "color", "intensity", "range", "shadows", "direction", "angle"];
const MATERIAL_KEYS: &[&str] = &[
    "name",
    "color",
    "metallic",
    "roughness",
    "emission",
    "alpha-cutoff",
    "texture",
    "surface-texture",
    "coordinates",
];
const RENDER_KEYS: &[&str] = &["bounces", "max-distance", "fog", "background", "ambient", "shading", "tolerance"];

/// Ranges of the chart's x, y and z over which red, green and blue go from 0 to 1.
fn coordinates(value: &Value) -> Result<[[f64; 2]; 3], SceneError> {
    let rows = value.array("an array of 3 ranges [from, to]")?;
    if rows.len() != 3 {
        return Err(value.expected("an array of 3 ranges [from, to]"));
    }
    let mut ranges = [[0.0; 2]; 3];
    for (range, row) in ranges.iter_mut().zip(&rows) {
        let ends = row.numbers(&[2], Bounds::closed(-1e6, 1e6))?;
        if (ends[1] - ends[0]).abs() < 1e-6 {
            return Err(row.error("the range is empty"));
        }
        *range = [ends[0], ends[1]];
    }
    Ok(ranges)
}

/// A scene while it is read.
pub(super) struct Builder<'a> {
    pub folder: &'a Folder,
    pub space: Space,
    /// Names of the scene's own materials, which come first in `materials`.
    pub material_names: Vec<String>,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
    /// Files of the scene's own textures, with what they are used for.
    texture_files: Vec<(String, Encoding, usize)>,
    pub meshes: Vec<Mesh>,
    /// Largest distance of a vertex of each mesh from its origin.
    pub reach: Vec<f64>,
    pub objects: Vec<Object>,
    lights: Vec<PointLight>,
    settings: Settings,
}

impl<'a> Builder<'a> {
    fn new(folder: &'a Folder, space: Space) -> Self {
        Self {
            folder,
            space,
            material_names: Vec::new(),
            materials: Vec::new(),
            textures: Vec::new(),
            texture_files: Vec::new(),
            meshes: Vec::new(),
            reach: Vec::new(),
            objects: Vec::new(),
            lights: Vec::new(),
            settings: Settings::default(),
        }
    }

    fn finish(mut self, name: &str, observer: Observer, path: Vec<Leg>) -> Scene {
        if self.space.cells.iter().any(|cell| matches!(Polyhedron::bounded(cell), Ok(None))) {
            self.settings.max_distance.get_or_insert(WHOLE_DISTANCE);
        }
        Scene {
            name: name.to_owned(),
            space: self.space,
            observer,
            path,
            lights: self.lights,
            materials: self.materials,
            textures: self.textures,
            meshes: self.meshes,
            objects: self.objects,
            settings: self.settings,
        }
    }

    /// At the base point, looking along −z with y up.
    fn default_observer(&self) -> Observer {
        Observer { frame: Local::base(&self.space, 0).frame(glam::DMat3::IDENTITY), fov: 70.0, eye_distance: 0.03 }
    }

    fn observer(&self, mut table: Table) -> Result<(Observer, Vec<Leg>), SceneError> {
        let local = Local::read(&mut table, &self.space)?;
        let look = table.take("look").map_or(Ok(glam::DVec3::NEG_Z), |value| local.direction(&value))?;
        // The third axis points back, and back = −look: the same rule as for objects.
        let axes = local.upright(-look, table.take("up").as_ref())?;
        let default = self.default_observer();
        let fov = table.take("fov").map_or(Ok(default.fov), |value| value.number(Bounds::open(0.0, 180.0)))?;
        let eye_distance = table.take("eye-distance");
        let eye_distance =
            eye_distance.map_or(Ok(default.eye_distance), |value| value.number(Bounds::closed(0.0, 10.0)))?;
        let keys = table.take("path");
        table.finish("in [observer]")?;
        let frame = local.frame(axes);
        let keys = keys.map_or(Ok(Vec::new()), |value| value.tables("[[observer.path]]", path::KEYS))?;
        Ok((Observer { frame, fov, eye_distance }, path::read(keys, &self.space, frame)?))
    }

    fn light(&mut self, mut table: Table) -> Result<(), SceneError> {
        let kinds = [("point", true), ("viewer", false)];
        let is_point = table.take("kind").map_or(Ok(true), |value| value.choice(&kinds))?;
        let color = table.take("color").map_or(Ok([1.0; 3]), |value| value.color(BRIGHT))?;
        let intensity = table.take("intensity").map_or(Ok(1.0), |value| value.number(BRIGHT))? as f32;
        let color = color.map(|c| c * intensity);
        if !is_point {
            for (total, c) in self.settings.headlight.iter_mut().zip(color) {
                *total += c;
            }
            return table.finish("for a light of kind \"viewer\"");
        }
        if !table.has("position") {
            return Err(table.error("[[light]] needs \"position\""));
        }
        let local = Local::read(&mut table, &self.space)?;
        let frame = local.frame(glam::DMat3::IDENTITY);
        let range = table.take("range").map_or(Ok(4.0), |value| value.number(Bounds::above(0.0, 1000.0)))?;
        let shadows = table.take("shadows").map_or(Ok(false), |value| value.boolean())?;
        let spot = match table.take("direction") {
            None => None,
            Some(value) => {
                let angle = table.take("angle").map_or(Ok(30.0), |v| v.number(Bounds::open(0.0, 180.0)))?;
                let direction = frame.vector(local.direction(&value)?);
                Some(Spot { direction, cos_angle: angle.to_radians().cos() })
            }
        };
        table.finish("for a light without \"direction\"")?;
        self.lights.push(PointLight { cell: frame.cell, point: frame.point, color, range, shadows, spot });
        Ok(())
    }

    fn material(&mut self, mut table: Table) -> Result<(), SceneError> {
        let name_value = table.need("name")?;
        let name = name_value.string()?;
        if self.material_names.iter().any(|known| known == name) {
            return Err(name_value.error(format!("there is a material {name:?} already")));
        }
        let base_texture = table.take("texture").map(|v| self.texture(&v, Encoding::Srgb)).transpose()?;
        let surface_texture = table.take("surface-texture").map(|v| self.texture(&v, Encoding::Linear)).transpose()?;
        let mut unit = |key, default: f32| {
            table.take(key).map_or(Ok(default), |value: Value| Ok::<_, SceneError>(value.number(Bounds::UNIT)? as f32))
        };
        // As in glTF, what a texture says is multiplied with the number, so that the neutral number is 1.
        let neutral = |plain| if surface_texture.is_some() { 1.0 } else { plain };
        let (metallic, roughness) = (unit("metallic", neutral(0.0))?, unit("roughness", neutral(0.6))?);
        let default_color = if base_texture.is_some() { [1.0; 4] } else { [0.8, 0.8, 0.8, 1.0] };
        let material = Material {
            name: name.to_owned(),
            base_color: table.take("color").map_or(Ok(default_color), |value| value.color(Bounds::UNIT))?,
            emission: table.take("emission").map_or(Ok([0.0; 3]), |value| value.color(BRIGHT))?,
            metallic,
            roughness,
            alpha_cutoff: table
                .take("alpha-cutoff")
                .map(|value| Ok::<_, SceneError>(value.number(Bounds::UNIT)? as f32))
                .transpose()?,
            base_texture,
            surface_texture,
            coordinates: table.take("coordinates").map(|value| coordinates(&value)).transpose()?,
        };
        table.finish("in [[material]]")?;
        self.material_names.push(name.to_owned());
        self.materials.push(material);
        Ok(())
    }

    /// The texture in a file; a file that is named twice is read once.
    fn texture(&mut self, value: &Value, encoding: Encoding) -> Result<usize, SceneError> {
        let file = value.string()?;
        let known = self.texture_files.iter().find(|(name, e, _)| name == file && *e == encoding);
        if let Some((_, _, index)) = known {
            return Ok(*index);
        }
        let bytes = self.folder.read(file).map_err(|e| value.error(e))?;
        let texture = decode(&bytes, encoding, [Wrap::Repeat; 2], texels(&self.textures));
        self.textures.push(texture.map_err(|e| value.error(format!("{file}: {e}")))?);
        let index = self.textures.len() - 1;
        self.texture_files.push((file.to_owned(), encoding, index));
        Ok(index)
    }

    fn render(&mut self, mut table: Table) -> Result<(), SceneError> {
        let settings = &mut self.settings;
        if let Some(value) = table.take("bounces") {
            settings.bounces = value.integer(1, MAX_BOUNCES)?;
        }
        if let Some(value) = table.take("max-distance") {
            settings.max_distance = Some(value.number(Bounds::above(0.0, 1e6))?);
        }
        if let Some(value) = table.take("fog") {
            settings.fog = value.number(Bounds::closed(0.0, 1000.0))?;
        }
        if let Some(value) = table.take("background") {
            settings.background = value.color(BRIGHT)?;
        }
        if let Some(value) = table.take("ambient") {
            settings.ambient = value.color(BRIGHT)?;
        }
        if let Some(value) = table.take("shading") {
            settings.shading = value.choice(Shading::NAMES)?;
        }
        if let Some(value) = table.take("tolerance") {
            settings.tolerance = value.number(Bounds::above(0.0, 100.0))?;
        }
        table.finish("in [render]")
    }
}
