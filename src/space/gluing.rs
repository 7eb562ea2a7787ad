//! Gluing files: spaces as JSON.
//!
//! Two forms. The explicit one lists cells, their faces and pairings:
//!
//! ```json
//! {"geometry": "e3", "cells": [{"faces": [
//!   {"plane": [1, 0, 0, -1], "pair": {"cell": 0, "face": 1},
//!    "matrix": [[1, 0, 0, -1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}, …]}]}
//! ```
//!
//! A plane `[a, b, c, d]` is ax + by + cz + d ≤ 0 inside, in the chart and of any scale; a matrix acts on columns
//! and takes what lies beyond its face into the partner's cell; `"shift"`, four numbers, is for the isometries
//! that need it. The other form, `{"geometry": "e3", "generators": [[[…], …], …]}`, lists isometries; the cell is
//! the Dirichlet domain of the base point under the group that they generate (module `dirichlet`).
//!
//! Either way the gluing is checked before it is handed out.

mod dirichlet;
mod json;

use super::check::{self, CheckError};
use super::{Cell, Face, Space};
use crate::geometry::{Geometry, Visitor, visit};
use glam::{DVec4, Vec4Swizzles};
use json::{Content, Groundwork};
use std::fmt::Write as _;
use std::path::Path;

pub use dirichlet::DirichletError;

/// Larger files are refused: the largest sensible gluing has some thousands of faces of 400 bytes.
const MAX_BYTES: u64 = 16 << 20;

/// Why a gluing file is refused. Every message is one line and begins with the file's name.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GluingError {
    /// The file cannot be read.
    #[error("{name}: {reason}")]
    Unreadable {
        /// The file.
        name: String,
        /// What the system says, or the limit.
        reason: String,
    },
    /// Not JSON, or a number that is out of range.
    #[error("{name}:{line}:{column}: {message}")]
    Syntax {
        /// The file.
        name: String,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// What is wrong there.
        message: String,
    },
    /// JSON that is no gluing.
    #[error("{name}: {path}{message}")]
    Content {
        /// The file.
        name: String,
        /// Where, as in `cells[0].faces[3].matrix: `; empty for the whole file.
        path: String,
        /// What is wrong there.
        message: String,
    },
    /// Generators without a compact Dirichlet domain.
    #[error("{name}: {reason}")]
    Group {
        /// The file.
        name: String,
        /// Why.
        reason: DirichletError,
    },
    /// A gluing that does not close.
    #[error("{name}: {reason}")]
    Open {
        /// The file.
        name: String,
        /// The face or edge, and what is wrong with it.
        reason: CheckError,
    },
}

/// Reads a gluing file.
///
/// # Errors
/// A file that cannot be read, is no gluing or does not close.
pub fn read(path: &Path) -> Result<Space, GluingError> {
    let name = path.display().to_string();
    let unreadable = |reason: String| GluingError::Unreadable { name: name.clone(), reason };
    let size = std::fs::metadata(path).map_err(|e| unreadable(e.to_string()))?.len();
    if size > MAX_BYTES {
        return Err(unreadable(format!("{size} bytes are more than the {MAX_BYTES} that a gluing may have")));
    }
    let bytes = std::fs::read(path).map_err(|e| unreadable(e.to_string()))?;
    let text = String::from_utf8(bytes).map_err(|e| {
        let good = &e.as_bytes()[..e.utf8_error().valid_up_to()];
        let line = good.iter().filter(|&&b| b == b'\n').count() + 1;
        let column = good.iter().rev().take_while(|&&b| b != b'\n').count() + 1;
        GluingError::Syntax { name: name.clone(), line, column, message: "not UTF-8".to_owned() }
    })?;
    parse(&text, &name)
}

/// The space described by the text of a gluing file. The name is for messages, and becomes the space's name.
///
/// # Errors
/// A text that is no gluing or does not close.
pub fn parse(text: &str, name: &str) -> Result<Space, GluingError> {
    let value = serde_json::from_str(text).map_err(|e| {
        let message = e.to_string();
        let message = message.rsplit_once(" at line ").map_or(message.as_str(), |(what, _)| what).to_owned();
        GluingError::Syntax { name: name.to_owned(), line: e.line(), column: e.column(), message }
    })?;
    let Groundwork { geometry, content } = json::groundwork(&value).map_err(|fault| {
        let path = if fault.path.is_empty() { fault.path } else { fault.path + ": " };
        GluingError::Content { name: name.to_owned(), path, message: fault.message }
    })?;

    let group = |reason| GluingError::Group { name: name.to_owned(), reason };
    let cells = match content {
        Content::Cells(cells) => visit(geometry, UnitPlanes(cells)),
        Content::Generators(generators) => vec![dirichlet::domain(geometry, &generators).map_err(group)?],
    };
    let space = Space { name: name.to_owned(), geometry, cells };
    check::check(&space).map_err(|reason| GluingError::Open { name: name.to_owned(), reason })?;
    Ok(space)
}

/// The explicit form of a space, with every number in full: reading it back gives the same space.
pub fn to_json(space: &Space) -> String {
    // `{:?}` of a float is the shortest text that reads back as the same number, at most 17 digits.
    let numbers = |v: DVec4| format!("{:?}", v.to_array());
    let mut text = format!("{{\"geometry\": \"{}\", \"cells\": [", space.geometry.name());
    for (c, cell) in space.cells.iter().enumerate() {
        text += if c == 0 { "\n{\"faces\": [" } else { ",\n{\"faces\": [" };
        for (f, face) in cell.faces.iter().enumerate() {
            let rows: Vec<String> = (0..4).map(|i| numbers(face.pairing.linear.row(i))).collect();
            // Writing to a string cannot fail.
            let _ = write!(
                text,
                "{}\n  {{\"plane\": {}, \"pair\": {{\"cell\": {}, \"face\": {}}},\n   \"matrix\": [{}]",
                if f == 0 { "" } else { "," },
                numbers(face.plane),
                face.partner.cell,
                face.partner.face,
                rows.join(", ")
            );
            if face.pairing.shift != DVec4::ZERO {
                let _ = write!(text, ", \"shift\": {}", numbers(face.pairing.shift));
            }
            text.push('}');
        }
        text += "]}";
    }
    text += "]}\n";
    text
}

/// Scales planes so that their affine form grows at unit rate along the metric's normal: the scale in which
/// rays judge how far outside of a face they are.
struct UnitPlanes(Vec<Cell>);

impl Visitor for UnitPlanes {
    type Output = Vec<Cell>;
    fn visit<G: Geometry>(self, geometry: G) -> Vec<Cell> {
        let mut cells = self.0;
        cells.iter_mut().flat_map(|cell| &mut cell.faces).for_each(|face: &mut Face| {
            let normal = face.plane.xyz();
            let foot = normal * (-face.plane.w / normal.length_squared());
            // The form is that of the chart times a factor, which is the form's own where the chart's is 1.
            let rate = geometry.unchart(foot).map(|p| {
                let factor = geometry.side(p, face.plane + DVec4::W);
                factor * normal.dot(geometry.chart_vector(p, geometry.raise(p, normal)))
            });
            // Planes of the right scale keep their digits; those that miss the chart are left to the check.
            if let Some(rate) = rate.filter(|r| *r > 0.0 && r.is_finite() && (r - 1.0).abs() > 1e-12) {
                face.plane /= rate;
            }
        });
        cells
    }
}
