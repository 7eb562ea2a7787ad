//! What can go wrong between the program and a headset.

use super::lifecycle::SessionState;
use crate::{render::RenderError, vulkan::VulkanError};

/// A session that could not be had, or came to a bad end.
#[derive(Debug, thiserror::Error)]
pub enum XrError {
    /// No library libopenxr_loader.
    #[error("no OpenXR: {0}")]
    NoLoader(String),
    /// The loader finds no runtime that works.
    #[error("no OpenXR runtime: {0}")]
    NoRuntime(String),
    /// The runtime has no headset.
    #[error("the OpenXR runtime {0} has no headset")]
    NoHeadset(String),
    /// The runtime cannot do what is needed.
    #[error("the OpenXR runtime {runtime} lacks {lacking}")]
    Lacks {
        /// Name of the runtime.
        runtime: String,
        /// What it lacks.
        lacking: String,
    },
    /// The headset does not want pictures.
    #[error("the headset is asleep: for {seconds} s the session has been {}", state.name())]
    Asleep {
        /// State of the session.
        state: SessionState,
        /// How long nothing was drawn.
        seconds: u64,
    },
    /// The session is lost, as when the headset is unplugged.
    #[error("the headset session was lost after {frames} frames")]
    SessionLost {
        /// Frames that were drawn.
        frames: u32,
    },
    /// The runtime is gone.
    #[error("the OpenXR runtime is gone after {frames} frames ({call})")]
    RuntimeGone {
        /// Frames that were drawn.
        frames: u32,
        /// The call that found out.
        call: &'static str,
    },
    /// The runtime ended the session before all frames were drawn.
    #[error("the runtime ended the session after {drawn} of {wanted} frames")]
    EndedEarly {
        /// Frames that were drawn.
        drawn: u32,
        /// Frames that were asked for.
        wanted: u32,
    },
    /// The runtime was asked to end the session and does not.
    #[error("the runtime does not end the session, which is {} for {seconds} s", state.name())]
    NoExit {
        /// State of the session.
        state: SessionState,
        /// How long it was waited for.
        seconds: u64,
    },
    /// A call failed.
    #[error("{call}: {result}")]
    Call {
        /// The call.
        call: &'static str,
        /// Its result, in the specification's words.
        result: String,
    },
    /// A call waited for the runtime for longer than is allowed.
    #[error("{0}: the runtime does not answer")]
    TimeOut(&'static str),
    /// The device failed.
    #[error(transparent)]
    Render(#[from] RenderError),
    /// The scene cannot be drawn.
    #[error(transparent)]
    World(#[from] crate::render::world::WorldError),
    /// The body left the space.
    #[error(transparent)]
    Transport(#[from] crate::space::reduce::TransportError),
}

impl From<VulkanError> for XrError {
    fn from(error: VulkanError) -> Self {
        Self::Render(RenderError::Vulkan(error))
    }
}

impl XrError {
    /// The same after so many frames, for errors that say so.
    #[must_use]
    pub fn after(self, frames: u32) -> Self {
        match self {
            Self::SessionLost { .. } => Self::SessionLost { frames },
            Self::RuntimeGone { call, .. } => Self::RuntimeGone { frames, call },
            other => other,
        }
    }
}
