//! How a picture is cut up: bands that fit into a buffer, tiles that take a bearable time.

use crate::shader_io::{GROUP_HEIGHT, GROUP_WIDTH};
use std::{ops::Range, time::Duration};

/// What a submission should take. Watchdogs of drivers fire after 2 seconds and desktops that share the device
/// stutter beyond a frame or two, while below 10 ms submitting costs more than a few percent.
pub const TARGET_TIME: Duration = Duration::from_millis(50);

/// First tile: even at the deepest settings its 4096 pixels stay far below a watchdog on hardware.
const FIRST_TILE: [u32; 2] = [64, 64];

/// Largest change of the tile's area from one submission to the next: tiles differ in what they show, so one
/// measurement says little.
const LARGEST_STEP: f64 = 4.0;

/// Larger buffers of pixels bring nothing, and drivers limit single allocations.
const MAX_BAND_PIXELS: u64 = 1 << 24;

/// Rows of a picture that are drawn one after the other.
#[derive(Debug, PartialEq, Eq)]
pub struct Bands {
    size: [u32; 2],
    rows: u32,
}

impl Bands {
    /// Bands of at most `max_pixels` pixels; none if a single row has more.
    pub fn new(size: [u32; 2], max_pixels: u64) -> Option<Self> {
        let rows = max_pixels.min(MAX_BAND_PIXELS.max(u64::from(size[0]))) / u64::from(size[0]).max(1);
        let rows = u32::try_from(rows).unwrap_or(u32::MAX).min(size[1]);
        (rows > 0 || size[1] == 0).then_some(Self { size, rows: rows.max(1) })
    }

    /// Pixels across and down of the largest band.
    pub fn largest(&self) -> [u32; 2] {
        [self.size[0], self.rows]
    }

    /// The rows of each band.
    pub fn iter(&self) -> impl Iterator<Item = Range<u32>> {
        let (height, rows) = (self.size[1], self.rows);
        (0..height).step_by(rows as usize).map(move |start| start..start.saturating_add(rows).min(height))
    }
}

/// Learns how many pixels a submission may take.
#[derive(Debug)]
pub struct Pace {
    area: f64,
    /// Largest tile that the device's limit of workgroups permits.
    limit: [u32; 2],
}

impl Pace {
    /// Starts small; `max_workgroups` across and down.
    pub fn new(max_workgroups: [u32; 2]) -> Self {
        let limit = [max_workgroups[0].saturating_mul(GROUP_WIDTH), max_workgroups[1].saturating_mul(GROUP_HEIGHT)];
        Self { area: f64::from(FIRST_TILE[0]) * f64::from(FIRST_TILE[1]), limit }
    }

    /// Area and largest sides of the next tile.
    pub fn tile(&self) -> (f64, [u32; 2]) {
        (self.area, self.limit)
    }

    /// `pixels` took `time`.
    pub fn learn(&mut self, pixels: u64, time: Duration) {
        let seconds = time.as_secs_f64().max(1e-9);
        let fitting = pixels as f64 * TARGET_TIME.as_secs_f64() / seconds;
        // A tile at the picture's edge is smaller than was asked for and proves nothing about larger ones.
        if (pixels as f64) < 0.5 * self.area && fitting < self.area && seconds < TARGET_TIME.as_secs_f64() {
            return;
        }
        let least = f64::from(GROUP_WIDTH * GROUP_HEIGHT);
        self.area = fitting.clamp(self.area / LARGEST_STEP, self.area * LARGEST_STEP).clamp(least, 1e12);
    }
}

/// Walks over a picture in shelves of tiles.
#[derive(Debug)]
pub struct Tiles {
    size: [u32; 2],
    at: [u32; 2],
    shelf: u32,
}

impl Tiles {
    /// All of a picture of this size.
    pub fn new(size: [u32; 2]) -> Self {
        Self { size, at: [0, 0], shelf: 0 }
    }

    /// Origin and extent of the next tile, of about `area` pixels and within `limit`; none at the end.
    pub fn next(&mut self, (area, limit): (f64, [u32; 2])) -> Option<([u32; 2], [u32; 2])> {
        let [width, height] = self.size;
        let [x, y] = self.at;
        if width == 0 || y >= height {
            return None;
        }
        if x == 0 {
            // As wide as the picture if that leaves a workgroup's height, else square.
            let full = f64::from(width.next_multiple_of(GROUP_WIDTH));
            let side = if area >= full * f64::from(GROUP_HEIGHT) { area / full } else { area.sqrt() };
            self.shelf = whole_groups(side, GROUP_HEIGHT).min(limit[1]).min(height - y);
        }
        let across = whole_groups(area / f64::from(self.shelf), GROUP_WIDTH).min(limit[0]).min(width - x);
        let tile = ([x, y], [across, self.shelf]);
        self.at = if x + across >= width { [0, y + self.shelf] } else { [x + across, y] };
        Some(tile)
    }
}

/// The nearest multiple of a workgroup's side, at least one.
fn whole_groups(length: f64, side: u32) -> u32 {
    let groups = (length / f64::from(side)).round().clamp(1.0, f64::from(u32::MAX / side));
    groups as u32 * side
}
