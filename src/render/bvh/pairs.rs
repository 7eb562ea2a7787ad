//! Pairs of triangles: two with a common edge make one leaf of a hierarchy, which is half as large then, and their four corners
//! take the place of three in memory. With a hundred thousand triangles that place is what traversal waits for.

use super::Aabb;
use glam::DVec3;
use rayon::prelude::*;

/// A triangle, or two with a common edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pair {
    /// Indices of the triangles; twice the same for one alone.
    pub triangles: [u32; 2],
    /// By which of its corners each begins, so that the first is (a, b, c) and the second (c, b, d).
    pub turns: [u8; 2],
}

/// An edge of a triangle, with a number that is the same for all edges between the same points.
type Edge = (u64, u32, usize);

/// Largest area of the box about a pair, as a share of the areas of its triangles' boxes together. With more, leaves are tested
/// more often than their number saves.
const LARGEST: f64 = 0.7;

impl Pair {
    /// Whether there is no second triangle.
    pub fn is_single(&self) -> bool {
        self.triangles[0] == self.triangles[1]
    }

    /// The box about it.
    pub fn bounds(&self, triangles: &[[DVec3; 3]]) -> Aabb {
        Aabb::around(self.triangles.iter().flat_map(|&index| triangles[index as usize]))
    }
}

/// Divides `among`, indices of different triangles, into pairs: those first whose common box is smallest beside their own. Edges
/// are common if their ends are the same to the last bit, and run against each other, as both triangles show the same side.
pub fn pairs(triangles: &[[DVec3; 3]], among: &[u32]) -> Vec<Pair> {
    let corner = |index: u32, at: usize| triangles[index as usize][at % 3];
    let edges_of = |&index: &u32| {
        [0, 1, 2].map(|at| (mixed(corner(index, at)).wrapping_add(mixed(corner(index, at + 1))), index, at))
    };
    let mut edges: Vec<Edge> = among.par_iter().flat_map_iter(edges_of).collect();
    edges.par_sort_unstable();
    let half_area = |index: u32| Aabb::around(triangles[index as usize]).half_area();
    // Of two edges in which a pair may meet: what they cost.
    let meeting = |&(_, first, i): &Edge, &(_, second, j): &Edge| {
        let common = corner(first, i) == corner(second, j + 1) && corner(first, i + 1) == corner(second, j);
        let pair = Pair { triangles: [first, second], turns: [(i + 2) % 3, j].map(|turn| turn as u8) };
        let share = pair.bounds(triangles).half_area() / (half_area(first) + half_area(second));
        (common && first != second && share <= LARGEST).then_some((share, pair))
    };
    let mut candidates: Vec<(f64, Pair)> = edges
        .par_chunk_by(|a, b| a.0 == b.0)
        .flat_map_iter(|row| row.iter().zip(row.iter().skip(1)).filter_map(|(a, b)| meeting(a, b)))
        .collect();
    candidates.par_sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut free = vec![false; triangles.len()];
    among.iter().for_each(|&index| free[index as usize] = true);
    let mut pairs = Vec::with_capacity(among.len());
    for (_, pair) in candidates {
        let [first, second] = pair.triangles.map(|index| index as usize);
        if free[first] && free[second] {
            free[first] = false;
            free[second] = false;
            pairs.push(pair);
        }
    }
    let single = |&index: &u32| free[index as usize].then_some(Pair { triangles: [index; 2], turns: [0; 2] });
    pairs.extend(among.iter().filter_map(single));
    pairs
}

/// A number of a point's bits.
fn mixed(point: DVec3) -> u64 {
    let mix = |hash: u64, x: f64| (hash ^ x.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    point.to_array().into_iter().fold(0, mix)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Corners of both triangles of a pair as it turns them.
    fn corners(pair: &Pair, triangles: &[[DVec3; 3]]) -> [[DVec3; 3]; 2] {
        std::array::from_fn(|i| {
            let mut corners = triangles[pair.triangles[i] as usize];
            corners.rotate_left(usize::from(pair.turns[i]));
            corners
        })
    }

    /// A square grid of points on a bent sheet, each square of two triangles that begin by any corner.
    fn sheet(side: usize) -> Vec<[DVec3; 3]> {
        let point = |x: usize, y: usize| {
            let [x, y] = [x, y].map(|i| i as f64 / side as f64);
            DVec3::new(x, y, 0.2 * (x * x - y))
        };
        let square = |i: usize| {
            let (x, y) = (i % side, i / side);
            let [a, b, c, d] = [point(x, y), point(x + 1, y), point(x + 1, y + 1), point(x, y + 1)];
            let mut triangles = [[a, b, c], [a, c, d]];
            triangles.iter_mut().zip([i, i / 3]).for_each(|(triangle, turn)| triangle.rotate_left(turn % 3));
            triangles
        };
        (0..side * side).flat_map(square).collect()
    }

    /// The squares of a sheet are its pairs, and each begins so that the common edge is where traversal expects it.
    #[test]
    fn pairs_are_the_squares_of_a_sheet() {
        let triangles = sheet(12);
        let all = Vec::from_iter(0..triangles.len() as u32);
        let pairs = pairs(&triangles, &all);
        assert_eq!(pairs.len(), triangles.len() / 2);
        for pair in &pairs {
            let [first, second] = pair.triangles;
            assert_eq!(first / 2, second / 2, "{pair:?} is no square");
            let [[_, b, c], [also_c, also_b, _]] = corners(pair, &triangles);
            assert_eq!((b, c), (also_b, also_c));
        }
    }

    /// Every triangle is in one pair, whatever is beside it: some asked for and some not, some with a twin in the same place, some
    /// that show the other side, some without an area.
    #[test]
    fn pairs_hold_every_triangle_once() {
        let mut triangles = sheet(9);
        triangles.extend_from_within(0..20);
        triangles.iter_mut().skip(40).step_by(5).for_each(|triangle| triangle.swap(0, 1));
        triangles.extend([[DVec3::ZERO; 3], [DVec3::ZERO; 3], [DVec3::ZERO, DVec3::X, DVec3::ZERO]]);
        let among: Vec<u32> = (0..triangles.len() as u32).filter(|index| index % 7 != 3).collect();
        let pairs = pairs(&triangles, &among);
        let mut seen: Vec<u32> = Vec::new();
        for pair in &pairs {
            seen.push(pair.triangles[0]);
            if !pair.is_single() {
                seen.push(pair.triangles[1]);
                let [[_, b, c], [also_c, also_b, _]] = corners(pair, &triangles);
                assert_eq!((b, c), (also_b, also_c));
            }
        }
        seen.sort_unstable();
        assert_eq!(seen, among);
        assert!(pairs.len() < among.len(), "nothing is paired");
    }
}
