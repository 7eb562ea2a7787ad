//! Deck elements in whole numbers, against the groups themselves: the Heisenberg group over the integers, and pairs of a
//! number of Z[φ] and a height.

use crate::support::Random;
use holonomy::{
    geometry::{Geometry, Visitor, visit},
    space::{
        catalogue,
        deck::{
            Elements,
            integers::{Integers, Lattice},
        },
        domain::Domain,
    },
};
use std::collections::HashMap;

fn domain(name: &str) -> Domain {
    Domain::new(&catalogue::find(name).expect("a named space"))
}

fn lattice(name: &str) -> Lattice {
    domain(name).lattice.unwrap_or_else(|| panic!("{name} has integers"))
}

/// A group whose elements are three integers, with one generator for each pair of faces: that of the odd face.
trait Group {
    fn product(a: [i128; 3], b: [i128; 3]) -> [i128; 3];
    fn inverse(a: [i128; 3]) -> [i128; 3];
    /// Powers of the generators whose product, from left to right, is the element.
    fn word(a: [i128; 3]) -> Vec<(usize, i128)>;
}

/// (x, y, z)(x′, y′, z′) = (x + x′, y + y′, z + z′ + x y′).
struct Heisenberg;

impl Group for Heisenberg {
    fn product([x, y, z]: [i128; 3], [u, v, w]: [i128; 3]) -> [i128; 3] {
        [x + u, y + v, z + w + x * v]
    }
    fn inverse([x, y, z]: [i128; 3]) -> [i128; 3] {
        [-x, -y, x * y - z]
    }
    fn word([x, y, z]: [i128; 3]) -> Vec<(usize, i128)> {
        vec![(1, y), (0, x), (2, z)]
    }
}

/// (α, n)(β, m) = (α + φ²ⁿβ, n + m) for α = p + qφ: b₁ is φ, b₂ is 1.
struct Golden;

impl Golden {
    /// φ^power times p + qφ.
    fn grown([mut p, mut q]: [i128; 2], power: i128) -> [i128; 2] {
        for _ in 0..power.abs() {
            [p, q] = if power > 0 { [q, p + q] } else { [q - p, p] };
        }
        [p, q]
    }
}

impl Group for Golden {
    fn product([p, q, n]: [i128; 3], [r, s, m]: [i128; 3]) -> [i128; 3] {
        let [r, s] = Self::grown([r, s], 2 * n);
        [p + r, q + s, n + m]
    }
    fn inverse([p, q, n]: [i128; 3]) -> [i128; 3] {
        let [p, q] = Self::grown([p, q], -2 * n);
        [-p, -q, -n]
    }
    fn word([p, q, n]: [i128; 3]) -> Vec<(usize, i128)> {
        vec![(0, q), (1, p), (2, n)]
    }
}

/// The generator of a pair of faces in the group's own numbers.
fn generator<T: Group>(pair: usize) -> [i128; 3] {
    // The one of the three elements of length one whose word is that generator.
    let units = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    let is_it = |unit: &[i128; 3]| T::word(*unit).iter().all(|&(of, power)| power == i128::from(of == pair));
    units.into_iter().find(is_it).expect("a unit vector")
}

fn power(base: &Integers, exponent: u128) -> Integers {
    let (mut result, mut square, mut left) = (Integers::IDENTITY, *base, exponent);
    while left > 0 {
        if left & 1 == 1 {
            result = result.after(&square).expect("it fits");
        }
        left >>= 1;
        if left > 0 {
            square = square.after(&square).expect("it fits");
        }
    }
    result
}

/// The integers of an element from its normal form. The pairing of an odd face is its generator, of an even one the
/// inverse.
fn normal_form<T: Group>(lattice: &Lattice, element: [i128; 3]) -> Integers {
    T::word(element).into_iter().fold(Integers::IDENTITY, |sofar, (pair, exponent)| {
        let pairing = &lattice.pairings[2 * pair + usize::from(exponent > 0)];
        sofar.after(&power(pairing, exponent.unsigned_abs())).expect("it fits")
    })
}

/// Words of `count` letters: heights stay within `height` so that numbers of Z[φ] fit.
fn words<T: Group>(name: &str, count: usize, height: i128, spoil: bool) -> bool {
    let lattice = lattice(name);
    let mut random = Random(2718);
    (0..20).all(|_| {
        let mut element = [0; 3];
        let mut faces = Vec::with_capacity(count);
        while faces.len() < count {
            let face = (6.0 * random.next()) as usize;
            let by = generator::<T>(face / 2);
            let by = if face % 2 == 1 { by } else { T::inverse(by) };
            // Crossing a face multiplies on the left.
            let next = T::product(by, element);
            if next[2].abs() <= height {
                element = next;
                faces.push(face);
            }
        }
        if spoil {
            element = T::product(element, generator::<T>(2));
        }
        lattice.word(faces).expect("it fits") == normal_form::<T>(&lattice, element)
    })
}

#[test]
fn deck_words_of_thousands_of_letters_are_exact() {
    assert!(words::<Heisenberg>("nil-heisenberg", 5000, i128::MAX, false));
    assert!(words::<Golden>("sol-golden", 5000, 20, false));
    assert!(!words::<Heisenberg>("nil-heisenberg", 5000, i128::MAX, true), "a label off by one passes");
    assert!(!words::<Golden>("sol-golden", 5000, 20, true), "a label off by one passes");
}

/// The relations of the group, and that a word too large for 128 bits is refused.
#[test]
fn deck_numbers_that_outgrow_their_type_are_refused() {
    let lattice = lattice("sol-golden");
    assert!(lattice.word(vec![5; 60]).is_some());
    assert_eq!(lattice.word(vec![5; 200]), None);
    assert_eq!(lattice.word(vec![5, 4, 0, 1]), Some(Integers::IDENTITY));
}

/// Which spaces have integers: the flat ones, the finite ones of right angles, and the two bundles.
#[test]
fn deck_integers_are_found_where_there_is_a_lattice() {
    for name in catalogue::NAMES {
        let found = domain(name).lattice.is_some();
        let none = ["poincare", "seifert-weber", "mirrored-dodecahedron", "s2xs1", "genus2xs1", "sl2-genus2-tangent"];
        assert_eq!(found, !none.contains(name), "{name}");
    }
}

/// From far away, round a small loop: the element is known again, and its neighbour along the fibre is another one.
struct Far<'a> {
    domain: &'a Domain,
    steps: usize,
}

impl Visitor for Far<'_> {
    /// Whether the loop closes, and whether the neighbour is new.
    type Output = [bool; 2];
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let mut elements = Elements::new(geometry, self.domain, 0);
        // First along y, then along x, which shears the way along y into the fibre.
        let out = std::iter::repeat_n(3, self.steps).chain(std::iter::repeat_n(1, self.steps));
        let far = out.fold(0, |at, face| elements.cross(self.domain, at, face).0);
        // x y x⁻¹ y⁻¹, and back along the fibre.
        let ring = [1, 3, 0, 2].iter().fold(far, |at, face| elements.cross(self.domain, at, *face).0);
        let (beside, is_new) = elements.cross(self.domain, far, 5);
        let closed = [4, 5].iter().any(|face| elements.cross(self.domain, ring, *face).0 == far);
        [closed, is_new || beside == ring]
    }
}

#[test]
fn deck_elements_far_away_are_told_apart() {
    let mut domain = domain("nil-heisenberg");
    let id = catalogue::find("nil-heisenberg").expect("a named space").geometry;
    assert_eq!(visit(id, Far { domain: &domain, steps: 3000 }), [true, true]);
    // With two generators confused the loop does not close.
    let mut confused = domain.clone();
    confused.lattice.as_mut().expect("a lattice").pairings.swap(0, 2);
    assert_ne!(visit(id, Far { domain: &confused, steps: 3000 }), [true, true]);
    // Images of a point tell elements apart as well, as far as their digits go: z is 10⁷ here.
    domain.lattice = None;
    assert_eq!(visit(id, Far { domain: &domain, steps: 3000 }), [true, true]);
}

/// Both ways of telling elements apart agree near the base point.
#[test]
fn deck_tables_are_the_same_with_and_without_integers() {
    struct Table<'a>(&'a Domain);
    impl Visitor for Table<'_> {
        type Output = Vec<u32>;
        fn visit<G: Geometry>(self, geometry: G) -> Vec<u32> {
            holonomy::space::deck::label_table(geometry, self.0, 0, 4)
        }
    }
    let mut sizes = HashMap::new();
    for name in ["torus", "hantzsche-wendt", "nil-heisenberg", "sol-golden", "s3"] {
        let mut domain = domain(name);
        let id = catalogue::find(name).expect("a named space").geometry;
        let exact = visit(id, Table(&domain));
        domain.lattice = None;
        assert!(exact == visit(id, Table(&domain)), "{name}");
        sizes.insert(name, exact.len() / domain.faces.len());
    }
    // 1 + 6 + 18 + 38 + 66 cubes within four steps.
    assert_eq!(sizes["torus"], 129);
}
