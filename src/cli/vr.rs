//! `holonomy vr`: a scene through a headset.

use super::{
    BackendChoice, Failure, Outcome, VrArgs,
    eye::EyeFile,
    output::{PendingFile, srgb_byte},
};
use crate::{
    render::{
        RenderError,
        compute::ComputeBackend,
        device::eyes::{Encoding, EyeBackend},
        rt::RtBackend,
    },
    scene::{avatar, file},
    view::xr::{
        error::XrError,
        frames::{self, Limits, Painter as _, Runtime as _},
        player::{KeptFrame, Player, PlayerOptions},
        system::{Headset, SessionOptions},
        timing,
        watchdog::{self, Watchdog},
    },
    vulkan::{ContextOptions, Tier, VulkanError},
};
use anyhow::{Context as _, anyhow};
use image::{ExtendedColorType, ImageEncoder, codecs::png::PngEncoder};
use serde_json::{Value, json};
use std::{fs, io::Write, path::Path, rc::Rc, time::Duration};

pub(super) fn run(args: &VrArgs) -> Outcome {
    if args.backend == BackendChoice::Cpu {
        return Err(Failure::refused(anyhow!("--backend cpu draws no frames for a headset: use rt, compute or auto")));
    }
    let mut scene = file::load(&args.scene).map_err(Failure::refused)?;
    scene.settings.bounces = args.bounces.unwrap_or(scene.settings.bounces);
    let unit_in_metres = args.unit_in_metres.unwrap_or_else(|| scene.observer.unit_in_metres());
    if !args.bare {
        avatar::add(&mut scene, unit_in_metres).map_err(Failure::failed)?;
    }
    // Nothing is drawn whose account could not be written.
    let stats_file = args.stats.as_deref().map(PendingFile::create).transpose()?;
    if let Some(folder) = &args.save_eyes {
        fs::create_dir_all(folder).with_context(|| folder.display().to_string()).map_err(Failure::Refused)?;
    }
    let options = ContextOptions {
        submit_time_out: Some(frames::PATIENCE),
        ..ContextOptions::from_env().map_err(Failure::vulkan)?
    };
    let messages = options.messages.clone();
    let stats_path = stats_file.as_ref().map(PendingFile::temporary_path);
    let watchdog = Rc::new(Watchdog::new(move |call| {
        // What has been begun is not left lying about.
        if let Some(path) = &stats_path {
            let _ = fs::remove_file(path);
        }
        watchdog::end_program(call);
    }));
    let headset = Headset::find(watchdog).map_err(failure)?;
    let (backend, reason) = backend(args, &headset, &options).map_err(failure)?;
    let side = |eye: usize| {
        let wanted = (f64::from(headset.sizes[0][eye]) * args.resolution_scale).round() as u32;
        wanted.clamp(1, headset.sizes[1][eye].clamp(1, crate::render::device::eyes::LARGEST_SIDE))
    };
    let size = [side(0), side(1)];
    let context = backend.device_context().clone();
    let mut player = Player::new(
        scene.clone(),
        backend,
        PlayerOptions {
            tracking: args.tracking,
            unit_in_metres,
            size,
            full_rate_within: args.foveation.map(f64::to_radians),
            hold_fps: args.hold_fps,
            together: !args.apart,
            keep: args.save_eyes.is_some(),
        },
    );
    let session_options = SessionOptions { size, unit_in_metres, read: args.save_eyes.is_some() };
    let mut session = headset.session(&context, &session_options).map_err(failure)?;
    player.set_images(session.encoding, session.depth);
    // Drivers compile before the session begins, so that no frame waits for them.
    player.hide(session.hidden());
    player.warm_up().map_err(failure)?;
    let _ = writeln!(
        std::io::stderr(),
        "{} by {}, {} x {} pixels for each eye; {reason}",
        headset.name,
        headset.runtime,
        size[0],
        size[1]
    );
    let limits = Limits { frames: args.frames, asleep: Duration::from_secs_f64(args.wait) };
    let (report, ended) = frames::run(&mut session, &mut player, limits);
    let depth = session.depth.is_some();
    // The session goes before the device that it uses.
    drop(session);
    if let Some(lost) = player.backend().keep() {
        let _ = writeln!(std::io::stderr(), "warning: {lost}");
    }
    let complaints = messages.all();
    if let Some(file) = stats_file {
        let mut text = timing::report_json(&report);
        if let Value::Object(map) = &mut text {
            let more = json!({
                "schema": 1,
                "scene": scene.name,
                "geometry": scene.space.geometry.name(),
                "backend": player.backend().name(),
                "device": player.backend().device(),
                "runtime": headset.runtime,
                "headset": headset.name,
                "size": size,
                "resolution_scale": args.resolution_scale,
                "recommended_size": headset.sizes[0],
                "encoding": format!("{:?}", player.encoding()),
                "depth": depth,
                "unit_in_metres": unit_in_metres,
                "one_dispatch": !args.apart,
                "foveation_degrees": args.foveation,
                "hold_fps": args.hold_fps,
                "rays_per_frame": player.rays(),
                "pixels_per_frame": 2 * u64::from(size[0]) * u64::from(size[1]),
                "ended": ended.as_ref().err().map(ToString::to_string),
                "validation_messages": complaints,
            });
            if let Value::Object(more) = more {
                map.extend(more);
            }
        }
        file.finish(serde_json::to_string_pretty(&text).map_err(Failure::failed)?.as_bytes())?;
    }
    ended.map_err(failure)?;
    if let (Some(folder), Some(kept)) = (&args.save_eyes, player.kept()) {
        save(folder, kept, unit_in_metres, args.bare)?;
    }
    match complaints.first() {
        Some(first) => {
            Err(Failure::failed(anyhow!("{} complaints of the validation layer: {first}", complaints.len())))
        }
        None => Ok(()),
    }
}

/// The device that the headset hangs on, with the backend that was asked for, and why it was taken.
fn backend(
    args: &VrArgs,
    headset: &Headset,
    options: &ContextOptions,
) -> Result<(Box<dyn EyeBackend>, String), XrError> {
    let open = |tier| headset.context(&ContextOptions { tier, ..options.clone() });
    let rt = || -> Result<Box<dyn EyeBackend>, VulkanError> { Ok(Box::new(RtBackend::new(&open(Tier::Rt)?)?)) };
    let told = |backend: Box<dyn EyeBackend>, why: &str| {
        let reason = format!("backend {}: {}{why}", backend.name(), backend.device());
        (backend, reason)
    };
    if args.backend == BackendChoice::Rt {
        return Ok(told(rt()?, " (asked for)"));
    }
    let context = open(Tier::Compute)?;
    let (traces, software) = (context.info().can(Tier::Rt), context.info().is_software());
    if args.backend == BackendChoice::Compute {
        return Ok(told(Box::new(ComputeBackend::new(&context)?), " (asked for)"));
    }
    if traces && !software {
        drop(context);
        return match rt() {
            Ok(backend) => Ok(told(backend, "")),
            Err(error) => {
                let backend = ComputeBackend::new(&open(Tier::Compute)?)?;
                Ok(told(Box::new(backend), &format!(" (because {error})")))
            }
        };
    }
    Ok(told(Box::new(ComputeBackend::new(&context)?), ""))
}

/// Worlds that are too large are the scene's fault, all else the machine's.
fn failure(error: XrError) -> Failure {
    match error {
        XrError::World(_)
        | XrError::Render(
            RenderError::TooLarge { .. }
            | RenderError::Vulkan(
                VulkanError::TooMany { .. } | VulkanError::Variable { .. } | VulkanError::UnknownDevice { .. },
            ),
        ) => Failure::refused(error),
        error => Failure::failed(error),
    }
}

/// Writes the images of a frame, and what is needed to draw them again.
fn save(folder: &Path, kept: &KeptFrame, unit_in_metres: f64, bare: bool) -> Outcome {
    for (index, name) in ["left", "right"].into_iter().enumerate() {
        let size = kept.shots[index].size;
        let rgb = rgb(&kept.images[index], kept.encoding);
        let mut bytes = Vec::new();
        PngEncoder::new(&mut bytes)
            .write_image(&rgb, size[0], size[1], ExtendedColorType::Rgb8)
            .map_err(|error| Failure::failed(anyhow::Error::new(error).context("encoding the picture")))?;
        PendingFile::create(&folder.join(format!("{name}.png")))?.finish(&bytes)?;
        let eye = EyeFile::new(&kept.shots[index], &kept.pose, kept.bounces, unit_in_metres, bare);
        let text = eye.to_text(&kept.look, index)?;
        PendingFile::create(&folder.join(format!("{name}.json")))?.finish(text.as_bytes())?;
    }
    Ok(())
}

/// 8-bit sRGB from the bytes of an image.
fn rgb(bytes: &[u8], encoding: Encoding) -> Vec<u8> {
    let four = |order: [usize; 3], linear: bool| -> Vec<u8> {
        let byte = |b: u8| if linear { srgb_byte(f32::from(b) / 255.0) } else { b };
        bytes.chunks_exact(4).flat_map(|p| order.map(|i| byte(p[i]))).collect()
    };
    let eight = |value: fn([u8; 2]) -> f32| -> Vec<u8> {
        bytes.chunks_exact(8).flat_map(|p| [0, 2, 4].map(|i| srgb_byte(value([p[i], p[i + 1]])))).collect()
    };
    match encoding {
        Encoding::Rgba8Srgb => four([0, 1, 2], false),
        Encoding::Bgra8Srgb => four([2, 1, 0], false),
        Encoding::Rgba8 => four([0, 1, 2], true),
        Encoding::Bgra8 => four([2, 1, 0], true),
        Encoding::Rgba16F => eight(|bytes| half::f16::from_le_bytes(bytes).to_f32()),
        Encoding::Rgba16 => eight(|bytes| f32::from(u16::from_le_bytes(bytes)) / 65_535.0),
    }
}
