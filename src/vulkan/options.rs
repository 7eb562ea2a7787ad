//! How a context shall be made.

use super::{Tier, VulkanError, cache, fault::FaultInjection, instance::Messages};
use std::{env, ffi::CString, path::PathBuf, time::Duration};

/// How much the validation layer checks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Validation {
    /// The layer is not loaded.
    #[default]
    Off,
    /// Its standard checks.
    Core,
    /// Synchronization validation besides.
    Sync,
}

/// How a context shall be made.
#[derive(Clone, Debug, Default)]
pub struct ContextOptions {
    /// Index or part of the name of the device, in any case; by default the one that [`DeviceInfo::rank`] puts
    /// first.
    ///
    /// [`DeviceInfo::rank`]: super::DeviceInfo::rank
    pub device: Option<String>,
    /// How much is validated.
    pub validation: Validation,
    /// What the device must be able to do; its features are enabled.
    pub tier: Tier,
    /// Further instance extensions, for a window.
    pub instance_extensions: Vec<CString>,
    /// Further device extensions, for a window.
    pub device_extensions: Vec<CString>,
    /// How long a submission to a device that is not software may take; [`SUBMIT_TIME_OUT`](super::command::SUBMIT_TIME_OUT)
    /// if none.
    pub submit_time_out: Option<Duration>,
    /// Folder in which compiled pipelines are kept; none to keep none.
    pub cache_folder: Option<PathBuf>,
    /// Where the validation layer's messages go. Keep a clone to read what is said about a context that could not
    /// be made, or at its end.
    pub messages: Messages,
    /// Pretends that the device binds no more than this many bytes, for tests of large scenes and pictures.
    #[doc(hidden)]
    pub max_storage_range: Option<u64>,
    /// Faults on demand, for tests of error paths.
    #[doc(hidden)]
    pub faults: FaultInjection,
}

/// Picks a device by index or part of its name.
pub const DEVICE_VARIABLE: &str = "HOLONOMY_DEVICE";

/// Switches validation on.
pub const VALIDATION_VARIABLE: &str = "HOLONOMY_VALIDATION";

impl ContextOptions {
    /// What the environment says: [`DEVICE_VARIABLE`] picks a device, [`VALIDATION_VARIABLE`] is `0`, `1` or
    /// `sync`, [`CACHE_VARIABLE`](cache::CACHE_VARIABLE) says where compiled pipelines are kept.
    ///
    /// # Errors
    /// [`VulkanError::Variable`] if a variable has another value.
    pub fn from_env() -> Result<Self, VulkanError> {
        let read = |variable| env::var_os(variable).map(|v| v.to_string_lossy().into_owned()).filter(|v| !v.is_empty());
        let validation = match read(VALIDATION_VARIABLE) {
            None => Validation::Off,
            Some(value) => match value.as_str() {
                "0" => Validation::Off,
                "1" => Validation::Core,
                "sync" => Validation::Sync,
                _ => {
                    return Err(VulkanError::Variable { variable: VALIDATION_VARIABLE, value, known: "0, 1, sync" });
                }
            },
        };
        let cache_folder = cache::folder_from_env();
        Ok(Self { device: read(DEVICE_VARIABLE), validation, cache_folder, ..Self::default() })
    }
}
