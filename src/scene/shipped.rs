//! The scenes that come with the program: every file under `scenes/`, embedded by the build script.

/// Path under `scenes/` and contents.
const ASSETS: &[(&str, &[u8])] = include!(concat!(env!("OUT_DIR"), "/assets.rs"));

/// Names of the shipped scenes, in alphabetical order. The scene of a named space has the space's name.
pub fn names() -> impl Iterator<Item = &'static str> {
    ASSETS.iter().filter_map(|(path, _)| path.strip_suffix(".toml")).filter(|name| !name.contains('/'))
}

/// The text of the shipped scene with this name.
pub fn find(name: &str) -> Option<&'static [u8]> {
    asset(&format!("{name}.toml")).filter(|_| !name.contains('/'))
}

/// The embedded file with this path under `scenes/`.
pub fn asset(path: &str) -> Option<&'static [u8]> {
    ASSETS.iter().find(|(known, _)| *known == path).map(|(_, bytes)| *bytes)
}

/// Names of the shipped scenes that the book measures.
pub fn of_the_book() -> impl Iterator<Item = &'static str> {
    let list = asset("book.list").and_then(|bytes| std::str::from_utf8(bytes).ok()).unwrap_or_default();
    list.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'))
}
