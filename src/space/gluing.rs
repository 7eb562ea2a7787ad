//! To come.

use super::Space;
use std::path::Path;

/// Why a gluing was refused.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{0}")]
pub struct GluingError(String);

/// Reads a gluing file.
///
/// # Errors
/// Always, for now.
pub fn read(path: &Path) -> Result<Space, GluingError> {
    Err(GluingError(format!("{}: gluing files are not available yet", path.display())))
}
