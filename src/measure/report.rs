//! Results as JSON, CSV and terminal tables: columns with names and units, rows of texts and numbers.

use serde_json::{Map, Value, json};

/// Version of the layout of the JSON files.
pub const SCHEMA: u32 = 1;

/// A value in a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Cell {
    /// A word.
    Text(String),
    /// A number; what is not finite is empty in files.
    Number(f64),
    /// Nothing was measured.
    Empty,
}

impl From<&str> for Cell {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
}

impl From<String> for Cell {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<f64> for Cell {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<Option<f64>> for Cell {
    fn from(number: Option<f64>) -> Self {
        number.map_or(Self::Empty, Self::Number)
    }
}

impl Cell {
    /// The value in JSON.
    pub fn json(&self) -> Value {
        match self {
            Self::Text(text) => json!(text),
            // Whole numbers as such, up to where doubles hold them all.
            Self::Number(x) if x.trunc() == *x && x.abs() < 9e15 => json!(*x as i64),
            Self::Number(x) if x.is_finite() => json!(x),
            Self::Number(_) | Self::Empty => Value::Null,
        }
    }

    fn csv(&self) -> String {
        match self {
            Self::Text(text) if text.contains([',', '"', '\n']) => format!("\"{}\"", text.replace('"', "\"\"")),
            Self::Text(text) => text.clone(),
            Self::Number(x) if x.is_finite() => x.to_string(),
            Self::Number(_) | Self::Empty => String::new(),
        }
    }

    /// Three digits are enough to read.
    fn shown(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Empty => String::from("-"),
            Self::Number(x) if x.trunc() == *x && x.abs() < 1e5 => x.to_string(),
            Self::Number(x) if x.abs() >= 1e5 || x.abs() < 1e-2 => format!("{x:.1e}"),
            Self::Number(x) if x.abs() >= 100.0 => format!("{x:.0}"),
            Self::Number(x) => format!("{x:.3}"),
        }
    }
}

/// Rows under named columns.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Key in the JSON file, ending of the CSV file's name, heading on the terminal.
    pub name: String,
    /// What a row is.
    pub about: String,
    /// Names of columns, with units where they have some.
    pub columns: Vec<String>,
    /// As many values each as there are columns.
    pub rows: Vec<Vec<Cell>>,
}

impl Table {
    /// A table without rows.
    pub fn new(name: &str, about: &str, columns: &[&str]) -> Self {
        let columns = columns.iter().map(|c| (*c).to_owned()).collect();
        Self { name: name.to_owned(), about: about.to_owned(), columns, rows: Vec::new() }
    }

    /// Appends a row; what is missing of it is empty.
    pub fn push(&mut self, mut row: Vec<Cell>) {
        row.resize(self.columns.len(), Cell::Empty);
        self.rows.push(row);
    }

    /// The number in a row under a column; none if there is none.
    pub fn number(&self, row: &[Cell], column: &str) -> Option<f64> {
        let index = self.columns.iter().position(|name| name == column)?;
        match row.get(index) {
            Some(Cell::Number(x)) => Some(*x),
            _ => None,
        }
    }

    /// The table with some of its columns, told by their indices.
    pub fn only(&self, keep: impl Fn(usize) -> bool) -> Self {
        let of = |i: &usize| keep(*i);
        let indices: Vec<usize> = (0..self.columns.len()).filter(of).collect();
        Self {
            name: self.name.clone(),
            about: self.about.clone(),
            columns: indices.iter().map(|i| self.columns[*i].clone()).collect(),
            rows: self.rows.iter().map(|row| indices.iter().map(|i| row[*i].clone()).collect()).collect(),
        }
    }

    /// Rows as objects with the columns for keys.
    pub fn json(&self) -> Value {
        let object = |row: &Vec<Cell>| {
            let fields = self.columns.iter().cloned().zip(row.iter().map(Cell::json));
            Value::Object(fields.collect::<Map<_, _>>())
        };
        json!({ "about": self.about, "rows": self.rows.iter().map(object).collect::<Vec<_>>() })
    }

    /// Comma separated values under a line of names (RFC 4180).
    pub fn csv(&self) -> String {
        let lines = self.rows.iter().map(|row| row.iter().map(Cell::csv).collect::<Vec<_>>().join(","));
        let names = self.columns.iter().map(|c| Cell::Text(c.clone()).csv()).collect::<Vec<_>>().join(",");
        std::iter::once(names).chain(lines).map(|line| line + "\n").collect()
    }

    /// Columns aligned for reading: words to the left, numbers to the right.
    pub fn text(&self) -> String {
        let shown: Vec<Vec<String>> = self.rows.iter().map(|row| row.iter().map(Cell::shown).collect()).collect();
        let width = |i: usize| {
            let cells = shown.iter().map(|row| row[i].chars().count());
            cells.chain([self.columns[i].chars().count()]).max().unwrap_or(0)
        };
        let widths: Vec<usize> = (0..self.columns.len()).map(width).collect();
        let line = |cells: &[String], row: Option<&Vec<Cell>>| {
            let padded = cells.iter().enumerate().map(|(i, cell)| {
                let is_word = row.is_some_and(|row| matches!(row[i], Cell::Text(_)));
                if is_word { format!("{cell:<w$}", w = widths[i]) } else { format!("{cell:>w$}", w = widths[i]) }
            });
            padded.collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
        };
        let head = line(&self.columns, self.rows.first());
        let body: String = shown.iter().zip(&self.rows).map(|(cells, row)| line(cells, Some(row))).collect();
        format!("{}: {}\n{head}{body}", self.name, self.about)
    }
}

/// Tables with what they were measured on.
#[derive(Clone, Debug)]
pub struct Report {
    /// The command.
    pub command: String,
    /// Machine and settings.
    pub settings: Value,
    /// The tables.
    pub tables: Vec<Table>,
}

impl Report {
    /// One object with the schema's number, the settings and a key for each table.
    pub fn json(&self) -> Value {
        let mut object = Map::new();
        object.insert("schema".to_owned(), json!(SCHEMA));
        object.insert("command".to_owned(), json!(self.command));
        object.insert("settings".to_owned(), self.settings.clone());
        object.extend(self.tables.iter().map(|table| (table.name.clone(), table.json())));
        Value::Object(object)
    }
}
