//! Bounding volume hierarchy: one builder for the cpu and the compute backend.
//!
//! Binary tree by the surface area heuristic with binned splits (Wald: On fast construction of SAH-based bounding
//! volume hierarchies, 2007). A node holds the boxes of both children, so a traversal step reads one node and
//! decides about two boxes. Boxes lie on a grid of 2¹⁶ lines per axis over the cell's content, rounded outwards: half
//! of the memory traffic of f32 boxes for a loss that is smaller than any triangle worth drawing.

use crate::shader_io::{NODE_COUNT_SHIFT, Node, STACK_SIZE};
use glam::DVec3;

/// An axis-aligned box in the chart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Lower corner.
    pub lower: DVec3,
    /// Upper corner.
    pub upper: DVec3,
}

impl Aabb {
    /// The box around nothing.
    pub const EMPTY: Self = Self { lower: DVec3::INFINITY, upper: DVec3::NEG_INFINITY };

    /// The smallest box around points.
    pub fn around(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| Self { lower: b.lower.min(p), upper: b.upper.max(p) })
    }

    /// The smallest box around both.
    pub fn union(self, other: Self) -> Self {
        Self { lower: self.lower.min(other.lower), upper: self.upper.max(other.upper) }
    }

    /// What both have in common; may be inverted.
    pub fn intersection(self, other: Self) -> Self {
        Self { lower: self.lower.max(other.lower), upper: self.upper.min(other.upper) }
    }

    fn half_area(self) -> f64 {
        let d = (self.upper - self.lower).max(DVec3::ZERO);
        d.x * d.y + d.y * d.z + d.z * d.x
    }

    fn centre(self) -> DVec3 {
        (self.lower + self.upper) * 0.5
    }
}

/// Primitives per leaf at which a split no longer pays for its traversal step.
const LEAF_SIZE: usize = 2;
/// Most primitives in a leaf, where no split separates them.
const MAX_LEAF_SIZE: usize = 8;
/// Bins per axis; more do not change the trees' cost measurably.
const BINS: usize = 16;
/// Depth from which nodes are halved by count, which bounds the depth by 24 more levels for 2²⁴ primitives.
const HALVE_FROM_DEPTH: u32 = STACK_SIZE - 25;
/// Cost of visiting a node relative to testing a primitive.
const NODE_COST: f64 = 1.2;

/// A cell's hierarchy: where its root is, and the grid of its boxes.
#[derive(Clone, Copy, Debug)]
pub struct Tree {
    /// Index of the root among all nodes.
    pub root: u32,
    /// The grid.
    pub grid: Grid,
}

/// Lines of boxes along each axis.
#[derive(Clone, Copy, Debug)]
pub struct Grid {
    /// First line, in the chart.
    pub lower: DVec3,
    /// Lines per unit of the chart.
    pub scale: DVec3,
}

/// The last grid line.
const LAST_LINE: f64 = 65535.0;

/// Slack of boxes beyond rounding, in units of their distance from the chart's origin plus 1: covers the rounding of
/// positions and of the slab test in f32.
const BOX_SLACK: f64 = 1e-6;

impl Grid {
    fn new(bounds: Aabb) -> Self {
        let margin = (bounds.lower.abs().max(bounds.upper.abs()) + 1.0) * (4.0 * BOX_SLACK);
        // In f32, so that both number formats have the same grid.
        let lower = (bounds.lower - margin).as_vec3();
        let extent = (bounds.upper + margin) - lower.as_dvec3();
        let scale = (DVec3::splat(LAST_LINE) / extent).as_vec3();
        Self { lower: lower.as_dvec3(), scale: scale.as_dvec3() }
    }

    fn lines(&self, b: Aabb) -> [u32; 3] {
        std::array::from_fn(|axis| {
            let line = |x: f64| (x - self.lower[axis]) * self.scale[axis];
            let slack = |x: f64| BOX_SLACK * (1.0 + x.abs());
            let low = line(b.lower[axis] - slack(b.lower[axis])).floor().clamp(0.0, LAST_LINE) as u32;
            let high = line(b.upper[axis] + slack(b.upper[axis])).ceil().clamp(0.0, LAST_LINE) as u32;
            low | high << 16
        })
    }
}

/// Appends the tree of `boxes` to `nodes`, and its primitives to `order`: index `i` of `boxes` appears as
/// `names[i]`. `None` without primitives.
pub fn build(boxes: &[Aabb], names: &[u32], nodes: &mut Vec<Node>, order: &mut Vec<u32>) -> Option<Tree> {
    if boxes.is_empty() {
        return None;
    }
    let mut items: Vec<Item> =
        boxes.iter().zip(names).map(|(b, name)| Item { bounds: *b, centre: b.centre(), name: *name }).collect();
    let grid = Grid::new(boxes.iter().fold(Aabb::EMPTY, |b, x| b.union(*x)));
    let root = nodes.len() as u32;
    nodes.push(Node::default());
    let mut builder = Builder { nodes, order, grid };
    let children = if items.len() == 1 {
        // A root has two children: both are the one leaf.
        let leaf = builder.leaf(&items);
        [leaf, leaf]
    } else {
        let middle = split(&mut items, 0).unwrap_or(boxes.len() / 2);
        let (left, right) = items.split_at_mut(middle);
        [builder.child(left, 1), builder.child(right, 1)]
    };
    builder.set(root, children);
    Some(Tree { root, grid })
}

#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    centre: DVec3,
    name: u32,
}

/// Box and reference of a child.
#[derive(Clone, Copy)]
struct Child {
    bounds: Aabb,
    reference: u32,
}

struct Builder<'a> {
    nodes: &'a mut Vec<Node>,
    order: &'a mut Vec<u32>,
    grid: Grid,
}

impl Builder<'_> {
    fn leaf(&mut self, items: &[Item]) -> Child {
        let bounds = items.iter().fold(Aabb::EMPTY, |b, item| b.union(item.bounds));
        let first = self.order.len() as u32;
        self.order.extend(items.iter().map(|item| item.name));
        Child { bounds, reference: first | (items.len() as u32) << NODE_COUNT_SHIFT }
    }

    fn child(&mut self, items: &mut [Item], depth: u32) -> Child {
        let Some(middle) = split(items, depth) else { return self.leaf(items) };
        let bounds = items.iter().fold(Aabb::EMPTY, |b, item| b.union(item.bounds));
        let index = self.nodes.len() as u32;
        self.nodes.push(Node::default());
        let (left, right) = items.split_at_mut(middle);
        let children = [self.child(left, depth + 1), self.child(right, depth + 1)];
        self.set(index, children);
        Child { bounds, reference: index }
    }

    fn set(&mut self, index: u32, [a, b]: [Child; 2]) {
        self.nodes[index as usize] = Node {
            box0: self.grid.lines(a.bounds),
            child0: a.reference,
            box1: self.grid.lines(b.bounds),
            child1: b.reference,
        };
    }
}

/// Index and number of primitives of a node's child.
pub fn child_of(reference: u32) -> (u32, u32) {
    (reference & ((1 << NODE_COUNT_SHIFT) - 1), reference >> NODE_COUNT_SHIFT)
}

/// Most primitives and most nodes that references can name.
pub const MAX_PRIMITIVES: usize = 1 << NODE_COUNT_SHIFT;

/// Reorders items and says where to cut, or `None` for a leaf.
fn split(items: &mut [Item], depth: u32) -> Option<usize> {
    if items.len() <= LEAF_SIZE {
        return None;
    }
    let halves = items.len() / 2;
    let centres = Aabb::around(items.iter().map(|item| item.centre));
    let extent = centres.upper - centres.lower;
    if depth >= HALVE_FROM_DEPTH || extent.max_element() <= 0.0 {
        return (items.len() > MAX_LEAF_SIZE).then_some(halves);
    }
    let bounds = items.iter().fold(Aabb::EMPTY, |b, item| b.union(item.bounds));
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in 0..3 {
        if extent[axis] <= 0.0 {
            continue;
        }
        let mut bins = [(Aabb::EMPTY, 0_usize); BINS];
        for item in items.iter() {
            let bin = bin_of(item.centre[axis], centres.lower[axis], extent[axis]);
            bins[bin].0 = bins[bin].0.union(item.bounds);
            bins[bin].1 += 1;
        }
        let mut right = [(Aabb::EMPTY, 0_usize); BINS];
        for i in (0..BINS - 1).rev() {
            right[i] = (right[i + 1].0.union(bins[i + 1].0), right[i + 1].1 + bins[i + 1].1);
        }
        let mut left = (Aabb::EMPTY, 0_usize);
        for i in 0..BINS - 1 {
            left = (left.0.union(bins[i].0), left.1 + bins[i].1);
            if left.1 == 0 || right[i].1 == 0 {
                continue;
            }
            let cost = left.0.half_area() * left.1 as f64 + right[i].0.half_area() * right[i].1 as f64;
            if best.is_none_or(|(least, _, _)| cost < least) {
                best = Some((cost, axis, i));
            }
        }
    }
    let (cost, axis, bin) = best?;
    let leaf_cost = bounds.half_area() * (items.len() as f64 - NODE_COST);
    if items.len() <= MAX_LEAF_SIZE && cost >= leaf_cost {
        return None;
    }
    let (lower, width) = (centres.lower[axis], extent[axis]);
    let mut middle = 0;
    for i in 0..items.len() {
        if bin_of(items[i].centre[axis], lower, width) <= bin {
            items.swap(i, middle);
            middle += 1;
        }
    }
    Some(middle)
}

fn bin_of(centre: f64, lower: f64, width: f64) -> usize {
    (((centre - lower) / width * BINS as f64) as usize).min(BINS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every primitive is in exactly one leaf, inside the boxes above it, and no path is deeper than the stack.
    #[test]
    fn bvh_holds_every_primitive_once() {
        for n in [1_usize, 2, 3, 17, 1000] {
            let boxes: Vec<Aabb> = (0..n)
                .map(|i| {
                    let t = i as f64 * 0.618_033_988_7;
                    let p = DVec3::new(t.fract(), (t * 7.3).fract(), if n == 17 { 0.0 } else { (t * 3.1).fract() });
                    Aabb { lower: p, upper: p + 0.01 }
                })
                .collect();
            let names: Vec<u32> = (0..n as u32).collect();
            let (mut nodes, mut order) = (Vec::new(), Vec::new());
            let tree = build(&boxes, &names, &mut nodes, &mut order).expect("there are primitives");
            let mut seen = vec![0; n];
            let mut stack = vec![(tree.root, 1)];
            while let Some((node, depth)) = stack.pop() {
                assert!(depth < STACK_SIZE);
                let node = nodes[node as usize];
                for (lines, reference) in [(node.box0, node.child0), (node.box1, node.child1)] {
                    let (child, count) = child_of(reference);
                    for &name in &order[child as usize..][..count as usize] {
                        seen[name as usize] += 1;
                        let b = boxes[name as usize];
                        for (axis, line) in lines.into_iter().enumerate() {
                            let at = |line: u32| f64::from(line) / tree.grid.scale[axis] + tree.grid.lower[axis];
                            assert!(at(line & 0xffff) < b.lower[axis] && at(line >> 16) > b.upper[axis]);
                        }
                    }
                    if count == 0 {
                        stack.push((child, depth + 1));
                    }
                }
            }
            // The only primitive is in both children of the root.
            let times = if n == 1 { 2 } else { 1 };
            assert!(seen.iter().all(|&t| t == times), "{n} primitives: {seen:?}");
        }
    }
}
