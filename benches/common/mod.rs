//! What the benches share.

use holonomy::{
    render::{Backend, compute::ComputeBackend, cpu::CpuBackend, rt::RtBackend},
    vulkan::{Context, ContextOptions, Tier, VulkanError},
};

/// The backends of this machine; one that is missing is named.
pub fn backends() -> Vec<Box<dyn Backend>> {
    let mut backends: Vec<Box<dyn Backend>> = vec![Box::new(CpuBackend::default())];
    let open = |tier| Context::new(&ContextOptions { tier, ..ContextOptions::from_env()? });
    let compute =
        || -> Result<Box<dyn Backend>, VulkanError> { Ok(Box::new(ComputeBackend::new(&open(Tier::Compute)?)?)) };
    let rt = || -> Result<Box<dyn Backend>, VulkanError> { Ok(Box::new(RtBackend::new(&open(Tier::Rt)?)?)) };
    for (name, device) in [("compute", compute()), ("rt", rt())] {
        match device {
            Ok(backend) => backends.push(backend),
            Err(error) => eprintln!("skipped: {name}: {error}"),
        }
    }
    backends
}
