//! The folder that a scene's files come from: one on disk, or the one that is embedded in the program.
//!
//! A scene is untrusted, so it may name files in its own folder tree only: no absolute paths, no `..` that climbs
//! out, and no symbolic link that points out (paths are compared after all links are followed).

use super::shipped;
use std::{
    borrow::Cow,
    fs::{self, File},
    io::{self, Read},
    path::{Component, Path, PathBuf},
};

/// Largest file that a scene may name, in bytes.
pub const MAX_FILE_SIZE: u64 = 1 << 30;

/// Where the files of a scene are.
#[derive(Clone, Debug, PartialEq)]
pub enum Folder {
    /// A folder on disk; the path is canonical.
    Disk(PathBuf),
    /// The scenes that come with the program.
    Embedded,
}

/// Why a file that a scene names was not read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FolderError {
    /// The path starts at the root of a file system.
    #[error("{0}: the path is absolute: paths are relative to the scene's folder")]
    Absolute(String),
    /// The path leads out of the folder, by `..` or by a symbolic link.
    #[error("{0}: the path leaves the scene's folder")]
    Leaves(String),
    /// Nothing is there.
    #[error("{0}: no such file")]
    Missing(String),
    /// A folder or a device.
    #[error("{0}: not a plain file")]
    NotAFile(String),
    /// More than [`MAX_FILE_SIZE`].
    #[error("{0}: {1} bytes, at most {MAX_FILE_SIZE} are read")]
    TooLarge(String, u64),
    /// Anything else that the system says.
    #[error("{0}: {1}")]
    Io(String, String),
}

impl Folder {
    /// The folder of a scene file.
    ///
    /// # Errors
    /// What the system says of the folder.
    pub fn of(scene: &Path) -> io::Result<Self> {
        let parent = scene.parent().filter(|parent| *parent != Path::new("")).unwrap_or(Path::new("."));
        Ok(Self::Disk(parent.canonicalize()?))
    }

    /// The contents of a file in the folder.
    ///
    /// # Errors
    /// [`FolderError`] with the path as the scene gives it.
    pub fn read(&self, relative: &str) -> Result<Cow<'static, [u8]>, FolderError> {
        match self {
            Self::Embedded => {
                let path = normalise(relative)?;
                let asset = path.to_str().and_then(shipped::asset);
                asset.map(Cow::Borrowed).ok_or_else(|| FolderError::Missing(relative.to_owned()))
            }
            Self::Disk(_) => {
                let path = self.path(relative)?;
                let io = |e: io::Error| FolderError::Io(relative.to_owned(), e.to_string());
                let file = File::open(path).map_err(io)?;
                let mut bytes = Vec::new();
                // The limit holds even if the file grows after `path` looked at it.
                file.take(MAX_FILE_SIZE).read_to_end(&mut bytes).map_err(io)?;
                Ok(Cow::Owned(bytes))
            }
        }
    }

    /// Where a file of the folder is on disk.
    ///
    /// # Errors
    /// [`FolderError`] with the path as the scene gives it; embedded files are nowhere on disk.
    pub fn path(&self, relative: &str) -> Result<PathBuf, FolderError> {
        let normal = normalise(relative)?;
        let missing = || FolderError::Missing(relative.to_owned());
        let Self::Disk(root) = self else { return Err(missing()) };
        let io = |e: io::Error| match e.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => missing(),
            _ => FolderError::Io(relative.to_owned(), e.to_string()),
        };
        let path = root.join(normal).canonicalize().map_err(io)?;
        if !path.starts_with(root) {
            return Err(FolderError::Leaves(relative.to_owned()));
        }
        let metadata = fs::metadata(&path).map_err(io)?;
        if !metadata.is_file() {
            return Err(FolderError::NotAFile(relative.to_owned()));
        }
        if metadata.len() > MAX_FILE_SIZE {
            return Err(FolderError::TooLarge(relative.to_owned(), metadata.len()));
        }
        Ok(path)
    }
}

/// The path of a file that `file` names relative to itself, relative to the folder of the scene.
pub(super) fn beside(file: &str, relative: &str) -> String {
    match file.rsplit_once('/') {
        // An absolute path stays one, so that it is refused as such.
        Some((folder, _)) if !relative.starts_with('/') => format!("{folder}/{relative}"),
        _ => relative.to_owned(),
    }
}

/// The path without `.` and `..`, if it stays inside.
fn normalise(relative: &str) -> Result<PathBuf, FolderError> {
    let mut normal = PathBuf::new();
    for component in Path::new(relative).components() {
        match component {
            Component::Prefix(_) | Component::RootDir => return Err(FolderError::Absolute(relative.to_owned())),
            Component::CurDir => {}
            Component::ParentDir => {
                if !normal.pop() {
                    return Err(FolderError::Leaves(relative.to_owned()));
                }
            }
            Component::Normal(name) => normal.push(name),
        }
    }
    Ok(normal)
}
