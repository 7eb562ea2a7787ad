//! Volume in the metric.
//!
//! Each cell is cut into tetrahedra with a common apex inside. Duffy's map takes the unit cube onto a tetrahedron,
//! and a product of Gauss–Legendre rules integrates the density there; it is analytic, so doubling the order until
//! nothing changes gives all digits.

use crate::geometry::Geometry;
use crate::space::polyhedron::Polyhedron;

/// Orders of the rule on each axis. The last one takes well under a second for a dodecahedron.
const ORDERS: [usize; 4] = [8, 16, 32, 64];

/// Relative change at which the volume counts as converged.
const CONVERGED: f64 = 1e-14;

/// Volume of all cells, and the estimated error.
pub(super) fn volume<G: Geometry>(geometry: G, shapes: &[Polyhedron]) -> (f64, f64) {
    shapes.iter().map(|shape| cell_volume(geometry, shape)).fold((0.0, 0.0), |sum, v| (sum.0 + v.0, sum.1 + v.1))
}

fn cell_volume<G: Geometry>(geometry: G, shape: &Polyhedron) -> (f64, f64) {
    let (mut last, mut error) = (f64::NAN, f64::INFINITY);
    for order in ORDERS {
        let rule = gauss_legendre(order);
        let volume =
            shape.face_vertices.iter().map(|outline| face_volume(geometry, shape, outline, &rule)).sum::<f64>();
        error = (volume - last).abs();
        last = volume;
        if error <= CONVERGED * volume {
            break;
        }
    }
    (last, error)
}

/// Volume of the pyramid over a face.
fn face_volume<G: Geometry>(geometry: G, shape: &Polyhedron, outline: &[usize], rule: &[(f64, f64)]) -> f64 {
    let apex = shape.centroid;
    let fan = outline[1..].windows(2);
    fan.map(|pair| {
        let [b, c, d] = [outline[0], pair[0], pair[1]].map(|v| shape.vertices[v]);
        let six = (b - apex).dot((c - apex).cross(d - apex));
        let mut sum = 0.0;
        for &(u, wu) in rule {
            for &(v, wv) in rule {
                for &(w, ww) in rule {
                    let point = apex + ((b - apex) + ((c - b) + (d - c) * w) * v) * u;
                    sum += wu * wv * ww * u * u * v * geometry.volume_density(point);
                }
            }
        }
        six * sum
    })
    .sum()
}

/// Nodes and weights on [0, 1]: Newton's method on the Legendre polynomial.
fn gauss_legendre(order: usize) -> Vec<(f64, f64)> {
    let n = order as f64;
    let node = |i: usize| {
        let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n + 0.5)).cos();
        let mut slope = 1.0;
        // Six steps reach rounding from this start for every order up to thousands.
        for _ in 0..6 {
            let (mut p, mut before) = (x, 1.0);
            for k in 2..=order {
                let k = k as f64;
                (p, before) = (((2.0 * k - 1.0) * x * p - (k - 1.0) * before) / k, p);
            }
            slope = n * (x * p - before) / (x * x - 1.0);
            x -= p / slope;
        }
        (0.5 * (1.0 + x), 1.0 / ((1.0 - x * x) * slope * slope))
    };
    (0..order).map(node).collect()
}
