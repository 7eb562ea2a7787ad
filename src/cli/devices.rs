//! `holonomy devices`: what this machine offers.

use super::{DevicesArgs, Failure, Outcome, print_line};
use crate::{
    view::xr,
    vulkan::{self, ContextOptions, DeviceInfo, Tier, VulkanError},
};
use serde_json::{Value, json};
use std::io::stdout;

pub(super) fn run(args: &DevicesArgs) -> Outcome {
    // Listing does not choose, so a device that the environment picks is not looked for.
    let options = ContextOptions::from_env().map_err(Failure::vulkan)?;
    let devices = match vulkan::devices(&options) {
        Ok(devices) => Ok(devices),
        Err(error @ (VulkanError::NoLoader(_) | VulkanError::OldLoader(_) | VulkanError::NoDevice)) => {
            Err(error.to_string())
        }
        Err(error) => return Err(Failure::vulkan(error)),
    };
    let runtime = xr::runtime();
    let text = if args.json { as_json(&devices, &runtime).to_string() } else { as_text(&devices, &runtime) };
    print_line(&mut stdout().lock(), text.trim_end()).map(|_| ())
}

/// Backends with the tier of devices that each needs.
const DEVICE_BACKENDS: &[(&str, Tier)] = &[("rt", Tier::Rt), ("compute", Tier::Compute)];

fn as_json(devices: &Result<Vec<DeviceInfo>, String>, runtime: &Result<String, String>) -> Value {
    let device = |d: &DeviceInfo| {
        let backends: serde_json::Map<String, Value> = DEVICE_BACKENDS
            .iter()
            .map(|(name, tier)| ((*name).to_owned(), json!({ "runs": d.can(*tier), "lacks": d.lacks(*tier) })))
            .collect();
        let (major, minor, patch) = d.api_version;
        json!({
            "index": d.index,
            "name": d.name,
            "kind": d.kind.name(),
            "driver": format!("{} {}", d.driver_name, d.driver_info),
            "vulkan": format!("{major}.{minor}.{patch}"),
            "memory_bytes": d.memory,
            "backends": backends,
        })
    };
    json!({
        "cpu": { "threads": rayon::current_num_threads(), "backends": { "cpu": { "runs": true, "lacks": [] } } },
        "devices": devices.iter().flatten().map(device).collect::<Vec<_>>(),
        "vulkan": devices.as_ref().err(),
        "openxr": { "runtime": runtime.as_ref().ok(), "lacks": runtime.as_ref().err() },
    })
}

fn as_text(devices: &Result<Vec<DeviceInfo>, String>, runtime: &Result<String, String>) -> String {
    let mut text = format!("cpu: {} threads\n  cpu      runs\n", rayon::current_num_threads());
    match devices {
        Err(error) => text += &format!("Vulkan: {error}\n"),
        Ok(devices) => {
            for device in devices {
                text += &format!("device {}: {device} ({})\n", device.index, device.kind.name());
                for (name, tier) in DEVICE_BACKENDS {
                    let lacks = device.lacks(*tier);
                    let verdict =
                        if lacks.is_empty() { String::from("runs") } else { format!("lacks {}", lacks.join(", ")) };
                    text += &format!("  {name:<8} {verdict}\n");
                }
            }
        }
    }
    match runtime {
        Ok(name) => text += &format!("OpenXR: {name}\n"),
        Err(why) => text += &format!("OpenXR: {why}\n"),
    }
    text
}
