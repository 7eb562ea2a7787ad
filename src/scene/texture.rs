//! Images to textures of linear values.

use super::{MAX_TEXTURE_SIZE, Texture, Wrap};
use half::f16;
use image::{ImageReader, Limits};
use std::{io::Cursor, sync::LazyLock};

/// Largest number of texels of all textures of a scene: 1 GiB in half precision.
pub(super) const MAX_TEXELS: u64 = 1 << 27;

/// What the numbers of an image mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Encoding {
    /// Colours in sRGB, with linear opacity.
    Srgb,
    /// Numbers in [0, 1].
    Linear,
}

/// Reads a PNG or JPEG image. Images with more than eight bits per channel are rounded to eight.
///
/// `used` is the number of texels that the scene has already: all together have a limit, checked before anything
/// is allocated.
///
/// # Errors
/// What is wrong with the image, with size and limit.
pub(super) fn decode(bytes: &[u8], encoding: Encoding, wrap: [Wrap; 2], used: u64) -> Result<Texture, String> {
    if let Some((width, height)) = png_size(bytes) {
        check_size(width, height, used)?;
    }
    let reader = || ImageReader::new(Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string());
    let (width, height) = reader()?.into_dimensions().map_err(|e| describe(&e))?;
    check_size(width, height, used)?;

    let mut reader = reader()?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_TEXTURE_SIZE);
    limits.max_image_height = Some(MAX_TEXTURE_SIZE);
    // Sixteen bits in four channels, and as much again for the decoder's own buffers.
    limits.max_alloc = Some(u64::from(width) * u64::from(height) * 16 + (1 << 20));
    reader.limits(limits);
    let image = reader.decode().map_err(|e| describe(&e))?.into_rgba8();
    if image.dimensions() != (width, height) {
        return Err("the image's size is not the size that its header declares".to_owned());
    }
    let texel = |p: &image::Rgba<u8>| match encoding {
        Encoding::Srgb => [SRGB[p[0] as usize], SRGB[p[1] as usize], SRGB[p[2] as usize], UNIT[p[3] as usize]],
        Encoding::Linear => [UNIT[p[0] as usize], UNIT[p[1] as usize], UNIT[p[2] as usize], UNIT[p[3] as usize]],
    };
    Ok(Texture { width, height, texels: image.pixels().map(texel).collect(), wrap })
}

/// The linear value of a byte in sRGB.
pub(super) fn linear_from_srgb(byte: u8) -> f32 {
    let x = f64::from(byte) / 255.0;
    (if x <= 0.04045 { x / 12.92 } else { ((x + 0.055) / 1.055).powf(2.4) }) as f32
}

static SRGB: LazyLock<[f16; 256]> = LazyLock::new(|| std::array::from_fn(|i| f16::from_f32(linear_from_srgb(i as u8))));
static UNIT: LazyLock<[f16; 256]> = LazyLock::new(|| std::array::from_fn(|i| f16::from_f32(i as f32 / 255.0)));

/// Number of texels of textures.
pub(super) fn texels(textures: &[Texture]) -> u64 {
    textures.iter().map(|texture| texture.texels.len() as u64).sum()
}

fn check_size(width: u32, height: u32, used: u64) -> Result<(), String> {
    if width == 0 || height == 0 || width > MAX_TEXTURE_SIZE || height > MAX_TEXTURE_SIZE {
        return Err(format!("image of {width}x{height}: sides must be 1 to {MAX_TEXTURE_SIZE}"));
    }
    let total = u64::from(width) * u64::from(height) + used;
    if total > MAX_TEXELS {
        return Err(format!(
            "image of {width}x{height}: {total} texels in the scene, at most {MAX_TEXELS} are allowed"
        ));
    }
    Ok(())
}

/// Width and height from the header of a PNG. Decoders refuse some sizes without naming them.
fn png_size(bytes: &[u8]) -> Option<(u32, u32)> {
    let header = bytes.strip_prefix(b"\x89PNG\r\n\x1a\n")?.get(4..16)?.strip_prefix(b"IHDR")?;
    let number = |at: usize| Some(u32::from_be_bytes(header.get(at..at + 4)?.try_into().ok()?));
    Some((number(0)?, number(4)?))
}

fn describe(error: &image::ImageError) -> String {
    format!("image: {error}")
}
