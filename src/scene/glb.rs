//! The container of binary glTF: a header and chunks of declared sizes.

use super::gltf::{GltfError, error};

/// JSON and BIN chunk of a GLB.
pub(super) fn split<'a>(file: &str, bytes: &'a [u8]) -> Result<(&'a [u8], Option<&'a [u8]>), GltfError> {
    let fail = |message: String| error(file, "", message);
    let word = |at: usize| -> Option<u32> { Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?)) };
    let truncated = || fail(format!("truncated GLB: the file ends after {} bytes, inside a header", bytes.len()));
    let (version, length) = word(4).zip(word(8)).ok_or_else(truncated)?;
    if version != 2 {
        return Err(fail(format!("GLB version {version}, expected 2")));
    }
    if length as usize > bytes.len() {
        return Err(fail(format!("truncated GLB: {length} bytes are declared, {} are there", bytes.len())));
    }
    let mut chunks = Vec::new();
    let mut at = 12;
    // The first chunk is JSON, the second BIN or absent; later ones belong to extensions.
    for kind in [b"JSON", b"BIN\0"] {
        if at >= length as usize && !chunks.is_empty() {
            break;
        }
        let size = word(at).ok_or_else(truncated)? as usize;
        let name = bytes.get(at + 4..at + 8).ok_or_else(truncated)?;
        let chunk = bytes.get(at + 8..).filter(|rest| size <= rest.len()).map(|rest| &rest[..size]);
        let there = bytes.len().saturating_sub(at + 8);
        if name != kind {
            return Err(fail(format!(
                "the chunk at byte {at} is {:?}, expected {:?}",
                printable(name),
                printable(kind)
            )));
        }
        let chunk = chunk.ok_or_else(|| {
            fail(format!("truncated GLB: chunk {:?} has {size} bytes, {there} are there", printable(name)))
        })?;
        chunks.push(chunk);
        at += 8 + size;
    }
    match chunks[..] {
        [json] => Ok((json, None)),
        [json, blob] => Ok((json, Some(blob))),
        _ => Err(truncated()),
    }
}

fn printable(name: &[u8]) -> String {
    name.iter().filter(|b| b.is_ascii_graphic()).map(|b| char::from(*b)).collect()
}
