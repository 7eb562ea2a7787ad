//! The geometry's own flow, where an integrator is asked for.

use super::Arrival;
use crate::geometry::{Geodesic, Geometry};

/// Follows geodesics by [`Geometry::flow`], in one step of any length.
#[derive(Clone, Copy, Debug)]
pub struct Exact;

impl Exact {
    /// The end of a geodesic; at infinity where the chart does not hold it.
    pub fn follow<G: Geometry>(&self, geometry: G, g: Geodesic, t: f64) -> Arrival {
        Arrival { end: geometry.flow(g, t), steps: 1 }
    }
}
