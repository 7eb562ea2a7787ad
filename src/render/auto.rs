//! Choice of the backend.

use super::{Backend, Missing, compute::ComputeBackend, cpu::CpuBackend, plan::Plan, rt::RtBackend};
use crate::vulkan::{
    self, Context, DeviceInfo, Tier, VulkanError,
    options::{ContextOptions, Validation},
};

/// A backend, and why it was taken.
pub struct Chosen {
    /// The backend.
    pub backend: Box<dyn Backend>,
    /// One line for the user.
    pub reason: String,
}

/// Takes the fastest backend that can carry out the plan: ray tracing on a GPU that has it in hardware, else compute on a GPU,
/// else the CPU. A driver that offers pipelines for ray tracing without ray queries traces by shaders of its own, which the
/// README's figures of an NVIDIA H100 show to be slower than ours. Software Vulkan runs both device backends as well, but the
/// README's table shows them to be slower than the CPU backend on the same cores; they are taken only where the user names the
/// device.
///
/// A GPU that turns out to be unusable is no reason to fail: the next backend is tried, and the reason says so.
///
/// # Errors
/// `HOLONOMY_DEVICE` names no device, or validation is asked for and absent: what a user asks for by name is not
/// replaced in silence.
pub fn choose(plan: &Plan) -> Result<Chosen, VulkanError> {
    choose_with(&ContextOptions::from_env()?, plan)
}

/// The same with options for the device; their tier is not looked at.
///
/// # Errors
/// As [`choose`].
pub fn choose_with(options: &ContextOptions, plan: &Plan) -> Result<Chosen, VulkanError> {
    let on_cpu =
        |why: String| Chosen { backend: Box::new(CpuBackend::default()), reason: format!("backend cpu: {why}") };
    let by_name = options.device.is_some() || options.validation != Validation::Off;
    let devices = match vulkan::devices(options) {
        Ok(devices) => devices,
        Err(error) if !by_name => return Ok(on_cpu(format!("no Vulkan device can be used ({error})"))),
        Err(error) => return Err(error),
    };
    if options.device.is_none() && devices.iter().all(DeviceInfo::is_software) {
        let names: Vec<&str> = devices.iter().map(|device| device.name.as_str()).collect();
        return Ok(on_cpu(format!("faster than software Vulkan, and there is no GPU ({})", names.join(", "))));
    }
    let mut failures = Vec::new();
    for tier in [Tier::Rt, Tier::Compute] {
        let options = ContextOptions { tier, ..options.clone() };
        // Software that can trace must not win over a GPU that cannot.
        let usable = |device: &DeviceInfo| device.can(tier) && (options.device.is_some() || !device.is_software());
        if options.device.is_none() && !devices.iter().any(usable) {
            continue;
        }
        match open(&options) {
            Ok(None) => failures.push("rt is slower there, as the driver traces without hardware".to_owned()),
            Ok(Some(backend)) => match backend.check(plan) {
                Ok(()) => {
                    let mut reason = format!("backend {}: {}", backend.name(), backend.device());
                    if !failures.is_empty() {
                        reason += &format!(" (because {})", failures.join("; "));
                    }
                    return Ok(Chosen { backend, reason });
                }
                Err(Missing(what)) => failures.push(format!("{} lacks {what}", backend.device())),
            },
            // A mistyped name stays a mistake.
            Err(error @ VulkanError::UnknownDevice { .. }) => return Err(error),
            Err(error) => failures.push(error.to_string()),
        }
    }
    Ok(on_cpu(failures.join("; ")))
}

/// The backend of a tier; none for ray tracing that is not in hardware.
fn open(options: &ContextOptions) -> Result<Option<Box<dyn Backend>>, VulkanError> {
    let context = Context::new(options)?;
    Ok(match options.tier {
        Tier::Rt if !context.info().rt().queries => None,
        Tier::Rt => Some(Box::new(RtBackend::new(&context)?)),
        Tier::Compute => Some(Box::new(ComputeBackend::new(&context)?)),
    })
}
