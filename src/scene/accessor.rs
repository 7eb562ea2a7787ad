//! Bytes of a glTF file: buffers, views and accessors, every bound checked before anything is read or allocated.

use super::{
    folder::{Folder, MAX_FILE_SIZE, beside},
    gltf::{GltfError, Opened},
};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use gltf::json::{self, accessor::ComponentType, validation::Checked};
use std::borrow::Cow;

/// Elements of an accessor, in bounds.
#[derive(Clone, Copy, Debug)]
pub(super) struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    component: ComponentType,
    normalized: bool,
    /// Number of elements, at least 1.
    pub count: usize,
}

impl Elements<'_> {
    /// Component `c` of element `i`; integers are scaled to [0, 1] or [−1, 1] where the accessor says normalised.
    /// Zero out of bounds.
    pub fn number(&self, i: usize, c: usize) -> f64 {
        let at = i * self.stride + c * self.component.size();
        let unit = |x: f64, max: f64| if self.normalized { (x / max).max(-1.0) } else { x };
        match self.component {
            ComponentType::I8 => self.read(at, i8::from_le_bytes).map_or(0.0, |x| unit(x.into(), 127.0)),
            ComponentType::U8 => self.read(at, u8::from_le_bytes).map_or(0.0, |x| unit(x.into(), 255.0)),
            ComponentType::I16 => self.read(at, i16::from_le_bytes).map_or(0.0, |x| unit(x.into(), 32767.0)),
            ComponentType::U16 => self.read(at, u16::from_le_bytes).map_or(0.0, |x| unit(x.into(), 65535.0)),
            ComponentType::U32 => self.read(at, u32::from_le_bytes).map_or(0.0, f64::from),
            ComponentType::F32 => self.read(at, f32::from_le_bytes).map_or(0.0, f64::from),
        }
    }

    fn read<const N: usize, T>(&self, at: usize, convert: fn([u8; N]) -> T) -> Option<T> {
        Some(convert(self.bytes.get(at..at + N)?.try_into().ok()?))
    }
}

/// What an accessor is used for: which types it may have.
#[derive(Clone, Copy, Debug)]
pub(super) struct Use {
    /// Type in the JSON.
    pub kind: json::accessor::Type,
    /// Accepted component types.
    pub components: &'static [ComponentType],
}

/// Contents of all buffers.
pub(super) fn load_buffers<'a>(
    opened: &Opened,
    blob: Option<&'a [u8]>,
    folder: &Folder,
) -> Result<Vec<Cow<'a, [u8]>>, GltfError> {
    let mut loaded = Vec::new();
    let mut total = 0;
    for (i, buffer) in opened.root.buffers.iter().enumerate() {
        let place = format!("buffers[{i}]");
        let bytes = match (&buffer.uri, blob) {
            (Some(uri), _) => load_uri(opened, &place, uri, folder)?,
            (None, Some(blob)) if i == 0 => Cow::Borrowed(blob),
            (None, _) => return Err(opened.error(&place, "no uri, and no BIN chunk for it")),
        };
        let (declared, present) = (buffer.byte_length.0, bytes.len() as u64);
        if declared > present {
            let message = format!("{declared} bytes are declared, {present} are there");
            return Err(opened.error(format!("{place}.byteLength"), message));
        }
        total += present;
        if total > MAX_FILE_SIZE {
            return Err(opened.error(&place, format!("{total} bytes of buffers, at most {MAX_FILE_SIZE} are read")));
        }
        loaded.push(bytes);
    }
    Ok(loaded)
}

/// Contents of a `data:` URI or of a file beside the glTF file.
pub(super) fn load_uri<'a>(
    opened: &Opened,
    place: &str,
    uri: &str,
    folder: &Folder,
) -> Result<Cow<'a, [u8]>, GltfError> {
    let place = format!("{place}.uri");
    if let Some(data) = uri.strip_prefix("data:") {
        let payload = data.split_once(";base64,").map(|(_, payload)| payload);
        let payload = payload.ok_or_else(|| opened.error(&place, "a data URI must be base64"))?;
        let bytes = STANDARD.decode(payload).map_err(|e| opened.error(&place, format!("base64: {e}")))?;
        return Ok(Cow::Owned(bytes));
    }
    let path = percent_encoding::percent_decode_str(uri).decode_utf8();
    let path = path.map_err(|_| opened.error(&place, "the path is not UTF-8"))?;
    folder.read(&beside(opened.file, &path)).map_err(|e| opened.error(&place, e.to_string()))
}

/// The bytes of a buffer view.
pub(super) fn view<'a>(opened: &Opened, buffers: &'a [Cow<'_, [u8]>], index: usize) -> Result<&'a [u8], GltfError> {
    let place = || format!("bufferViews[{index}]");
    let missing = || opened.error(place(), "no such buffer view");
    let view = opened.root.buffer_views.get(index).ok_or_else(missing)?;
    let buffer = buffers.get(view.buffer.value()).ok_or_else(|| opened.error(place(), "no such buffer"))?;
    let (offset, length) = (view.byte_offset.map_or(0, |o| o.0), view.byte_length.0);
    let range =
        offset.checked_add(length).and_then(|end| Some(usize::try_from(offset).ok()?..usize::try_from(end).ok()?));
    range.and_then(|range| buffer.get(range)).ok_or_else(|| {
        let message = format!("{length} bytes from {offset} do not fit into the buffer ({} bytes)", buffer.len());
        opened.error(place(), message)
    })
}

/// The elements of an accessor that is used at `user`.
pub(super) fn elements<'a>(
    opened: &Opened,
    buffers: &'a [Cow<'_, [u8]>],
    index: usize,
    user: &str,
    usage: Use,
) -> Result<Elements<'a>, GltfError> {
    let place = || format!("accessors[{index}]");
    let missing = || opened.error(user, format!("no accessor {index} (there are {})", opened.root.accessors.len()));
    let accessor = opened.root.accessors.get(index).ok_or_else(missing)?;
    if accessor.sparse.is_some() {
        return Err(opened.error(place(), "sparse accessors are not supported"));
    }
    let (Checked::Valid(kind), Checked::Valid(component)) = (accessor.type_, accessor.component_type) else {
        return Err(opened.error(place(), "unknown type or componentType"));
    };
    let component = component.0;
    if kind != usage.kind || !usage.components.contains(&component) {
        let message = format!("an accessor of type {kind:?} and componentType {component:?} has no meaning here");
        return Err(opened.error(user, message));
    }
    let view_index = accessor.buffer_view.ok_or_else(|| opened.error(place(), "no bufferView"))?.value();
    let bytes = view(opened, buffers, view_index)?;

    let size = component.size() * kind.multiplicity();
    let declared_stride = opened.root.buffer_views.get(view_index).and_then(|view| view.byte_stride);
    let stride = declared_stride.map_or(size, |stride| stride.0);
    if stride < size {
        let message = format!("{stride} bytes are less than an element of accessors[{index}] ({size} bytes)");
        return Err(opened.error(format!("bufferViews[{view_index}].byteStride"), message));
    }
    let (count, offset) = (accessor.count.0, accessor.byte_offset.map_or(0, |o| o.0));
    if count == 0 {
        return Err(opened.error(place(), "count: 0 elements"));
    }
    // offset + stride (count − 1) + size, as far as it can be computed.
    let end = (count - 1).checked_mul(stride as u64).and_then(|n| n.checked_add(size as u64)?.checked_add(offset));
    let range = end.and_then(|end| Some(usize::try_from(offset).ok()?..usize::try_from(end).ok()?));
    let bytes = range.and_then(|range| bytes.get(range)).ok_or_else(|| {
        let there = bytes.len();
        let message =
            format!("{count} elements from byte {offset} do not fit into bufferViews[{view_index}] ({there} bytes)");
        opened.error(place(), message)
    })?;
    // In range: the product with the stride fits into the view.
    Ok(Elements { bytes, stride, component, normalized: accessor.normalized, count: count as usize })
}
