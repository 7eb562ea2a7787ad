//! Bounding volume hierarchy: one builder for the cpu and the compute backend.
//!
//! Binary tree by the surface area heuristic with binned splits (Wald: On fast construction of SAH-based bounding
//! volume hierarchies, 2007). A node holds the boxes of both children, so a traversal step reads one node and
//! decides about two boxes. Boxes are f32, rounded outwards from the f64 geometry.

use crate::shader_io::{Node, STACK_SIZE};
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

/// Appends the tree of `boxes` to `nodes`, and its primitives to `order`: index `i` of `boxes` appears as
/// `names[i]`. Returns the root's index, or `None` without primitives.
pub fn build(boxes: &[Aabb], names: &[u32], nodes: &mut Vec<Node>, order: &mut Vec<u32>) -> Option<u32> {
    if boxes.is_empty() {
        return None;
    }
    let mut items: Vec<Item> =
        boxes.iter().zip(names).map(|(b, name)| Item { bounds: *b, centre: b.centre(), name: *name }).collect();
    let root = nodes.len() as u32;
    nodes.push(Node::default());
    let mut builder = Builder { nodes, order };
    let (left, right) = if items.len() <= LEAF_SIZE {
        let middle = items.len().div_ceil(2);
        items.split_at_mut(middle)
    } else {
        let middle = split(&mut items, 0).unwrap_or(boxes.len() / 2);
        items.split_at_mut(middle)
    };
    let children = [builder.child(left, 1), builder.child(right, 1)];
    builder.set(root, children);
    Some(root)
}

#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    centre: DVec3,
    name: u32,
}

/// Box, index and leaf size of a child.
struct Child {
    bounds: Aabb,
    index: u32,
    count: u32,
}

struct Builder<'a> {
    nodes: &'a mut Vec<Node>,
    order: &'a mut Vec<u32>,
}

impl Builder<'_> {
    fn child(&mut self, items: &mut [Item], depth: u32) -> Child {
        let bounds = items.iter().fold(Aabb::EMPTY, |b, item| b.union(item.bounds));
        if items.is_empty() {
            return Child {
                bounds: Aabb { lower: DVec3::splat(NOWHERE), upper: DVec3::splat(NOWHERE) },
                index: 0,
                count: 0,
            };
        }
        let Some(middle) = split(items, depth) else {
            let index = self.order.len() as u32;
            self.order.extend(items.iter().map(|item| item.name));
            return Child { bounds, index, count: items.len() as u32 };
        };
        let index = self.nodes.len() as u32;
        self.nodes.push(Node::default());
        let (left, right) = items.split_at_mut(middle);
        let children = [self.child(left, depth + 1), self.child(right, depth + 1)];
        self.set(index, children);
        Child { bounds, index, count: 0 }
    }

    fn set(&mut self, index: u32, [a, b]: [Child; 2]) {
        self.nodes[index as usize] = Node {
            lower0: below(a.bounds.lower),
            child0: a.index,
            upper0: above(a.bounds.upper),
            count0: a.count,
            lower1: below(b.bounds.lower),
            child1: b.index,
            upper1: above(b.bounds.upper),
            count1: b.count,
        };
    }
}

/// A box here is met by no segment.
const NOWHERE: f64 = 1e30;

/// Slack of boxes beyond rounding: covers the rounding of the slab test in f32 for coordinates of order 1.
const BOX_SLACK: f64 = 1e-6;

fn below(v: DVec3) -> [f32; 3] {
    v.to_array().map(|x| ((x - BOX_SLACK * (1.0 + x.abs())) as f32).next_down())
}

fn above(v: DVec3) -> [f32; 3] {
    v.to_array().map(|x| ((x + BOX_SLACK * (1.0 + x.abs())) as f32).next_up())
}

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
            let root = build(&boxes, &names, &mut nodes, &mut order).expect("there are primitives");
            let mut seen = vec![0; n];
            let mut stack = vec![(root, 1)];
            while let Some((node, depth)) = stack.pop() {
                assert!(depth < STACK_SIZE);
                let node = nodes[node as usize];
                for (lower, upper, child, count) in [
                    (node.lower0, node.upper0, node.child0, node.count0),
                    (node.lower1, node.upper1, node.child1, node.count1),
                ] {
                    for &name in &order[child as usize..(child + count) as usize] {
                        seen[name as usize] += 1;
                        let b = boxes[name as usize];
                        for axis in 0..3 {
                            assert!(f64::from(lower[axis]) < b.lower[axis] && f64::from(upper[axis]) > b.upper[axis]);
                        }
                    }
                    if count == 0 && lower[0] < 1e29 {
                        stack.push((child, depth + 1));
                    }
                }
            }
            assert!(seen.iter().all(|&times| times == 1), "{n} primitives: {seen:?}");
        }
    }
}
