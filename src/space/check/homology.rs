//! First homology: the fundamental group made commutative.
//!
//! Generators are the crossings of faces, one for each pair, without those of a tree that reaches all cells.
//! Relations are the ways round edges; a face that is its own partner is crossed twice without effect.

use super::{CheckError, EdgeCycle};
use crate::space::{FaceId, Space};
use std::collections::HashMap;

/// The invariant factors: finite ones in the order in which they divide each other, then zeros.
pub(super) fn first_homology(space: &Space, cycles: &[EdgeCycle]) -> Result<Vec<u64>, CheckError> {
    let tree = tree_faces(space);
    let mut generator: HashMap<FaceId, (usize, i128)> = HashMap::new();
    let mut count = 0;
    let mut relations: Vec<Vec<(usize, i128)>> = Vec::new();
    for (id, face) in space.faces() {
        if id > face.partner || tree.contains(&id) || tree.contains(&face.partner) {
            continue;
        }
        if id == face.partner {
            relations.push(vec![(count, 2)]);
        } else {
            generator.insert(face.partner, (count, -1));
        }
        generator.insert(id, (count, 1));
        count += 1;
    }
    relations
        .extend(cycles.iter().map(|cycle| cycle.crossed.iter().filter_map(|id| generator.get(id).copied()).collect()));

    let mut matrix = vec![vec![0_i128; count]; relations.len()];
    for (row, relation) in matrix.iter_mut().zip(&relations) {
        for &(column, sign) in relation {
            row[column] += sign;
        }
    }
    let mut factors = smith_diagonal(matrix).ok_or(CheckError::Homology)?;
    factors.resize(count, 0);
    factors.sort_by_key(|&d| (d == 0, d));
    factors.iter().filter(|&&d| d != 1).map(|&d| u64::try_from(d).map_err(|_| CheckError::Homology)).collect()
}

/// Faces across which a walk from cell 0 first meets the other cells.
fn tree_faces(space: &Space) -> Vec<FaceId> {
    let mut reached = vec![false; space.cells.len()];
    reached[0] = true;
    let (mut queue, mut tree) = (vec![0], Vec::new());
    while let Some(cell) = queue.pop() {
        for (face, f) in space.cells[cell].faces.iter().enumerate() {
            if !std::mem::replace(&mut reached[f.partner.cell], true) {
                tree.push(FaceId { cell, face });
                queue.push(f.partner.cell);
            }
        }
    }
    tree
}

/// The non-zero diagonal of Smith's normal form, each entry dividing the next, or `None` on overflow.
fn smith_diagonal(mut m: Vec<Vec<i128>>) -> Option<Vec<i128>> {
    let mut diagonal = Vec::new();
    loop {
        // The smallest entry is the pivot: it keeps numbers small and shrinks with every remainder.
        let entries =
            m.iter().enumerate().flat_map(|(i, row)| row.iter().enumerate().map(move |(j, x)| (x.abs(), i, j)));
        let Some((_, i, j)) = entries.filter(|e| e.0 != 0).min() else { return Some(diagonal) };
        let pivot = m[i][j];
        // Clear its column and its row; what remains is smaller than the pivot.
        let pivot_row = m[i].clone();
        for (k, row) in m.iter_mut().enumerate() {
            let factor = row[j] / pivot;
            if k != i && factor != 0 {
                add_multiple(row, &pivot_row, factor)?;
            }
        }
        for k in 0..m[i].len() {
            let factor = m[i][k] / pivot;
            if k != j && factor != 0 {
                for row in &mut m {
                    row[k] = row[k].checked_sub(row[j].checked_mul(factor)?)?;
                }
            }
        }
        let cleared = m[i].iter().enumerate().all(|(k, &x)| k == j || x == 0)
            && m.iter().enumerate().all(|(k, row)| k == i || row[j] == 0);
        if !cleared {
            continue;
        }
        // The pivot must divide everything else: otherwise a row that it does not divide joins its own.
        match m.iter().position(|row| row.iter().any(|x| x % pivot != 0)) {
            Some(k) => {
                let other = m[k].clone();
                add_multiple(&mut m[i], &other, -1)?;
            }
            None => {
                diagonal.push(pivot.checked_abs()?);
                m.remove(i);
                m.iter_mut().for_each(|row| {
                    row.remove(j);
                });
            }
        }
    }
}

/// `row -= factor · other`.
fn add_multiple(row: &mut [i128], other: &[i128], factor: i128) -> Option<()> {
    for (x, y) in row.iter_mut().zip(other) {
        *x = x.checked_sub(y.checked_mul(factor)?)?;
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::smith_diagonal;

    #[test]
    fn smith_diagonal_of_known_matrices() {
        let known = vec![vec![2, 4, 4], vec![-6, 6, 12], vec![10, -4, -16]];
        assert_eq!(smith_diagonal(known), Some(vec![2, 6, 12]));
        assert_eq!(smith_diagonal(vec![vec![4, 0], vec![0, 6]]), Some(vec![2, 12]));
        assert_eq!(smith_diagonal(vec![vec![0, 0], vec![0, 0]]), Some(vec![]));
        assert_eq!(smith_diagonal(vec![]), Some(vec![]));
        assert_eq!(smith_diagonal(vec![vec![6, 10, 15]]), Some(vec![1]));
        assert_eq!(smith_diagonal(vec![vec![i128::MAX, 2], vec![3, i128::MAX]]), None);
    }
}
