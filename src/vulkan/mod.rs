//! To come.

/// Vulkan failed.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct VulkanError(pub String);
