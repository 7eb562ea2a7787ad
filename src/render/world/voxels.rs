//! Voxels of the cells, which say where nothing is.
//!
//! An arc of a curved geodesic is short, and most of a cell is empty. So where geodesics are curved a segment looks at a voxel
//! before it walks a hierarchy or is traced: levels from fine to coarse have a bit for each voxel, set if anything is in it or
//! in one of the seven behind it. A segment asks the level on which it is no longer than a voxel: the one bit of the voxel that
//! its lower corner is in speaks for all that it may touch. Twin: `shaders/stage/voxels.glsl`.

use crate::{
    geometry::Segment,
    render::bvh::{Aabb, Grid},
    shader_io::{LINES, VOXEL_LEVELS, VOXELS},
};
use glam::DVec3;

/// Voxels along an axis on the finest level: the bits of a row.
const EDGE: usize = VOXELS as usize;

/// Slack in voxels: covers the rounding of places in voxels in f32.
const SLACK: f64 = 1e-3;

/// Slack in units of the distance from the chart's origin plus 1: covers the rounding of places in f32.
const FAR_SLACK: f64 = 1e-6;

/// The voxels of all cells.
#[derive(Clone, Debug, Default)]
pub struct Voxels {
    /// Bits, level by level, rows along x, then y, then z.
    pub words: Vec<u32>,
    /// For each cell where its voxels are. None in a cell that is empty or has something without end.
    pub grids: Vec<Option<VoxelGrid>>,
}

/// Where the voxels of a cell are: on the grid of its hierarchy.
#[derive(Clone, Copy, Debug)]
pub struct VoxelGrid {
    /// First of the cell's words.
    pub first: u32,
    /// Lower corner, in the chart.
    lower: DVec3,
    /// Voxels of the finest level per unit of the chart.
    scale: DVec3,
    /// By how many voxels everything is larger than it is.
    slack: DVec3,
}

impl Voxels {
    /// Adds the next cell: the grid of its hierarchy, if it has one, the triangles in it and the boxes about what else is in it.
    pub fn add(
        &mut self,
        grid: Option<Grid>,
        triangles: impl IntoIterator<Item = [DVec3; 3]>,
        boxes: impl IntoIterator<Item = Aabb>,
    ) {
        let grid = grid.and_then(|grid| VoxelGrid::new(grid, self.words.len() as u32));
        if let Some(grid) = grid {
            let mut filled = Filled::new();
            triangles.into_iter().for_each(|corners| filled.add_triangle(corners, &grid));
            boxes.into_iter().for_each(|bounds| filled.add(grid.span(bounds)));
            filled.write(&mut self.words);
        }
        self.grids.push(grid);
    }

    /// Whether anything may be where a segment of a cell goes.
    pub fn near(&self, cell: usize, segment: &Segment) -> bool {
        let Some(grid) = self.grids.get(cell).copied().flatten() else { return true };
        let start = grid.place(segment.origin);
        let (way, bulge) = (segment.direction * grid.scale, segment.bend * grid.scale * 0.25);
        let lower = start + way.min(DVec3::ZERO) + bulge.min(DVec3::ZERO);
        let upper = start + way.max(DVec3::ZERO) + bulge.max(DVec3::ZERO);
        if upper.min_element() < 0.0 || lower.max_element() > EDGE as f64 {
            return false;
        }
        let size = (upper - lower).max_element();
        let Some(level) = (0..VOXEL_LEVELS).find(|level| size <= f64::from(1_u32 << level)) else { return true };
        let [x, y, z] = lower.to_array().map(|at| at.clamp(0.0, (EDGE - 1) as f64) as usize >> level);
        let edge = EDGE >> level;
        let bit = (z * edge + y) * edge + x;
        let word = grid.first as usize + first_word(level) + bit / 32;
        self.words.get(word).is_none_or(|word| word >> (bit % 32) & 1 == 1)
    }
}

/// First word of a level, counted from the first of the cell: each level has an eighth of the one before.
fn first_word(level: u32) -> usize {
    let all = EDGE.pow(3) / 32 * 8;
    (all - (all >> (3 * level))) / 7
}

impl VoxelGrid {
    /// The voxels on a hierarchy's grid, if it has an end.
    fn new(grid: Grid, first: u32) -> Option<Self> {
        let scale = grid.scale * (EDGE as f64 / f64::from(LINES));
        let upper = grid.lower + EDGE as f64 / scale;
        let far = grid.lower.abs().max(upper.abs()) + 1.0;
        upper.is_finite().then_some(Self { first, lower: grid.lower, scale, slack: far * scale * FAR_SLACK + SLACK })
    }

    /// A point of the chart, in voxels of the finest level.
    fn place(&self, point: DVec3) -> DVec3 {
        (point - self.lower) * self.scale
    }

    /// The voxels that a box of the chart reaches into.
    fn span(&self, bounds: Aabb) -> [[usize; 2]; 3] {
        let (lower, upper) = (self.place(bounds.lower), self.place(bounds.upper));
        self.reach(lower, upper)
    }

    /// The voxels between two places, with slack.
    fn reach(&self, lower: DVec3, upper: DVec3) -> [[usize; 2]; 3] {
        let (lower, upper) = (lower - self.slack, upper + self.slack);
        std::array::from_fn(|axis| [lower[axis], upper[axis]].map(|at| at.clamp(0.0, (EDGE - 1) as f64) as usize))
    }
}

/// A level while it is filled: a bit for each voxel of a row.
struct Filled {
    edge: usize,
    rows: Vec<u64>,
}

impl Filled {
    fn new() -> Self {
        Self { edge: EDGE, rows: vec![0; EDGE * EDGE] }
    }

    /// Fills the voxels from the first to the last along each axis.
    fn add(&mut self, [x, y, z]: [[usize; 2]; 3]) {
        let row = u64::MAX >> (EDGE - 1 - x[1]) & u64::MAX << x[0];
        for z in z[0]..=z[1] {
            for y in y[0]..=y[1] {
                self.rows[z * EDGE + y] |= row;
            }
        }
    }

    /// Fills the voxels of a triangle's box that its plane passes.
    fn add_triangle(&mut self, corners: [DVec3; 3], grid: &VoxelGrid) {
        let [a, b, c] = corners.map(|corner| grid.place(corner));
        let span = grid.reach(a.min(b).min(c), a.max(b).max(c));
        let normal = (b - a).cross(c - a);
        let along = normal.abs().max_position();
        let (u, v) = ((along + 1) % 3, (along + 2) % 3);
        // Half of what a voxel reaches across the plane, in voxels along the axis.
        let slope = normal / normal[along];
        let half = 0.5 * (slope[u].abs() + slope[v].abs() + 1.0) + 3.0 * grid.slack.max_element();
        if span[along][1] - span[along][0] < 2 || !half.is_finite() {
            self.add(span);
            return;
        }
        for at_v in span[v][0]..=span[v][1] {
            for at_u in span[u][0]..=span[u][1] {
                let off = slope[u] * (at_u as f64 + 0.5 - a[u]) + slope[v] * (at_v as f64 + 0.5 - a[v]);
                let middle = a[along] - off;
                let [first, last] = span[along].map(|end| end as f64);
                let low = (middle - half - 0.5).ceil().max(first);
                let high = (middle + half - 0.5).floor().min(last);
                if low <= high {
                    let mut piece = [[0; 2]; 3];
                    piece[along] = [low as usize, high as usize];
                    piece[u] = [at_u; 2];
                    piece[v] = [at_v; 2];
                    self.add(piece);
                }
            }
        }
    }

    /// Whether anything is in a voxel or in the seven behind it, row by row.
    fn folded(&self) -> Vec<u64> {
        let last = self.edge - 1;
        let beside =
            |rows: &[u64], step: usize, more: bool, row: usize| rows[row] | if more { rows[row + step] } else { 0 };
        let along: Vec<u64> = self.rows.iter().map(|row| row | row >> 1).collect();
        let across: Vec<u64> = (0..along.len()).map(|row| beside(&along, 1, row % self.edge < last, row)).collect();
        (0..across.len()).map(|row| beside(&across, self.edge, row / self.edge < last, row)).collect()
    }

    /// The next level.
    fn coarser(&self) -> Self {
        let edge = self.edge / 2;
        let row = |index: usize| {
            let first = 2 * (index / edge) * self.edge + 2 * (index % edge);
            let four = [first, first + 1, first + self.edge, first + self.edge + 1].map(|row| self.rows[row]);
            let all = four.into_iter().fold(0, std::ops::BitOr::bitor);
            (0..edge).fold(0, |bits, x| bits | (u64::from(all >> (2 * x) & 3 != 0) << x))
        };
        Self { edge, rows: (0..edge * edge).map(row).collect() }
    }

    /// Appends all levels.
    fn write(self, words: &mut Vec<u32>) {
        let mut level = self;
        for _ in 0..VOXEL_LEVELS {
            let rows = level.folded();
            let bits = |index: usize| rows[index / level.edge] >> (index % level.edge) & 1 == 1;
            let word = |word: usize| (0..32).fold(0, |all, bit| all | u32::from(bits(32 * word + bit)) << bit);
            words.extend((0..level.edge.pow(3) / 32).map(word));
            level = level.coarser();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in [-1, 1), always the same.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> f64 {
            self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 40) as f64 / f64::from(1_u32 << 23) - 1.0
        }

        fn point(&mut self) -> DVec3 {
            DVec3::new(self.next(), self.next(), self.next())
        }
    }

    fn voxels(triangles: &[[DVec3; 3]], boxes: &[Aabb]) -> Voxels {
        let about = triangles.iter().map(|corners| Aabb::around(*corners));
        let all = about.chain(boxes.iter().copied()).reduce(Aabb::union);
        let mut voxels = Voxels::default();
        voxels.add(all.map(Grid::new), triangles.iter().copied(), boxes.iter().copied());
        voxels
    }

    /// Arcs through points of triangles and boxes are near something, however long they are; of short arcs elsewhere most are not.
    #[test]
    fn voxels_are_filled_where_something_is() {
        let mut random = Random(7);
        for size in [0.02, 0.3, 2.0] {
            let offset = random.point() * 3.0;
            let corner = |at: DVec3, random: &mut Random| offset + at + random.point() * size;
            let triangles: Vec<[DVec3; 3]> = (0..20)
                .map(|_| {
                    let at = random.point();
                    std::array::from_fn(|_| corner(at, &mut random))
                })
                .collect();
            let about = Aabb::around([offset + random.point(), offset + random.point()]);
            let voxels = voxels(&triangles, &[about]);
            for round in 0..20_000 {
                let [u, v] = [random.next().abs(), random.next().abs()];
                let [a, b, c] = triangles[round % triangles.len()];
                let inside = if u + v <= 1.0 { a + (b - a) * u + (c - a) * v } else { b + (c - b) * (u * v) };
                let filled = if round % 8 == 0 {
                    about.lower + (about.upper - about.lower) * DVec3::new(u, v, random.next().abs())
                } else {
                    inside
                };
                let reach = 10_f64.powf(2.0 * random.next() - 1.0);
                let (direction, bend, s) = (random.point() * reach, random.point() * reach, random.next().abs());
                let origin = filled - direction * s - bend * (s * (1.0 - s));
                let segment = Segment { origin, direction, bend };
                assert!(voxels.near(0, &segment), "{segment:?} at {s} passes through what is in the cell");
            }
        }
        let alone = voxels(&[[DVec3::ZERO, DVec3::new(1.0, 0.0, 1.0), DVec3::new(0.0, 1.0, 1.0)]], &[]);
        let near = (0..1000).filter(|_| {
            let origin = (random.point() + 1.0) * 0.5;
            alone.near(0, &Segment { origin, direction: random.point() * 0.01, bend: DVec3::ZERO })
        });
        let near = near.count();
        assert!(near < 150, "{near} of 1000 short segments are near a triangle");
        let beyond = Segment { origin: DVec3::splat(2.0), direction: DVec3::ONE, bend: DVec3::ZERO };
        assert!(!alone.near(0, &beyond));
    }

    /// Where something has no end, and where nothing is, every segment may meet something.
    #[test]
    fn voxels_are_not_there_without_an_end() {
        let segment = Segment { origin: DVec3::ONE, direction: DVec3::X, bend: DVec3::ZERO };
        assert!(voxels(&[], &[Aabb::EVERYTHING]).near(0, &segment));
        assert!(voxels(&[], &[]).near(0, &segment));
    }
}
