//! Compiled pipelines, kept on disk from one run to the next.
//!
//! A file belongs to one build of one driver for one device, whose identity is in its name and at its head. A file that
//! is damaged, or whose head names another driver, is ignored and replaced; drivers are not trusted to notice. Files
//! are written under another name and renamed, so programs that run at the same time and programs that are killed leave
//! whole files.

use super::{VulkanError, tier::DeviceInfo};
use std::{
    env,
    fs::{self, File},
    io::{self, Read, Write},
    path::{Path, PathBuf},
};

/// The folder, or `off`.
pub const CACHE_VARIABLE: &str = "HOLONOMY_CACHE";

/// First bytes of a file; the digits are the version of the format.
const MAGIC: &[u8; 8] = b"HOLOPC01";

/// Bytes before the driver's data: magic, identity, length and checksum of the data.
const HEAD_BYTES: usize = MAGIC.len() + IDENTITY_BYTES + 8 + 4;

/// Bytes that name a driver's build for a device.
const IDENTITY_BYTES: usize = 4 + 4 + 4 + 16;

/// Larger data is neither read nor written: no program's pipelines take so much.
const MAX_BYTES: u64 = 256 << 20;

/// What was found when the device was opened.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Found {
    /// There is no folder to keep pipelines in.
    Off,
    /// There is no file.
    Absent,
    /// The file was given to the driver.
    Used,
    /// The file was not: why.
    Ignored(String),
}

impl std::fmt::Display for Found {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Off => f.write_str("off"),
            Self::Absent => f.write_str("absent"),
            Self::Used => f.write_str("used"),
            Self::Ignored(why) => write!(f, "ignored: {why}"),
        }
    }
}

/// The file of a device.
#[derive(Debug)]
pub struct CacheFile {
    /// None if nothing is kept.
    path: Option<PathBuf>,
    identity: [u8; IDENTITY_BYTES],
    found: Found,
    data: Vec<u8>,
}

/// The folder that the environment asks for: [`CACHE_VARIABLE`], else the user's folder for caches.
pub fn folder_from_env() -> Option<PathBuf> {
    let set = |name: &str| env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    if let Some(folder) = set(CACHE_VARIABLE) {
        return (folder.as_os_str() != "off").then_some(folder);
    }
    let caches = if cfg!(windows) {
        set("LOCALAPPDATA")
    } else if cfg!(target_os = "macos") {
        set("HOME").map(|home| home.join("Library/Caches"))
    } else {
        set("XDG_CACHE_HOME").filter(|p| p.is_absolute()).or_else(|| set("HOME").map(|home| home.join(".cache")))
    };
    Some(caches?.join("holonomy"))
}

impl CacheFile {
    /// Reads the file of a device in `folder`. Nothing that it holds is an error.
    pub fn open(folder: Option<&Path>, info: &DeviceInfo) -> Self {
        let identity = identity(info);
        let path = folder.map(|folder| {
            let name: String = identity.iter().map(|byte| format!("{byte:02x}")).collect();
            folder.join(format!("pipelines-{name}.bin"))
        });
        let (found, data) = match &path {
            None => (Found::Off, Vec::new()),
            Some(path) => match read(path, &identity) {
                Ok(data) => (Found::Used, data),
                Err(error) if error.kind() == io::ErrorKind::NotFound => (Found::Absent, Vec::new()),
                Err(error) => (Found::Ignored(error.to_string()), Vec::new()),
            },
        };
        Self { path, identity, found, data }
    }

    /// Data for the driver; empty if there is none.
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// What was found.
    pub fn found(&self) -> &Found {
        &self.found
    }

    /// Says that the driver would not take the data.
    pub fn reject(&mut self, why: String) {
        self.data.clear();
        self.found = Found::Ignored(why);
    }

    /// Whether [`Self::write`] would do anything.
    pub fn wants_data(&self) -> bool {
        self.path.is_some()
    }

    /// Writes the driver's data unless it is what was read.
    ///
    /// # Errors
    /// [`VulkanError::Cache`]: no space, no permission.
    pub fn write(&self, data: &[u8]) -> Result<(), VulkanError> {
        let Some(path) = &self.path else { return Ok(()) };
        if (self.found == Found::Used && data == self.data) || data.is_empty() || data.len() as u64 > MAX_BYTES {
            return Ok(());
        }
        let error = |cause: io::Error| VulkanError::Cache { path: path.clone(), cause: cause.to_string() };
        let folder = path.parent().unwrap_or(Path::new("."));
        fs::create_dir_all(folder).map_err(error)?;
        let mut file = tempfile::NamedTempFile::new_in(folder).map_err(error)?;
        let mut head = Vec::with_capacity(HEAD_BYTES);
        head.extend(MAGIC);
        head.extend(self.identity);
        head.extend((data.len() as u64).to_le_bytes());
        head.extend(crc32fast::hash(data).to_le_bytes());
        file.write_all(&head).map_err(error)?;
        file.write_all(data).map_err(error)?;
        file.persist(path).map_err(|e| error(e.error))?;
        Ok(())
    }
}

/// Vendor, device, driver version and the driver's own mark of its build.
fn identity(info: &DeviceInfo) -> [u8; IDENTITY_BYTES] {
    let found = &info.found;
    let mut bytes = [0; IDENTITY_BYTES];
    bytes[0..4].copy_from_slice(&found.vendor_id.to_le_bytes());
    bytes[4..8].copy_from_slice(&found.device_id.to_le_bytes());
    bytes[8..12].copy_from_slice(&found.driver_version.to_le_bytes());
    bytes[12..28].copy_from_slice(&found.cache_uuid);
    bytes
}

/// The data of a file that is whole and belongs to the driver.
fn read(path: &Path, identity: &[u8; IDENTITY_BYTES]) -> io::Result<Vec<u8>> {
    let bad = |why: &str| io::Error::new(io::ErrorKind::InvalidData, why);
    let mut file = File::open(path)?;
    if file.metadata()?.len() > MAX_BYTES + HEAD_BYTES as u64 {
        return Err(bad("the file is too large"));
    }
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes)?;
    let Some((head, data)) = bytes.split_at_checked(HEAD_BYTES) else { return Err(bad("the file is cut off")) };
    let rest = head.strip_prefix(MAGIC).ok_or_else(|| bad("the file is no pipeline cache of this version"))?;
    let rest = rest.strip_prefix(identity).ok_or_else(|| bad("the file belongs to another driver"))?;
    let (length, checksum) = rest.split_at(8);
    if length != (data.len() as u64).to_le_bytes() {
        return Err(bad("the file is cut off"));
    }
    if checksum != crc32fast::hash(data).to_le_bytes() {
        return Err(bad("the file is damaged"));
    }
    Ok(data.to_vec())
}
