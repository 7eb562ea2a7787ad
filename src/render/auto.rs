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

/// Takes the fastest backend that can carry out the plan: compute on a GPU; on a software device compute as well,
/// which the README's table shows to be the faster of the two; the CPU where there is no Vulkan.
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
    let software = context.info().kind == DeviceKind::Cpu;
    let backend = ComputeBackend::new(&context)?;
    Ok(match backend.check(plan) {
        Err(Missing(what)) => on_cpu(format!("{} lacks {what}", backend.device())),
        Ok(()) => {
            let why = if software { "software Vulkan, faster than the f64 cpu backend" } else { "a GPU" };
            Chosen { reason: format!("backend compute: {} ({why})", backend.device()), backend: Box::new(backend) }
        }
    })
}
