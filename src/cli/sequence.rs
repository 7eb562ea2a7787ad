//! Sequences of pictures along a scene's camera path, and of its objects in motion: which pictures, under which names, seen from where.

use super::{Failure, Outcome};
use crate::{
    geometry::{Geometry, Visitor, visit},
    scene::Scene,
    space::{
        domain::Domain,
        observer::{Frame, pose_on_path},
        reduce::TransportError,
    },
};
use anyhow::anyhow;
use std::{
    ops::Range,
    path::{Path, PathBuf},
};

/// `FIRST..END`, END not included.
pub(super) fn parse_range(text: &str) -> Result<Range<u32>, String> {
    let form = || String::from("expected FIRST..END, such as 0..48 for the pictures 0 to 47");
    let (first, end) = text.split_once("..").ok_or_else(form)?;
    let number = |text: &str| text.parse::<u32>().map_err(|_| form());
    let range = number(first)?..number(end)?;
    if range.is_empty() { Err(format!("there is no picture in {text}: END is not included")) } else { Ok(range) }
}

/// File names with the picture's number in them.
pub(super) struct Pattern {
    folder: PathBuf,
    before: String,
    width: usize,
    after: String,
}

impl Pattern {
    /// Takes `{frame}`, or `{frame:04}` for four digits with zeros in front, out of a file name.
    pub fn new(path: &Path) -> Result<Self, Failure> {
        let refuse = |why: &str| Failure::refused(anyhow!("{}: {why}", path.display()));
        let wanted = "with --frames the file name needs {frame} or {frame:04} once, for the number of the picture";
        let name = path.file_name().and_then(|name| name.to_str()).ok_or_else(|| refuse(wanted))?;
        let (before, rest) = name.split_once('{').ok_or_else(|| refuse(wanted))?;
        let (inside, after) = rest.split_once('}').ok_or_else(|| refuse(wanted))?;
        let width = match inside.strip_prefix("frame") {
            Some("") => Some(1),
            Some(digits) => digits.strip_prefix(":0").and_then(|d| d.parse().ok()).filter(|w| (1..=9).contains(w)),
            None => None,
        };
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        let one = |text: &str| !text.contains(['{', '}']);
        match width {
            Some(width) if one(before) && one(after) && one(&folder.to_string_lossy()) => {
                Ok(Self { folder, before: before.to_owned(), width, after: after.to_owned() })
            }
            _ => Err(refuse(wanted)),
        }
    }

    /// The name of a picture.
    pub fn path(&self, number: u32) -> PathBuf {
        let Self { folder, before, width, after } = self;
        folder.join(format!("{before}{number:0width$}{after}"))
    }
}

/// Refuses pictures that the scene's path does not have.
pub(super) fn check_range(scene: &Scene, range: &Range<u32>) -> Outcome {
    let last: u64 = scene.path.iter().map(|leg| u64::from(leg.frames)).sum();
    let in_motion = scene.objects.iter().any(|object| object.motion.is_some());
    if scene.path.is_empty() {
        let wanted = "--frames needs a camera path ([[observer.path]]) or an object with motion";
        return if in_motion { Ok(()) } else { Err(Failure::refused(anyhow!("{}: {wanted}", scene.name))) };
    }
    if u64::from(range.end - 1) > last {
        let asked = range.end - 1;
        return Err(Failure::refused(anyhow!(
            "--frames: the path of {} ends with picture {last}, not {asked}",
            scene.name
        )));
    }
    Ok(())
}

/// Where the observer is at a picture of the scene's path.
pub(super) fn pose(scene: &Scene, number: u32) -> Result<Frame, Failure> {
    struct Pose<'a>(&'a Scene, u32);
    impl Visitor for Pose<'_> {
        type Output = Result<Frame, TransportError>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let Self(scene, number) = self;
            pose_on_path(geometry, &Domain::new(&scene.space), scene.observer.frame, &scene.path, number)
        }
    }
    visit(scene.space.geometry, Pose(scene, number)).map_err(Failure::refused)
}
