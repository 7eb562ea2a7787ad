//! Files: written under another name and renamed, so that a killed run leaves no half picture.

use super::Failure;
use crate::render::Target;
pub use crate::render::srgb_byte;
use anyhow::Context;
use image::{ExtendedColorType, ImageEncoder, ImageFormat, codecs::png::PngEncoder};
use std::{
    fs,
    io::{BufWriter, Write},
    path::{Path, PathBuf},
};

/// Format of a picture file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// 8-bit sRGB.
    Png,
    /// 32-bit floating point, linear.
    Exr,
}

/// The format that a file name asks for.
///
/// # Errors
/// Another ending, in words.
pub fn picture_format(path: &Path) -> Result<PictureFormat, Failure> {
    match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("png") => Ok(PictureFormat::Png),
        Some("exr") => Ok(PictureFormat::Exr),
        _ => Err(Failure::refused(anyhow::anyhow!("{}: the file name must end in .png or .exr", path.display()))),
    }
}

/// A file that appears under its name only when it is complete.
pub struct PendingFile {
    path: PathBuf,
    file: tempfile::NamedTempFile,
}

impl PendingFile {
    /// Opens a file beside `path`, so that work does not start when its result could not be written.
    ///
    /// # Errors
    /// Refused input if the folder does not exist or may not be written, or the path is something that must not be
    /// replaced: a folder, a device, a file that is read-only.
    pub fn create(path: &Path) -> Result<Self, Failure> {
        let shown = path.display().to_string();
        let refuse = |why: String| Failure::refused(anyhow::anyhow!("{shown}: {why}"));
        // A rename would replace devices and files that are protected as readily as any other.
        match path.metadata() {
            Ok(there) if there.is_dir() => return Err(refuse("is a folder".to_owned())),
            Ok(there) if !there.is_file() => return Err(refuse("is not a plain file".to_owned())),
            Ok(there) if there.permissions().readonly() => return Err(refuse("is read-only".to_owned())),
            Ok(_) | Err(_) => {}
        }
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            return Err(refuse(format!("there is no folder {}", folder.display())));
        }
        let file = tempfile::Builder::new()
            .prefix(".holonomy-")
            .suffix(".tmp")
            .tempfile_in(folder)
            // Without the temporary name, which says nothing.
            .map_err(|error| refuse(format!("cannot write into its folder: {}", error.kind())))?;
        Ok(Self { path: path.to_owned(), file })
    }

    /// Where the content is until it is complete.
    pub fn temporary_path(&self) -> PathBuf {
        self.file.path().to_owned()
    }

    /// Writes the content and gives the file its name.
    ///
    /// # Errors
    /// The disk is full, or the name cannot be given.
    pub fn finish(self, content: &[u8]) -> Result<(), Failure> {
        let shown = self.path.display().to_string();
        let write = || -> anyhow::Result<()> {
            let mut writer = BufWriter::new(self.file.as_file());
            writer.write_all(content)?;
            writer.flush()?;
            drop(writer);
            // Temporary files are private; a picture has the permissions of any new file.
            #[cfg(unix)]
            {
                use std::os::unix::fs::PermissionsExt;
                self.file.as_file().set_permissions(fs::Permissions::from_mode(0o644))?;
            }
            self.file.persist(&self.path)?;
            Ok(())
        };
        write().with_context(|| shown).map_err(Failure::Failed)
    }
}

/// The picture as a file: PNG with the sRGB transfer function, or EXR with the values as they are. `raw` says
/// that pixels hold values, which PNG shows as pseudo-colours.
///
/// # Errors
/// The encoder's.
pub fn encode(target: &Target, format: PictureFormat, raw: bool) -> Result<Vec<u8>, Failure> {
    let fail = |error: image::ImageError| Failure::failed(anyhow::Error::new(error).context("encoding the picture"));
    let mut bytes = Vec::new();
    match format {
        PictureFormat::Png => {
            let colored = if raw { colors_of_values(target) } else { target.pixels.clone() };
            let rgb: Vec<u8> = colored.iter().flat_map(|p| [p[0], p[1], p[2]].map(srgb_byte)).collect();
            PngEncoder::new(&mut bytes)
                .write_image(&rgb, target.width, target.height, ExtendedColorType::Rgb8)
                .map_err(fail)?;
        }
        PictureFormat::Exr => {
            let values: Vec<f32> = target.pixels.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
            let picture = image::Rgb32FImage::from_raw(target.width, target.height, values)
                .ok_or_else(|| Failure::failed(anyhow::anyhow!("the picture has the wrong number of pixels")))?;
            picture.write_to(&mut std::io::Cursor::new(&mut bytes), ImageFormat::OpenExr).map_err(fail)?;
        }
    }
    Ok(bytes)
}

/// Pseudo-colours: small whole numbers get well separated hues, larger ranges a ramp from near (bright) to far.
fn colors_of_values(target: &Target) -> Vec<[f32; 4]> {
    let finite = || target.pixels.iter().map(|p| p[0]).filter(|v| v.is_finite());
    let most = finite().fold(0.0_f32, f32::max);
    let whole = finite().all(|v| v == v.trunc());
    let color = |v: f32| -> [f32; 4] {
        if !v.is_finite() || v < 0.0 {
            return [0.0, 0.0, 0.0, 1.0];
        }
        let (hue, light) = if whole {
            // The golden ratio spreads hues; every round of the circle is a little darker.
            (v * 0.618_034, 1.0 / (1.0 + 0.08 * (v / 8.0).floor()).min(4.0))
        } else {
            let share = v / most.max(1e-30);
            (0.66 * share, 1.0 - 0.75 * share)
        };
        let channel = |shift: f32| {
            let t = ((hue + shift).fract() * 6.0 - 3.0).abs() - 1.0;
            light * (0.15 + 0.85 * t.clamp(0.0, 1.0))
        };
        [channel(0.0), channel(2.0 / 3.0), channel(1.0 / 3.0), 1.0]
    };
    target.pixels.iter().map(|p| color(p[0])).collect()
}
