//! Choice of the backend.

use super::{Backend, Missing, compute::ComputeBackend, cpu::CpuBackend, plan::Plan};
use crate::vulkan::{
    context::Context,
    options::{ContextOptions, Validation},
    tier::DeviceKind,
};

/// A backend, and why it was taken.
pub struct Chosen {
    /// The backend.
    pub backend: Box<dyn Backend>,
    /// One line for the user.
    pub reason: String,
}

/// Takes the fastest backend that can carry out the plan: compute on a GPU, else the CPU. Software Vulkan runs the
/// compute backend as well, but the README's table shows it to be slower than the CPU backend on the same cores.
///
/// # Errors
/// `HOLONOMY_DEVICE` names no device, or validation is asked for and absent: what a user asks for by name is not
/// replaced in silence.
pub fn choose(plan: &Plan) -> Result<Chosen, crate::vulkan::VulkanError> {
    let options = ContextOptions::from_env()?;
    let on_cpu =
        |why: String| Chosen { backend: Box::new(CpuBackend::default()), reason: format!("backend cpu: {why}") };
    let context = match Context::new(&options) {
        Ok(context) => context,
        Err(error) if options.device.is_none() && options.validation == Validation::Off => {
            return Ok(on_cpu(format!("no Vulkan device can be used ({error})")));
        }
        Err(error) => return Err(error),
    };
    if context.info().kind == DeviceKind::Cpu && options.device.is_none() {
        return Ok(on_cpu(format!("faster than software Vulkan, and there is no GPU ({})", context.info().name)));
    }
    let backend = ComputeBackend::new(&context)?;
    Ok(match backend.check(plan) {
        Err(Missing(what)) => on_cpu(format!("{} lacks {what}", backend.device())),
        Ok(()) => {
            let reason = format!("backend compute: {}", backend.device());
            Chosen { backend: Box::new(backend), reason }
        }
    })
}
