//! Bounding volume hierarchy: one builder for the cpu and the compute backend.
//!
//! Splits by the surface area heuristic with bins (Wald: On fast construction of SAH-based bounding volume hierarchies,
//! 2007) make a binary tree. Of its branches those become nodes, of four children each, that make the whole cheapest
//! (Ylitie, Karras, Laine: Efficient incoherent ray traversal on GPUs through compressed wide BVHs, 2017, section 3.1): a
//! traversal step reads a cache line and decides about four boxes. Boxes lie on a grid of 2¹⁶ lines per axis over the
//! cell's content, rounded outwards: half of the memory traffic of f32 boxes for a loss that is smaller than any triangle
//! worth drawing. Children are sorted along an axis, so that the sign of a direction tells the near ones. A child is a node,
//! a quadric or a pair of triangles. The binary tree of what rests is improved before that, by reinsertion.

pub mod pairs;
mod reinsertion;

use crate::shader_io::{
    LINES, Node, REFERENCE_END_BIT, REFERENCE_NOTHING, REFERENCE_QUADRIC, REFERENCE_SHIFT, REFERENCE_TRIANGLE,
    STACK_SIZE,
};
use glam::{DVec3, Vec3};

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

    /// The box around everything.
    pub const EVERYTHING: Self = Self { lower: DVec3::NEG_INFINITY, upper: DVec3::INFINITY };

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

    /// Its centre.
    pub fn centre(self) -> DVec3 {
        (self.lower + self.upper) * 0.5
    }
}

/// Puts items of one key in a row, and each row in order by places, such that its halves are apart along the axis on which
/// it reaches farthest, and so are their halves, and so on down. What is near in space is near in memory then, and drivers
/// that build their hierarchies by halving lists get good ones (lavapipe of Mesa 25.0 does no more).
pub fn halve<T: Clone, K: Ord>(items: &mut [T], key: impl Fn(&T) -> K, place: impl Fn(&T) -> DVec3) {
    items.sort_by_key(&key);
    for row in items.chunk_by_mut(|a, b| key(a) == key(b)) {
        let mut places: Vec<(Vec3, usize)> = row.iter().map(|item| place(item).as_vec3()).zip(0..).collect();
        halve_places(&mut places);
        let ordered: Vec<T> = places.iter().map(|(_, index)| row[*index].clone()).collect();
        row.clone_from_slice(&ordered);
    }
}

fn halve_places(places: &mut [(Vec3, usize)]) {
    /// Fewer are not worth another thread.
    const WORTH_A_THREAD: usize = 4096;
    if places.len() < 3 {
        return;
    }
    let lower = places.iter().fold(Vec3::INFINITY, |lower, (place, _)| lower.min(*place));
    let upper = places.iter().fold(Vec3::NEG_INFINITY, |upper, (place, _)| upper.max(*place));
    let axis = (upper - lower).max_position();
    let (middle, several) = (places.len().div_ceil(2), places.len() > WORTH_A_THREAD);
    places.select_nth_unstable_by(middle, |(a, _), (b, _)| a[axis].total_cmp(&b[axis]));
    let (first, second) = places.split_at_mut(middle);
    if several {
        rayon::join(|| halve_places(first), || halve_places(second));
    } else {
        halve_places(first);
        halve_places(second);
    }
}

/// Bins per axis; more do not change the trees' cost measurably.
const BINS: usize = 16;
/// Children of a node.
const WIDTH: usize = 4;
/// Most branches above a primitive: each node on the way leaves three children waiting on a traversal's stack.
const MAX_DEPTH: u32 = STACK_SIZE / 3 - 1;

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
const LAST_LINE: f64 = (LINES - 1) as f64;

/// Slack of boxes beyond rounding, in units of their distance from the chart's origin plus 1: covers the rounding of
/// positions and of the slab test in f32.
const BOX_SLACK: f64 = 1e-6;

impl Grid {
    /// The grid over all that lies in the bounds.
    pub fn new(bounds: Aabb) -> Self {
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
pub fn build(primitives: &[(Aabb, Primitive)], nodes: &mut Vec<Node>, effort: Effort) -> Option<Tree> {
    let (mut branches, root) = binary(primitives.iter().copied())?;
    let grid = Grid::new(branches[root].bounds);
    if let Effort::High = effort {
        reinsertion::improve(&mut branches, root);
    }
    let mut costs = vec![[0.0; WIDTH]; branches.len()];
    fill_costs(&mut costs, &branches, root);
    let first = nodes.len();
    let mut collapse = Collapse { branches: &branches, costs: &costs, nodes, grid, levels: 0 };
    let node = match branches[root].kind {
        Kind::Primitive(_) => collapse.finish(first, &mut [(root, Reference::Nothing)]),
        Kind::Fork(..) => collapse.node(root, 1),
    };
    // Beside each node above three others may wait, and a fourth place is written to in vain.
    let stack = 3 * collapse.levels.max(1) + 1;
    if stack > STACK_SIZE {
        // What was put in again has made the tree too deep.
        nodes.truncate(first);
        return build(primitives, nodes, Effort::Low);
    }
    Some(Tree { stack, root: node.word(), grid })
}

/// How much work a tree is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// It is for one picture of a sequence.
    Low,
    /// It is for many.
    High,
}

/// Boxes in which all of `boxes` are: one, two and so on to `most`, or as many as there are, as small as splits by the surface
/// area heuristic make them.
pub fn covers(boxes: &[Aabb], most: usize) -> Vec<Vec<Aabb>> {
    let named = boxes.iter().copied().zip((0..).map(Primitive::Quadric));
    let Some((branches, root)) = binary(named) else { return Vec::new() };
    let mut cover = vec![root];
    let mut covers = Vec::with_capacity(most);
    while covers.len() < most {
        covers.push(cover.iter().map(|&branch| branches[branch].bounds).collect());
        let forks = cover.iter().zip(0..).filter_map(|(&branch, place)| match branches[branch].kind {
            Kind::Fork(left, right) => Some((branches[branch].bounds.half_area(), place, left, right)),
            Kind::Primitive(_) => None,
        });
        let Some((_, place, left, right)) = forks.max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
        cover[place] = left;
        cover.push(right);
    }
    covers
}

#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    centre: DVec3,
    primitive: Primitive,
}

fn bounds(items: &[Item]) -> Aabb {
    items.iter().fold(Aabb::EMPTY, |b, item| b.union(item.bounds))
}

/// A branch of the binary tree.
struct Branch {
    bounds: Aabb,
    kind: Kind,
}

/// Expected number of nodes visited, times an area, if a branch becomes at most 1, 2, 3, 4 children of one node.
type Cost = [f64; WIDTH];

#[derive(Clone, Copy)]
enum Kind {
    Primitive(Primitive),
    /// Indices of two branches.
    Fork(usize, usize),
}

/// The binary tree of primitives: its branches and the index of its root; none without primitives.
fn binary(primitives: impl Iterator<Item = (Aabb, Primitive)>) -> Option<(Vec<Branch>, usize)> {
    let item = |(bounds, primitive): (Aabb, Primitive)| Item { bounds, centre: bounds.centre(), primitive };
    let mut items: Vec<Item> = primitives.map(item).collect();
    let mut branches = Vec::with_capacity(2 * items.len());
    (!items.is_empty()).then(|| grow(&mut branches, &mut items, 0)).map(|root| (branches, root))
}

/// Grows the branch of one item or more; returns its index.
fn grow(branches: &mut Vec<Branch>, items: &mut [Item], depth: u32) -> usize {
    let bounds = bounds(items);
    let kind = if let [only] = items {
        Kind::Primitive(only.primitive)
    } else {
        let middle = split(items, depth);
        let (left, right) = items.split_at_mut(middle);
        Kind::Fork(grow(branches, left, depth + 1), grow(branches, right, depth + 1))
    };
    branches.push(Branch { bounds, kind });
    branches.len() - 1
}

/// Notes the costs of a branch and of all below it; those of primitives are 0.
fn fill_costs(costs: &mut [Cost], branches: &[Branch], branch: usize) {
    let Kind::Fork(left, right) = branches[branch].kind else { return };
    fill_costs(costs, branches, left);
    fill_costs(costs, branches, right);
    let apart = |count: usize| shares(costs, (left, right), count).0;
    let mut cost = [branches[branch].bounds.half_area() + apart(WIDTH); WIDTH];
    for count in 2..=WIDTH {
        cost[count - 1] = cost[count - 2].min(apart(count));
    }
    costs[branch] = cost;
}

/// The cheapest way to make at most `count` children of two branches: its cost, and how many each gets.
fn shares(costs: &[Cost], (left, right): (usize, usize), count: usize) -> (f64, usize, usize) {
    let share = |k: usize| (costs[left][k - 1] + costs[right][count - k - 1], k, count - k);
    (1..count).map(share).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, 1, 1))
}

/// Makes nodes of branches.
struct Collapse<'a> {
    branches: &'a [Branch],
    costs: &'a [Cost],
    nodes: &'a mut Vec<Node>,
    grid: Grid,
    /// Nodes from the root to the deepest one.
    levels: u32,
}

impl Collapse<'_> {
    /// The reference of the node that a fork becomes.
    fn node(&mut self, branch: usize, level: u32) -> Reference {
        let index = self.nodes.len();
        self.nodes.push(Node::default());
        self.levels = self.levels.max(level);
        let mut children = Vec::with_capacity(WIDTH);
        if let Kind::Fork(left, right) = self.branches[branch].kind {
            self.gather(&mut children, (left, right), WIDTH);
        }
        for (child, reference) in &mut children {
            if let Kind::Fork(..) = self.branches[*child].kind {
                *reference = self.node(*child, level + 1);
            }
        }
        self.finish(index, &mut children)
    }

    /// Collects what a fork becomes if it becomes at most `count` children.
    fn gather(&self, children: &mut Vec<(usize, Reference)>, fork: (usize, usize), count: usize) {
        let (_, of_left, of_right) = shares(self.costs, fork, count);
        for (branch, count) in [(fork.0, of_left), (fork.1, of_right)] {
            let (kind, cost) = (&self.branches[branch].kind, self.costs[branch]);
            let enough = (1..=count).find(|k| cost[k - 1] <= cost[count - 1]).unwrap_or(1);
            match *kind {
                Kind::Fork(left, right) if enough > 1 => self.gather(children, (left, right), enough),
                _ => children.push((branch, Reference::Nothing)),
            }
        }
    }

    /// Writes a node about branches, of which forks have their reference; returns the node's.
    fn finish(&mut self, index: usize, children: &mut [(usize, Reference)]) -> Reference {
        let centre = |(branch, _): &(usize, Reference)| self.branches[*branch].bounds.centre();
        let spread = Aabb::around(children.iter().map(centre));
        let axis = (spread.upper - spread.lower).max_position();
        children.sort_by(|a, b| centre(a)[axis].total_cmp(&centre(b)[axis]));
        // A box of one point where there is no child.
        let mut lines = [[u32::MAX; WIDTH]; 3];
        let mut references = [Reference::Nothing.word(); WIDTH];
        for (i, (branch, reference)) in children.iter().enumerate() {
            let Branch { bounds, kind, .. } = &self.branches[*branch];
            let of_child = self.grid.lines(*bounds);
            (0..3).for_each(|axis| lines[axis][i] = of_child[axis]);
            references[i] = match kind {
                Kind::Primitive(primitive) => Reference::Primitive(*primitive).word(),
                Kind::Fork(..) => reference.word(),
            };
        }
        let [x, y, z] = lines;
        let node = Node { x, y, z, children: references };
        match self.nodes.get_mut(index) {
            Some(place) => *place = node,
            None => self.nodes.push(node),
        }
        Reference::Node(index as u32, axis as u32)
    }
}

/// What rays can hit, by its index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Primitive {
    /// A triangle: twice the index of its [pair](pairs::Pair), and one more for the second of it. A leaf names the first.
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

// Shaders tell nodes by their lack of a bit.
const _: () = {
    const fn has_bit(kind: u32) -> bool {
        (kind << REFERENCE_SHIFT) & (1 << REFERENCE_END_BIT) != 0
    }
    assert!(has_bit(REFERENCE_NOTHING) && has_bit(REFERENCE_TRIANGLE) && has_bit(REFERENCE_QUADRIC));
    assert!(!has_bit(0) && !has_bit(1) && !has_bit(2));
};

/// Most primitives and most nodes that references can name: triangles may all be in pairs alone.
pub const MAX_PRIMITIVES: usize = 1 << (REFERENCE_SHIFT - 1);

/// Reorders two items or more and says where to cut.
fn split(items: &mut [Item], depth: u32) -> usize {
    let halves = items.len() / 2;
    let centres = Aabb::around(items.iter().map(|item| item.centre));
    let extent = centres.upper - centres.lower;
    let levels = items.len().next_power_of_two().ilog2();
    if depth + levels >= MAX_DEPTH || extent.max_element() <= 0.0 {
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

    /// Names of the primitives in a tree, sorted.
    fn names(primitives: &[(Aabb, Primitive)], effort: Effort) -> Vec<u32> {
        let mut nodes = Vec::new();
        let tree = build(primitives, &mut nodes, effort).expect("there are primitives");
        assert!(tree.stack <= STACK_SIZE);
        let (mut stack, mut names) = (vec![tree.root], Vec::new());
        while let Some(word) = stack.pop() {
            assert!(names.len() + stack.len() <= 4 * primitives.len(), "a node is below itself");
            match Reference::read(word) {
                Reference::Node(node, _) => stack.extend(nodes[node as usize].children),
                Reference::Primitive(Primitive::Triangle(name) | Primitive::Quadric(name)) => names.push(name),
                Reference::Nothing => {}
            }
        }
        names.sort_unstable();
        names
    }

    /// Boxes each inside the next belong in a chain, which is deeper than a stack: then the tree is what splits make of it.
    #[test]
    fn bvh_takes_boxes_inside_of_boxes() {
        let bounds = |i: u32| Aabb { lower: DVec3::splat(-1.01_f64.powi(i as i32)), upper: DVec3::splat(1.0) };
        let all: Vec<_> = (0..8000).map(|i| (bounds(i), Primitive::Quadric(i))).collect();
        for effort in [Effort::Low, Effort::High] {
            assert_eq!(names(&all, effort), Vec::from_iter(0..8000), "{effort:?}");
        }
    }

    /// Some boxes have no end: balls that reach the horizon.
    #[test]
    fn bvh_takes_boxes_without_end() {
        for everywhere in [0_u32, 7, 23] {
            let place = |i: u32| DVec3::new(f64::from(i), f64::from(i * i % 7), f64::from(i % 3));
            let bounds = |i| match i == everywhere {
                true => Aabb::EVERYTHING,
                false => Aabb { lower: place(i), upper: place(i) + 0.5 },
            };
            let all: Vec<_> = (0..24).map(|i| (bounds(i), Primitive::Quadric(i))).collect();
            for effort in [Effort::Low, Effort::High] {
                assert_eq!(names(&all, effort), Vec::from_iter(0..24), "{everywhere}, {effort:?}");
            }
        }
    }

    /// Every primitive is in exactly one leaf, inside the boxes above it, and no path is deeper than the stack.
    #[test]
    fn bvh_holds_every_primitive_once() {
        for (n, effort) in [1_usize, 2, 3, 17, 1000].iter().flat_map(|&n| [(n, Effort::Low), (n, Effort::High)]) {
            let boxes: Vec<Aabb> = (0..n)
                .map(|i| {
                    let t = i as f64 * 0.618_033_988_7;
                    let p = DVec3::new(t.fract(), (t * 7.3).fract(), if n == 17 { 0.0 } else { (t * 3.1).fract() });
                    Aabb { lower: p, upper: p + 0.01 }
                })
                .collect();
            let named: Vec<_> = (0..).zip(&boxes).map(|(i, b)| (*b, Primitive::Quadric(i))).collect();
            let mut nodes = Vec::new();
            let tree = build(&named, &mut nodes, effort).expect("there are primitives");
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
