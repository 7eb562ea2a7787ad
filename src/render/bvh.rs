//! Bounding volume hierarchy: one builder for the cpu and the compute backend.
//!
//! Splits by the surface area heuristic with bins (Wald: On fast construction of SAH-based bounding volume hierarchies,
//! 2007), two levels of which make a node of four children (Wald, Benthin, Boulos: Getting rid of packets, 2008, section
//! 3): a traversal step reads a cache line and decides about four boxes. Boxes lie on a grid of 2¹⁶ lines per axis over the
//! cell's content, rounded outwards: half of the memory traffic of f32 boxes for a loss that is smaller than any triangle
//! worth drawing. Children are sorted along an axis, so that the sign of a direction tells the near ones. A child is a node
//! or a single primitive.

use crate::shader_io::{Node, REFERENCE_NOTHING, REFERENCE_QUADRIC, REFERENCE_SHIFT, REFERENCE_TRIANGLE, STACK_SIZE};
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

/// Bins per axis; more do not change the trees' cost measurably.
const BINS: usize = 16;
/// Children of a node.
const WIDTH: usize = 4;
/// Depth from which nodes are quartered by count, which leaves at most 14 more levels of nodes below. Each node above a
/// traversal's has three children waiting at most.
const HALVE_FROM_DEPTH: u32 = STACK_SIZE / 3 - 14;
/// A cell's hierarchy: where its root is, and the grid of its boxes.
#[derive(Clone, Copy, Debug)]
pub struct Tree {
    /// Entries that a stack needs.
    pub stack: u32,
    /// Reference of the root.
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

/// Appends the tree of primitives to `nodes`, from the box of each. `None` without primitives.
pub fn build(primitives: &[(Aabb, Primitive)], nodes: &mut Vec<Node>) -> Option<Tree> {
    let mut items: Vec<Item> =
        primitives.iter().map(|&(bounds, primitive)| Item::new(bounds, Reference::Primitive(primitive))).collect();
    let grid = Grid::new(bounds(&items));
    let mut builder = Builder { nodes, grid, levels: 1 };
    let root = match &mut items[..] {
        [] => return None,
        [only] => builder.finish(builder.nodes.len(), &[*only], 0),
        several => builder.node(several, 0),
    };
    // Beside each node above three others may wait, and a fourth place is written to in vain.
    Some(Tree { stack: 3 * builder.levels + 1, root: root.word(), grid })
}

/// A primitive or a node.
#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    centre: DVec3,
    reference: u32,
}

impl Item {
    fn new(bounds: Aabb, reference: Reference) -> Self {
        Self { bounds, centre: bounds.centre(), reference: reference.word() }
    }
}

struct Builder<'a> {
    nodes: &'a mut Vec<Node>,
    grid: Grid,
    /// Nodes from the root to the deepest one.
    levels: u32,
}

impl Builder<'_> {
    /// The reference of a node about two items or more.
    fn node(&mut self, items: &mut [Item], depth: u32) -> Reference {
        let index = self.nodes.len();
        self.levels = self.levels.max(depth + 1);
        self.nodes.push(Node::default());
        let (groups, axis) = groups(items, depth);
        let mut children = Vec::with_capacity(WIDTH);
        for Group { items, bounds } in groups {
            children.push(match items {
                [only] => *only,
                several => Item::new(bounds, self.node(several, depth + 1)),
            });
        }
        self.finish(index, &children, axis)
    }

    /// Writes a node and returns its reference.
    fn finish(&mut self, index: usize, children: &[Item], axis: u32) -> Reference {
        // A box of one point where there is no child.
        let mut lines = [[u32::MAX; WIDTH]; 3];
        let mut references = [Reference::Nothing.word(); WIDTH];
        for (i, child) in children.iter().enumerate() {
            let of_child = self.grid.lines(child.bounds);
            (0..3).for_each(|axis| lines[axis][i] = of_child[axis]);
            references[i] = child.reference;
        }
        let [x, y, z] = lines;
        let node = Node { x, y, z, children: references };
        match self.nodes.get_mut(index) {
            Some(place) => *place = node,
            None => self.nodes.push(node),
        }
        Reference::Node(index as u32, axis)
    }
}

fn bounds(items: &[Item]) -> Aabb {
    items.iter().fold(Aabb::EMPTY, |b, item| b.union(item.bounds))
}

/// What becomes a child of a node.
struct Group<'a> {
    items: &'a mut [Item],
    bounds: Aabb,
}

impl<'a> Group<'a> {
    fn new(items: &'a mut [Item]) -> Self {
        Self { bounds: bounds(items), items }
    }
}

/// The items of a node by children, and the axis along which these are sorted. The largest group is split until there are
/// enough.
fn groups(items: &mut [Item], depth: u32) -> (Vec<Group<'_>>, u32) {
    let size = |group: &Group<'_>| match depth {
        HALVE_FROM_DEPTH.. => group.items.len() as f64,
        _ => group.bounds.half_area(),
    };
    let mut groups = vec![Group::new(items)];
    while groups.len() < WIDTH {
        let open = groups.iter().enumerate().filter(|(_, group)| group.items.len() > 1);
        let Some((largest, _)) = open.max_by(|(_, a), (_, b)| size(a).total_cmp(&size(b))) else { break };
        let Group { items, .. } = groups.swap_remove(largest);
        let middle = split(items, depth);
        groups.extend(<[_; 2]>::from(items.split_at_mut(middle)).map(Group::new));
    }
    let spread = Aabb::around(groups.iter().map(|group| group.bounds.centre()));
    let axis = (spread.upper - spread.lower).max_position();
    groups.sort_by(|a, b| a.bounds.centre()[axis].total_cmp(&b.bounds.centre()[axis]));
    (groups, axis as u32)
}

/// What rays can hit, by its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Primitive {
    /// A triangle.
    Triangle(u32),
    /// A quadric.
    Quadric(u32),
}

/// What a reference means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// Index of a node and the axis along which its children are sorted.
    Node(u32, u32),
    /// A primitive.
    Primitive(Primitive),
    /// Nothing is there.
    Nothing,
}

impl Reference {
    /// From its word.
    pub fn read(word: u32) -> Self {
        let index = word & ((1 << REFERENCE_SHIFT) - 1);
        match word >> REFERENCE_SHIFT {
            axis if axis < REFERENCE_NOTHING => Self::Node(index, axis),
            REFERENCE_TRIANGLE => Self::Primitive(Primitive::Triangle(index)),
            REFERENCE_QUADRIC => Self::Primitive(Primitive::Quadric(index)),
            _ => Self::Nothing,
        }
    }

    /// Its word.
    pub fn word(self) -> u32 {
        match self {
            Self::Node(index, axis) => index | axis << REFERENCE_SHIFT,
            Self::Primitive(Primitive::Triangle(index)) => index | REFERENCE_TRIANGLE << REFERENCE_SHIFT,
            Self::Primitive(Primitive::Quadric(index)) => index | REFERENCE_QUADRIC << REFERENCE_SHIFT,
            Self::Nothing => REFERENCE_NOTHING << REFERENCE_SHIFT,
        }
    }
}

/// Most primitives and most nodes that references can name.
pub const MAX_PRIMITIVES: usize = 1 << REFERENCE_SHIFT;

/// Reorders two items or more and says where to cut.
fn split(items: &mut [Item], depth: u32) -> usize {
    let halves = items.len() / 2;
    let centres = Aabb::around(items.iter().map(|item| item.centre));
    let extent = centres.upper - centres.lower;
    if depth >= HALVE_FROM_DEPTH || extent.max_element() <= 0.0 {
        return halves;
    }
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
    let Some((_, axis, bin)) = best else { return halves };
    let (lower, width) = (centres.lower[axis], extent[axis]);
    let mut middle = 0;
    for i in 0..items.len() {
        if bin_of(items[i].centre[axis], lower, width) <= bin {
            items.swap(i, middle);
            middle += 1;
        }
    }
    middle
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
            let named: Vec<_> = (0..).zip(&boxes).map(|(i, b)| (*b, Primitive::Quadric(i))).collect();
            let mut nodes = Vec::new();
            let tree = build(&named, &mut nodes).expect("there are primitives");
            let mut seen = vec![0; n];
            let mut stack = vec![tree.root];
            while let Some(word) = stack.pop() {
                let Reference::Node(node, _) = Reference::read(word) else { panic!("only nodes are put there") };
                let node = nodes[node as usize];
                for i in 0..WIDTH {
                    match Reference::read(node.children[i]) {
                        Reference::Node(..) => stack.push(node.children[i]),
                        Reference::Primitive(Primitive::Quadric(name)) => {
                            seen[name as usize] += 1;
                            let b = boxes[name as usize];
                            for (axis, line) in [node.x[i], node.y[i], node.z[i]].into_iter().enumerate() {
                                let at = |line: u32| f64::from(line) / tree.grid.scale[axis] + tree.grid.lower[axis];
                                assert!(at(line & 0xffff) < b.lower[axis] && at(line >> 16) > b.upper[axis]);
                            }
                        }
                        other => assert_eq!(other, Reference::Nothing),
                    }
                }
                assert!(stack.len() <= tree.stack as usize && tree.stack <= STACK_SIZE);
            }
            assert!(seen.iter().all(|&times| times == 1), "{n} primitives: {seen:?}");
        }
    }
}
