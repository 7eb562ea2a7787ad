//! The geometry's own flow, where an integrator is asked for.

use super::Arrival;
use crate::geometry::{Elementary, Geodesic, Geometry, RealGeodesic};

/// Follows geodesics by [`Geometry::flow_in`], in one step of any length.
#[derive(Clone, Copy, Debug)]
pub struct Exact;

impl Exact {
    /// The end of a geodesic in the precision `T`, to which start and length are rounded; at infinity, or no number, where
    /// the chart or the numbers do not hold it.
    pub fn follow<T: Elementary, G: Geometry>(&self, geometry: G, g: Geodesic, t: f64) -> Arrival {
        let end = geometry.flow_in::<T>(RealGeodesic::from_f64(g), T::from_f64(t));
        Arrival { end: end.to_f64(), steps: 1 }
    }
}
