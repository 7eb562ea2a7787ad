//! Reinsertion: branches of a finished tree are taken out and put in again where they cost least (Bittner, Hapala, Havran: Fast
//! insertion-based optimization of bounding volume hierarchies, 2013, section 3). Splits from the top look at one level at a
//! time; this sees where a long thin thing, such as a cell's edge, lies best among all others.

use super::{Aabb, Branch, Kind};
use std::{cmp::Ordering, collections::BinaryHeap};

/// Times that the branches are gone through.
const PASSES: usize = 3;

/// Most branches that are taken out in a pass: the largest, in which most rays are.
const MOST: usize = 2048;

/// Makes the sum of the areas of all branches smaller, if it is one. The root stays at its index; children may come behind their
/// parents.
pub(super) fn improve(branches: &mut [Branch], root: usize) {
    // Something has no end: no place is better than another.
    if !branches[root].bounds.half_area().is_finite() {
        return;
    }
    let mut tree = Tree { parents: vec![root; branches.len()], branches, root };
    for parent in 0..tree.branches.len() {
        if let Kind::Fork(left, right) = tree.branches[parent].kind {
            tree.parents[left] = parent;
            tree.parents[right] = parent;
        }
    }
    for _ in 0..PASSES {
        let mut candidates: Vec<(f64, usize)> =
            tree.branches.iter().map(|branch| branch.bounds.half_area()).zip(0..).collect();
        candidates.sort_by(|a, b| b.0.total_cmp(&a.0));
        let before = tree.area();
        for &(_, branch) in candidates.iter().take(MOST) {
            tree.reinsert(branch);
        }
        if tree.area() > 0.999 * before {
            break;
        }
    }
}

struct Tree<'a> {
    branches: &'a mut [Branch],
    /// The root's is itself.
    parents: Vec<usize>,
    root: usize,
}

/// A place to insert at, by what insertion adds to the branches above it.
struct Place {
    added: f64,
    branch: usize,
}

impl PartialEq for Place {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Place {}

impl PartialOrd for Place {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Place {
    /// The least is first in a heap.
    fn cmp(&self, other: &Self) -> Ordering {
        other.added.total_cmp(&self.added).then(other.branch.cmp(&self.branch))
    }
}

impl Tree<'_> {
    fn area(&self) -> f64 {
        self.branches.iter().map(|branch| branch.bounds.half_area()).sum()
    }

    /// Takes a branch out together with its fork, and puts both in again, maybe where they were.
    fn reinsert(&mut self, branch: usize) {
        let fork = self.parents[branch];
        if branch == self.root || fork == self.root {
            return;
        }
        let Kind::Fork(left, right) = self.branches[fork].kind else { return };
        let sibling = if left == branch { right } else { left };
        let above = self.parents[fork];
        self.replace(above, fork, sibling);
        self.refit(above);
        let place = self.cheapest(self.branches[branch].bounds, sibling);
        let above = self.parents[place];
        self.replace(above, place, fork);
        self.branches[fork].kind = Kind::Fork(branch, place);
        self.parents[place] = fork;
        self.refit(fork);
    }

    /// Puts a child in another one's place.
    fn replace(&mut self, parent: usize, old: usize, new: usize) {
        if let Kind::Fork(left, right) = &mut self.branches[parent].kind {
            *(if *left == old { left } else { right }) = new;
        }
        self.parents[new] = parent;
    }

    /// Fits the boxes of a fork and of those above it to their children.
    fn refit(&mut self, mut fork: usize) {
        loop {
            if let Kind::Fork(left, right) = self.branches[fork].kind {
                self.branches[fork].bounds = self.branches[left].bounds.union(self.branches[right].bounds);
            }
            if fork == self.root {
                return;
            }
            fork = self.parents[fork];
        }
    }

    /// The branch, but not the root, beside which a box adds least to the sum of all areas; `otherwise` if there is no such sum.
    fn cheapest(&self, bounds: Aabb, otherwise: usize) -> usize {
        let least = bounds.half_area();
        let mut best = (f64::INFINITY, otherwise);
        let mut places = BinaryHeap::from([Place { added: 0.0, branch: self.root }]);
        while let Some(Place { added, branch }) = places.pop() {
            if added + least >= best.0 {
                break;
            }
            let here = &self.branches[branch];
            let together = here.bounds.union(bounds).half_area();
            if branch != self.root && added + together < best.0 {
                best = (added + together, branch);
            }
            if let Kind::Fork(left, right) = here.kind {
                let added = added + together - here.bounds.half_area();
                places.extend([left, right].map(|branch| Place { added, branch }));
            }
        }
        best.1
    }
}
