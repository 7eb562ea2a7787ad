//! An observer who walks ten thousand steps through the faces, turning on the way, and returns by the same steps.
//!
//! A rounding at distance d from home moves the way back by d times as much where geodesics part linearly, by e^d where
//! they part exponentially: there he comes home every ten steps.

use super::{Bench, Case, Family, HOST, On, Random, Reading, Trouble, walk};
use crate::{
    geometry::{Geometry, Visitor, visit},
    space::{Space, domain::Domain, observer::Frame, polyhedron::Polyhedron, reduce::TransportError},
};
use glam::{DMat3, DVec3};

const STEPS: usize = 10_000;

pub(super) fn cases() -> Vec<Case> {
    let family = Family { name: "observer", quantity: "from home, in point or axes", on: HOST };
    walk::closed_spaces()
        .map(|space| {
            family.case(&space.name.clone(), "10,000 steps and back", move |_: &mut Bench, _: On| {
                let parts = visit(space.geometry, Parts);
                let leg = if parts { 5 } else { STEPS / 2 };
                let error = visit(space.geometry, Walk(&space, leg)).map_err(|error| Trouble(error.to_string()))?;
                let limit = if parts { 1e-11 } else { 1e-10 };
                Ok(Reading { floor: On::Cpu.rounding() * STEPS as f64, ..Reading::new(error, limit) })
            })
        })
        .collect()
}

/// Whether some geodesics part exponentially: the area of a wavefront after length 6 is far more than 36.
struct Parts;

impl Visitor for Parts {
    type Output = bool;
    fn visit<G: Geometry>(self, geometry: G) -> bool {
        let base = geometry.base();
        let [x, y, z] = geometry.frame(base);
        let along = |v: DVec3| {
            let g = crate::geometry::Geodesic { point: base, velocity: x * v.x + y * v.y + z * v.z };
            geometry.area_density(g, 6.0)
        };
        let mut random = Random(6);
        (0..50).any(|_| along(random.direction()) > 500.0)
    }
}

struct Walk<'a>(&'a Space, usize);

impl Visitor for Walk<'_> {
    type Output = Result<f64, TransportError>;
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let Self(space, leg) = self;
        let domain = Domain::new(space);
        let centre = Polyhedron::new(&space.cells[0]).map_or(DVec3::ZERO, |cell| cell.centroid);
        let point = geometry.unchart(centre).unwrap_or(geometry.base());
        let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
        let home = Frame { cell: 0, point, axes: geometry.frame(point) };
        let home = home.moved(geometry, DVec3::new(0.05, 0.08, 0.03)).rotated(turn);
        let mut random = Random(10_000);
        let mut at = home;
        for _ in 0..STEPS / 2 / leg {
            let steps: Vec<(DVec3, DMat3)> = (0..leg)
                .map(|_| {
                    let turn = DMat3::from_axis_angle(random.direction(), random.within(-1.0, 1.0));
                    (random.vector(0.3), turn)
                })
                .collect();
            for (step, turn) in &steps {
                at = at.walked(geometry, &domain, *step)?.rotated(*turn);
            }
            for (step, turn) in steps.iter().rev() {
                at = at.rotated(turn.transpose()).walked(geometry, &domain, -*step)?;
            }
        }
        if at.cell != home.cell {
            return Ok(f64::INFINITY);
        }
        let axes = (0..3).map(|i| (at.axes[i] - home.axes[i]).abs().max_element());
        Ok(axes.fold((at.point - home.point).abs().max_element(), f64::max))
    }
}
