//! To come.

use super::Space;

/// What is known of a space.
#[derive(Debug, serde::Serialize)]
pub struct Report {}

impl std::fmt::Display for Report {
    fn fmt(&self, _: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        Ok(())
    }
}

/// To come.
#[derive(Debug, thiserror::Error)]
#[error("to come")]
pub struct CheckError;

/// To come.
///
/// # Errors
/// Always.
pub fn check(_: &Space) -> Result<Report, CheckError> {
    Err(CheckError)
}
