//! Batches: one JSON object per line in, one line out.

use super::{Failure, print_line};
use anyhow::Context;
use serde_json::{Value, json};
use std::{
    fs::File,
    io::{BufRead, BufReader, BufWriter, ErrorKind, Write, stdin, stdout},
    path::Path,
};

/// Lines that are worked on together; enough for a device to be busy, few enough to stream.
const CHUNK: usize = 16_384;

/// Reads lines from `path` (`-` is stdin) and writes what `work` makes of each chunk; refused lines are
/// `{"error": ...}`. Empty lines are passed over.
///
/// # Errors
/// The file cannot be read, or `work` failed as a whole.
pub fn run(
    path: &Path,
    mut work: impl FnMut(Vec<Result<Value, String>>) -> Result<Vec<Result<Value, String>>, Failure>,
) -> Result<(), Failure> {
    let reader: Box<dyn BufRead> = if path == Path::new("-") {
        Box::new(BufReader::new(stdin()))
    } else {
        let file = File::open(path).with_context(|| path.display().to_string()).map_err(Failure::Refused)?;
        Box::new(BufReader::new(file))
    };
    let mut out = BufWriter::new(stdout().lock());
    let mut chunk = Vec::new();
    // Bytes, so that a line that is no text is refused alone.
    let mut lines = reader.split(b'\n').enumerate().peekable();
    while let Some((number, line)) = lines.next() {
        let line = line.with_context(|| path.display().to_string()).map_err(Failure::Refused)?;
        if !line.trim_ascii().is_empty() {
            chunk.push(serde_json::from_slice(&line).map_err(|error| {
                let (message, column) = (error.to_string(), error.column());
                // serde_json's own place counts lines within the line.
                let message = message.rsplit_once(" at line ").map_or(message.as_str(), |(what, _)| what);
                format!("line {}, column {column}: no JSON object: {message}", number + 1)
            }));
        }
        if chunk.len() == CHUNK || (lines.peek().is_none() && !chunk.is_empty()) {
            for result in work(std::mem::take(&mut chunk))? {
                let value = result.unwrap_or_else(|error| json!({ "error": error }));
                if !print_line(&mut out, &value.to_string())? {
                    return Ok(());
                }
            }
        }
    }
    match out.flush() {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        result => result.context("standard output").map_err(Failure::Failed),
    }
}

/// A case's fields, with every unknown, missing or wrong one named.
pub struct Case<'a>(&'a serde_json::Map<String, Value>);

impl<'a> Case<'a> {
    /// The object, if it has no keys but `known`.
    pub fn new(value: &'a Value, known: &[&str]) -> Result<Self, String> {
        let object = value.as_object().ok_or_else(|| format!("expected an object with {}", known.join(", ")))?;
        match object.keys().find(|key| !known.contains(&key.as_str())) {
            Some(key) => Err(format!("unknown key {key:?}; known are {}", known.join(", "))),
            None => Ok(Self(object)),
        }
    }

    fn get(&self, key: &str) -> Result<&'a Value, String> {
        self.0.get(key).ok_or_else(|| format!("{key} is missing"))
    }

    /// A finite number.
    pub fn number(&self, key: &str) -> Result<f64, String> {
        let number = self.get(key)?.as_f64().ok_or_else(|| format!("{key} must be a number"))?;
        if number.is_finite() { Ok(number) } else { Err(format!("{key} must be finite")) }
    }

    /// A list of finite numbers.
    pub fn vector(&self, key: &str) -> Result<Vec<f64>, String> {
        let list = self.get(key)?.as_array().ok_or_else(|| format!("{key} must be a list of numbers"))?;
        let numbers = list.iter().map(|x| x.as_f64().filter(|x| x.is_finite())).collect::<Option<Vec<_>>>();
        numbers.ok_or_else(|| format!("{key} must hold finite numbers"))
    }

    /// A string.
    pub fn text(&self, key: &str) -> Result<&'a str, String> {
        self.get(key)?.as_str().ok_or_else(|| format!("{key} must be a string"))
    }
}
