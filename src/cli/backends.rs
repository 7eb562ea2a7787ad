//! Backends that the user names.

use super::{BackendChoice, Failure};
use crate::{
    measure::MeasureError,
    render::{
        Backend, RenderError,
        compute::ComputeBackend,
        cpu::CpuBackend,
        rt::{RtBackend, RtOptions},
    },
    vulkan::{Context, ContextOptions, Tier, VulkanError},
};
use std::sync::Arc;

/// A way to draw, with its device open.
#[derive(Clone)]
pub(super) enum Opened {
    Cpu,
    Compute(Arc<Context>),
    Rt(Arc<Context>),
}

impl Opened {
    /// Opens the device of a choice; none for `auto`, which depends on what is to be drawn.
    pub(super) fn new(choice: BackendChoice) -> Result<Option<Self>, Failure> {
        let context = |tier| {
            let options = ContextOptions { tier, ..ContextOptions::from_env().map_err(Failure::vulkan)? };
            Context::new(&options).map_err(Failure::vulkan)
        };
        Ok(Some(match choice {
            BackendChoice::Auto => return Ok(None),
            BackendChoice::Cpu => Self::Cpu,
            BackendChoice::Compute => Self::Compute(context(Tier::Compute)?),
            BackendChoice::Rt => Self::Rt(context(Tier::Rt)?),
        }))
    }

    /// Those of the choices that are there, in this order, and why others are not.
    pub(super) fn available(choices: &[BackendChoice]) -> (Vec<Self>, Vec<(BackendChoice, Failure)>) {
        let (mut there, mut missing) = (Vec::new(), Vec::new());
        for &choice in choices {
            match Self::new(choice) {
                Ok(opened) => there.extend(opened),
                Err(reason) => missing.push((choice, reason)),
            }
        }
        (there, missing)
    }

    /// Name on the command line.
    pub(super) fn name(&self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Compute(_) => "compute",
            Self::Rt(_) => "rt",
        }
    }

    /// A backend on the device.
    pub(super) fn backend(&self) -> Result<Box<dyn Backend>, Failure> {
        self.with_options(RtOptions::default())
    }

    /// The same with choices for `rt`.
    pub(super) fn with_options(&self, options: RtOptions) -> Result<Box<dyn Backend>, Failure> {
        self.make(options).map_err(Failure::failed)
    }

    /// The same with the error of the device.
    pub(super) fn make(&self, options: RtOptions) -> Result<Box<dyn Backend>, VulkanError> {
        Ok(match self {
            Self::Cpu => Box::new(CpuBackend::default()),
            Self::Compute(context) => Box::new(ComputeBackend::new(context)?),
            Self::Rt(context) => Box::new(RtBackend::with_options(context, options)?),
        })
    }
}

/// What cannot be drawn because of the input was refused, anything else failed.
pub(super) fn render_failure(error: RenderError) -> Failure {
    match error {
        RenderError::TooLarge { .. }
        | RenderError::Vulkan(VulkanError::Recursion { .. } | VulkanError::TooMany { .. }) => Failure::refused(error),
        RenderError::NothingLoaded | RenderError::Vulkan(_) => Failure::failed(error),
    }
}

/// The same for what could not be measured.
pub(super) fn measure_failure(error: MeasureError) -> Failure {
    match error {
        MeasureError::Render(error) => render_failure(error),
        MeasureError::World(error) => Failure::refused(error),
        MeasureError::Eyes(error) => Failure::refused(error),
        error @ (MeasureError::Vulkan(_) | MeasureError::Plot(..)) => Failure::failed(error),
    }
}
