//! From JSON values to cells or generators, with the path of every fault.

use crate::geometry::{GEOMETRIES, GeometryId, Isometry, matrix_from_rows};
use crate::space::polyhedron::MAX_FACES;
use crate::space::{Cell, Face, FaceId};
use glam::{DMat4, DVec4};
use serde_json::{Map, Value};

/// More cells are refused.
const MAX_CELLS: usize = 1024;

/// More generators are refused.
const MAX_GENERATORS: usize = 64;

/// Numbers beyond this are refused: their squares would leave the range of f64.
const MAX_NUMBER: f64 = 1e100;

/// What a gluing file says.
pub(super) struct Groundwork {
    pub(super) geometry: GeometryId,
    pub(super) content: Content,
}

/// Either form of a gluing.
pub(super) enum Content {
    Cells(Vec<Cell>),
    Generators(Vec<Isometry>),
}

/// Something that does not belong there.
pub(super) struct Fault {
    pub(super) path: String,
    pub(super) message: String,
}

type Found<T> = Result<T, Fault>;

fn fault<T>(path: &str, message: impl Into<String>) -> Found<T> {
    Err(Fault { path: path.to_owned(), message: message.into() })
}

/// Reads the top level.
pub(super) fn groundwork(value: &Value) -> Found<Groundwork> {
    let top = object(value, "", &["geometry", "cells", "generators"])?;
    let geometry = geometry(required(top, "", "geometry")?)?;
    let content = match (top.get("cells"), top.get("generators")) {
        (Some(cells), None) => Content::Cells(cells_of(cells)?),
        (None, Some(generators)) => {
            let list = list(generators, "generators", 1, MAX_GENERATORS)?;
            let read = |(i, m)| matrix(m, &format!("generators[{i}]")).map(Isometry::linear);
            Content::Generators(list.iter().enumerate().map(read).collect::<Found<_>>()?)
        }
        _ => return fault("", "needs either \"cells\" or \"generators\""),
    };
    Ok(Groundwork { geometry, content })
}

fn geometry(value: &Value) -> Found<GeometryId> {
    let Some(name) = value.as_str() else { return fault("geometry", "needs the name of a geometry") };
    let names = GEOMETRIES.iter().flat_map(|entry| std::iter::once(entry.name).chain(entry.aliases.iter().copied()));
    match GeometryId::from_name(name) {
        Some(id) => Ok(id),
        None => fault("geometry", format!("unknown geometry {name:?}{}", suggestion(name, names))),
    }
}

fn cells_of(value: &Value) -> Found<Vec<Cell>> {
    let cells = list(value, "cells", 1, MAX_CELLS)?;
    let cell = |(c, value)| {
        let path = format!("cells[{c}]");
        let faces = required(object(value, &path, &["faces"])?, &path, "faces")?;
        let path = format!("{path}.faces");
        let read = |(f, value)| face(value, &format!("{path}[{f}]"));
        let faces = list(faces, &path, 4, MAX_FACES)?.iter().enumerate().map(read).collect::<Found<_>>()?;
        Ok(Cell { faces })
    };
    cells.iter().enumerate().map(cell).collect()
}

fn face(value: &Value, path: &str) -> Found<Face> {
    let face = object(value, path, &["plane", "pair", "matrix", "shift"])?;
    let plane = vector(required(face, path, "plane")?, &format!("{path}.plane"))?;
    let pair_path = format!("{path}.pair");
    let pair = object(required(face, path, "pair")?, &pair_path, &["cell", "face"])?;
    let partner = FaceId { cell: index(pair, &pair_path, "cell")?, face: index(pair, &pair_path, "face")? };
    let linear = matrix(required(face, path, "matrix")?, &format!("{path}.matrix"))?;
    let shift = face.get("shift").map_or(Ok(DVec4::ZERO), |shift| vector(shift, &format!("{path}.shift")))?;
    Ok(Face { plane, pairing: Isometry { linear, shift }, partner })
}

fn object<'a>(value: &'a Value, path: &str, keys: &[&'static str]) -> Found<&'a Map<String, Value>> {
    let Some(map) = value.as_object() else {
        return fault(path, format!("needs an object with the keys {}", keys.join(", ")));
    };
    match map.keys().find(|key| !keys.contains(&key.as_str())) {
        Some(key) => fault(path, format!("unknown key {key:?}{}", suggestion(key, keys.iter().copied()))),
        None => Ok(map),
    }
}

fn required<'a>(map: &'a Map<String, Value>, path: &str, key: &str) -> Found<&'a Value> {
    map.get(key).map_or_else(|| fault(path, format!("the key {key:?} is missing")), Ok)
}

fn list<'a>(value: &'a Value, path: &str, least: usize, most: usize) -> Found<&'a Vec<Value>> {
    match value.as_array() {
        Some(list) if (least..=most).contains(&list.len()) => Ok(list),
        Some(list) => fault(path, format!("has {} entries, allowed are {least} to {most}", list.len())),
        None => fault(path, "needs a list"),
    }
}

fn index(map: &Map<String, Value>, path: &str, key: &str) -> Found<usize> {
    let value = required(map, path, key)?;
    match value.as_u64().and_then(|n| usize::try_from(n).ok()) {
        Some(n) => Ok(n),
        None => fault(&format!("{path}.{key}"), format!("needs an index from 0, not {value}")),
    }
}

fn matrix(value: &Value, path: &str) -> Found<DMat4> {
    let Some(rows) = value.as_array().filter(|rows| rows.len() == 4) else {
        return fault(path, "needs 4 rows of 4 numbers");
    };
    let mut matrix = [[0.0; 4]; 4];
    for (i, row) in rows.iter().enumerate() {
        matrix[i] = vector(row, &format!("{path}[{i}]"))?.to_array();
    }
    Ok(matrix_from_rows(matrix))
}

fn vector(value: &Value, path: &str) -> Found<DVec4> {
    let Some(numbers) = value.as_array().filter(|numbers| numbers.len() == 4) else {
        return fault(path, "needs 4 numbers");
    };
    let mut vector = DVec4::ZERO;
    for (i, number) in numbers.iter().enumerate() {
        vector[i] = match number.as_f64() {
            Some(x) if x.abs() <= MAX_NUMBER => x,
            Some(x) => return fault(&format!("{path}[{i}]"), format!("{x:e} is beyond ±{MAX_NUMBER:e}")),
            None => return fault(&format!("{path}[{i}]"), format!("needs a number, not {}", kind(number))),
        };
    }
    Ok(vector)
}

/// What a value is, in a word.
fn kind(value: &Value) -> &'static str {
    match value {
        Value::Null => "null",
        Value::Bool(_) => "a truth value",
        Value::Number(_) => "a number",
        Value::String(_) => "a text",
        Value::Array(_) => "a list",
        Value::Object(_) => "an object",
    }
}

/// The known name nearest to an unknown one.
fn suggestion<'a>(unknown: &str, known: impl Iterator<Item = &'a str>) -> String {
    // Long keys of hostile files would take quadratic time.
    let start: String = unknown.chars().take(64).collect();
    let nearest = known.min_by_key(|name| strsim::damerau_levenshtein(&start, name));
    nearest.map(|name| format!(", did you mean {name:?}?")).unwrap_or_default()
}
