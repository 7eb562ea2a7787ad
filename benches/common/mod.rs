//! What the benches share.

use holonomy::{
    render::{Backend, compute::ComputeBackend, cpu::CpuBackend},
    vulkan::{Context, ContextOptions},
};

/// The backends of this machine; one that is missing is named.
pub fn backends() -> Vec<Box<dyn Backend>> {
    let mut backends: Vec<Box<dyn Backend>> = vec![Box::new(CpuBackend::default())];
    let device = ContextOptions::from_env().and_then(|o| Context::new(&o)).and_then(|c| ComputeBackend::new(&c));
    match device {
        Ok(compute) => backends.push(Box::new(compute)),
        Err(error) => eprintln!("skipped: compute: {error}"),
    }
    backends
}
