//! A typed reader over TOML: every refusal names the file, the line and the column, what was expected and what was
//! found.
//!
//! A [`Table`] is opened with the keys that it may have, so that a misspelt key is reported before anything else;
//! keys are then taken one by one, and [`Table::finish`] reports those that nobody wanted.

use std::ops::Range;
use toml_edit::{ArrayOfTables, Item, TableLike};

/// Why a scene was refused, on one line.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// Something at a place in the scene's file.
    #[error("{path}:{line}:{column}: {message}")]
    At {
        /// The scene's file.
        path: String,
        /// Line, from 1.
        line: usize,
        /// Column in characters, from 1.
        column: usize,
        /// What is wrong.
        message: String,
    },
    /// The file as a whole.
    #[error("{path}: {message}")]
    File {
        /// The scene's file.
        path: String,
        /// What is wrong.
        message: String,
    },
    /// A gluing file, given in place of a scene.
    #[error(transparent)]
    Gluing(#[from] crate::space::gluing::GluingError),
}

impl SceneError {
    /// An error of the whole file.
    pub(super) fn file(path: &str, message: impl Into<String>) -> Self {
        Self::File { path: one_line(path), message: one_line(&message.into()) }
    }
}

/// Names and messages from outside may hold line breaks and control sequences; messages are one plain line.
pub(super) fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

/// The text that is read, for places in messages.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source<'a> {
    /// The file's name in messages.
    pub name: &'a str,
    /// Its contents.
    pub text: &'a str,
}

impl Source<'_> {
    /// An error at a byte of the text.
    pub fn error(&self, at: usize, message: impl Into<String>) -> SceneError {
        let before = self.text.get(..at).unwrap_or(self.text);
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |start| start.chars().count()) + 1;
        SceneError::At { path: one_line(self.name), line, column, message: one_line(&message.into()) }
    }
}

/// An interval of numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    low: f64,
    high: f64,
    low_open: bool,
    high_open: bool,
}

impl Bounds {
    /// All finite numbers.
    pub const ANY: Self = Self::closed(f64::MIN, f64::MAX);
    /// The unit interval.
    pub const UNIT: Self = Self::closed(0.0, 1.0);

    /// Ends included.
    pub const fn closed(low: f64, high: f64) -> Self {
        Self { low, high, low_open: false, high_open: false }
    }

    /// The upper end included.
    pub const fn above(low: f64, high: f64) -> Self {
        Self { low, high, low_open: true, high_open: false }
    }

    /// Ends excluded.
    pub const fn open(low: f64, high: f64) -> Self {
        Self { low, high, low_open: true, high_open: true }
    }

    fn contains(&self, x: f64) -> bool {
        let low = if self.low_open { x > self.low } else { x >= self.low };
        low && if self.high_open { x < self.high } else { x <= self.high }
    }
}

impl std::fmt::Display for Bounds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match (self.low_open, self.high_open) {
            (false, false) => write!(f, "{} to {}", self.low, self.high),
            (_, false) => write!(f, "above {}, at most {}", self.low, self.high),
            (_, true) => write!(f, "above {}, below {}", self.low, self.high),
        }
    }
}

/// A table being read.
pub(super) struct Table<'a> {
    source: Source<'a>,
    name: &'static str,
    at: usize,
    items: &'a dyn TableLike,
    taken: Vec<&'static str>,
}

impl<'a> Table<'a> {
    /// Opens a table that starts at a byte of the text, under a name for messages.
    ///
    /// # Errors
    /// The first key that is not among `keys`.
    pub fn open(
        source: Source<'a>,
        name: &'static str,
        at: usize,
        items: &'a dyn TableLike,
        keys: &[&'static str],
    ) -> Result<Self, SceneError> {
        for (key, item) in items.iter() {
            if !keys.contains(&key) {
                let place = name_or(name, "the scene");
                let message = format!("unknown key {key:?} in {place}: {}", suggestion(key, keys, "known keys"));
                return Err(source.error(key_start(items, key, item).unwrap_or(at), message));
            }
        }
        Ok(Self { source, name, at, items, taken: Vec::new() })
    }

    /// The value of a key.
    pub fn take(&mut self, key: &'static str) -> Option<Value<'a>> {
        self.taken.push(key);
        let item = self.items.get(key)?;
        let at = item.span().map(|span| span.start).or_else(|| key_start(self.items, key, item));
        Some(Value { source: self.source, what: key.to_owned(), at: at.unwrap_or(self.at), kind: Kind::Item(item) })
    }

    /// The value of a key that must be there.
    pub fn need(&mut self, key: &'static str) -> Result<Value<'a>, SceneError> {
        self.take(key).ok_or_else(|| self.error(format!("{} needs {key:?}", self.name)))
    }

    /// Whether the key is there.
    pub fn has(&self, key: &str) -> bool {
        self.items.contains_key(key)
    }

    /// Reports a key that was not taken, which has no meaning because of `why`.
    pub fn finish(self, why: &str) -> Result<(), SceneError> {
        match self.items.iter().find(|(key, _)| !self.taken.contains(key)) {
            None => Ok(()),
            Some((key, item)) => {
                let at = key_start(self.items, key, item).unwrap_or(self.at);
                Err(self.source.error(at, format!("{key:?} has no meaning {why}")))
            }
        }
    }

    /// An error at the start of the table.
    pub fn error(&self, message: impl Into<String>) -> SceneError {
        self.source.error(self.at, message)
    }
}

/// A value being read.
pub(super) struct Value<'a> {
    source: Source<'a>,
    /// The key, with the index of an element.
    what: String,
    at: usize,
    kind: Kind<'a>,
}

#[derive(Clone, Copy)]
enum Kind<'a> {
    Item(&'a Item),
    Value(&'a toml_edit::Value),
}

impl<'a> Value<'a> {
    /// An error at the value.
    pub fn error(&self, message: impl std::fmt::Display) -> SceneError {
        self.source.error(self.at, format!("{}: {message}", self.what))
    }

    /// The error that something else was expected.
    pub fn expected(&self, what: &str) -> SceneError {
        self.error(format!("expected {what}, found {}", self.found()))
    }

    /// What is there, in words.
    fn found(&self) -> String {
        use toml_edit::Value as V;
        match (self.kind, self.value()) {
            (_, Some(V::String(s))) => format!("the string {:?}", s.value()),
            (_, Some(V::Integer(i))) => i.value().to_string(),
            (_, Some(V::Float(x))) => x.value().to_string(),
            (_, Some(V::Boolean(b))) => b.value().to_string(),
            (_, Some(V::Datetime(_))) => "a date".to_owned(),
            (_, Some(V::Array(a))) => format!("an array of {}", a.len()),
            (_, Some(V::InlineTable(_))) | (Kind::Item(Item::Table(_)), _) => "a table".to_owned(),
            (Kind::Item(Item::ArrayOfTables(a)), _) => format!("an array of {} tables", a.len()),
            _ => "nothing".to_owned(),
        }
    }

    fn value(&self) -> Option<&'a toml_edit::Value> {
        match self.kind {
            Kind::Item(item) => item.as_value(),
            Kind::Value(value) => Some(value),
        }
    }

    /// A string.
    pub fn string(&self) -> Result<&'a str, SceneError> {
        self.value().and_then(|v| v.as_str()).ok_or_else(|| self.expected("a string"))
    }

    /// `true` or `false`.
    pub fn boolean(&self) -> Result<bool, SceneError> {
        self.value().and_then(|v| v.as_bool()).ok_or_else(|| self.expected("true or false"))
    }

    /// An integer between two limits, both included.
    pub fn integer(&self, low: u32, high: u32) -> Result<u32, SceneError> {
        let value = self.value().and_then(|v| v.as_integer()).ok_or_else(|| self.expected("an integer"))?;
        let in_range = u32::try_from(value).ok().filter(|v| (low..=high).contains(v));
        in_range.ok_or_else(|| self.error(format!("{value} is out of range: {low} to {high}")))
    }

    /// A finite number in an interval; integers count as numbers.
    pub fn number(&self, bounds: Bounds) -> Result<f64, SceneError> {
        let number = match self.value() {
            Some(toml_edit::Value::Float(x)) => *x.value(),
            Some(toml_edit::Value::Integer(i)) => *i.value() as f64,
            _ => return Err(self.expected("a number")),
        };
        if !number.is_finite() {
            return Err(self.expected("a finite number"));
        }
        if !bounds.contains(number) {
            return Err(self.error(format!("{number} is out of range: {bounds}")));
        }
        Ok(number)
    }

    /// The elements of an array.
    pub fn array(&self, expected: &str) -> Result<Vec<Value<'a>>, SceneError> {
        let array = self.value().and_then(|v| v.as_array()).ok_or_else(|| self.expected(expected))?;
        let element = |(i, value): (usize, &'a toml_edit::Value)| Value {
            source: self.source,
            what: format!("{}[{i}]", self.what),
            at: value.span().map_or(self.at, |span| span.start),
            kind: Kind::Value(value),
        };
        Ok(array.iter().enumerate().map(element).collect())
    }

    /// An array of so many numbers, `counts` being the accepted lengths.
    pub fn numbers(&self, counts: &[usize], bounds: Bounds) -> Result<Vec<f64>, SceneError> {
        let counts_text: Vec<String> = counts.iter().map(usize::to_string).collect();
        let expected = format!("an array of {} numbers", counts_text.join(" or "));
        let elements = self.array(&expected)?;
        if !counts.contains(&elements.len()) {
            return Err(self.expected(&expected));
        }
        elements.iter().map(|element| element.number(bounds)).collect()
    }

    /// A linear colour of `N` components: numbers, or a string `"#rrggbb"` (`"#rrggbbaa"`) in sRGB. Opacity is 1
    /// where it is not given.
    pub fn color<const N: usize>(&self, bounds: Bounds) -> Result<[f32; N], SceneError> {
        let mut color = [1.0; N];
        if let Some(text) = self.value().and_then(|v| v.as_str()) {
            let bytes = hex_bytes(text).filter(|bytes| bytes.len() == 3 || bytes.len() == N);
            let form = if N == 3 { "\"#rrggbb\"" } else { "\"#rrggbb\" or \"#rrggbbaa\"" };
            let bytes = bytes.ok_or_else(|| self.expected(&format!("a colour {form}")))?;
            for (i, byte) in bytes.into_iter().enumerate() {
                color[i] = if i < 3 { super::texture::linear_from_srgb(byte) } else { f32::from(byte) / 255.0 };
            }
            return Ok(color);
        }
        let counts: &[usize] = if N == 3 { &[3] } else { &[3, N] };
        if self.value().is_none_or(|v| !v.is_array()) {
            return Err(self.expected("a colour: an array of numbers or a string \"#rrggbb\""));
        }
        for (i, number) in self.numbers(counts, bounds)?.into_iter().enumerate() {
            color[i] = number as f32;
        }
        Ok(color)
    }

    /// One of several names.
    pub fn choice<T: Copy>(&self, choices: &[(&'static str, T)]) -> Result<T, SceneError> {
        let name = self.string()?;
        if let Some((_, chosen)) = choices.iter().find(|(known, _)| *known == name) {
            return Ok(*chosen);
        }
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        Err(self.error(format!("unknown value {name:?} (known: {})", names.join(", "))))
    }

    /// The table `[name]`.
    pub fn table(&self, name: &'static str, keys: &[&'static str]) -> Result<Table<'a>, SceneError> {
        let items = match self.kind {
            Kind::Item(item) => item.as_table_like(),
            Kind::Value(value) => value.as_inline_table().map(|table| table as &dyn TableLike),
        };
        Table::open(self.source, name, self.at, items.ok_or_else(|| self.expected(&format!("a table {name}")))?, keys)
    }

    /// The tables `[[name]]`, in order.
    pub fn tables(&self, name: &'static str, keys: &[&'static str]) -> Result<Vec<Table<'a>>, SceneError> {
        if let Kind::Item(Item::ArrayOfTables(tables)) = self.kind {
            return open_all(self.source, name, self.at, tables, keys);
        }
        let elements = self.array(&format!("tables {name}"))?;
        elements.iter().map(|element| element.table(name, keys)).collect()
    }
}

fn open_all<'a>(
    source: Source<'a>,
    name: &'static str,
    at: usize,
    tables: &'a ArrayOfTables,
    keys: &[&'static str],
) -> Result<Vec<Table<'a>>, SceneError> {
    let open = |table: &'a toml_edit::Table| {
        Table::open(source, name, table.span().map_or(at, |span: Range<usize>| span.start), table, keys)
    };
    tables.iter().map(open).collect()
}

/// First byte of a key; a table that is only implied by its children has no key of its own, but they do.
fn key_start(items: &dyn TableLike, key: &str, item: &Item) -> Option<usize> {
    items.key(key).and_then(|key| key.span()).or_else(|| item.span()).map(|span| span.start)
}

fn name_or<'a>(name: &'a str, default: &'a str) -> &'a str {
    if name.is_empty() { default } else { name }
}

/// `did you mean "color"?` where a known name is near, else all known names.
pub(super) fn suggestion<S: AsRef<str>>(name: &str, known: &[S], what: &str) -> String {
    let distance = |k: &S| strsim::damerau_levenshtein(name, k.as_ref());
    let nearest = known.iter().min_by_key(|k| distance(k));
    // A third of the letters may be wrong before the guess becomes noise.
    match nearest.filter(|k| distance(k) <= (name.chars().count().max(k.as_ref().chars().count()) / 3).max(1)) {
        Some(nearest) => format!("did you mean {:?}?", nearest.as_ref()),
        None => {
            let names: Vec<&str> = known.iter().map(AsRef::as_ref).collect();
            format!("{what}: {}", if names.is_empty() { "none".to_owned() } else { names.join(", ") })
        }
    }
}

/// The bytes of `#rrggbb`.
fn hex_bytes(text: &str) -> Option<Vec<u8>> {
    let digits = text.strip_prefix('#').filter(|d| d.len() % 2 == 0 && d.bytes().all(|b| b.is_ascii_hexdigit()))?;
    (0..digits.len()).step_by(2).map(|i| u8::from_str_radix(&digits[i..i + 2], 16).ok()).collect()
}
