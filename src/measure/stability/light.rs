//! Lights where their light has no bound: on a surface, at the viewer's eye, and where all rays from a point meet again.
//!
//! The picture must be that with the light a hair's breadth beside, and have no pixel that is no colour.

use super::{Bench, Case, Family, On, PICTURES, Reading, Trouble, picture};
use crate::{
    geometry::{Geodesic, Geometry, Visitor, visit},
    measure::stability::picture::Middle,
    scene::{Place, Scene, Shape},
    space::{Space, domain::Domain, observer::Frame, reduce::transport},
};
use glam::{DVec3, DVec4};
use std::f64::consts::PI;

/// How far beside, in units of the ball's distance.
const HAIR: f64 = 1e-5;

#[derive(Clone, Copy)]
enum Spot {
    Surface,
    Eye,
    Conjugate,
}

/// The cases of a space.
pub(super) fn cases(space: &Space) -> Vec<Case> {
    let family = Family { name: "light", quantity: "share of pixels that are no colour, or not beside", on: PICTURES };
    let mut spots = vec![(Spot::Surface, "on a surface"), (Spot::Eye, "at distance zero from the eye")];
    if visit(space.geometry, Meets) {
        spots.push((Spot::Conjugate, "where all rays from a surface meet"));
    }
    let case = |(spot, what): (Spot, &'static str)| {
        let space = space.clone();
        family.case(&space.name.clone(), what, move |bench, on| judge(bench, on, &space, spot))
    };
    spots.into_iter().map(case).collect()
}

/// Whether a light seen along some geodesic of length π is seen without bound.
struct Meets;

impl Visitor for Meets {
    type Output = bool;
    fn visit<G: Geometry>(self, geometry: G) -> bool {
        let base = geometry.base();
        geometry.area_density(Geodesic { point: base, velocity: geometry.frame(base)[0] }, PI) < 1e-6
    }
}

/// The ball of the scene with a small one beside the way from its surface to the eye, which such lights shine on.
fn scene(space: &Space, light: DVec4) -> Result<Scene, Trouble> {
    struct Beside<'a>(&'a Space);
    impl Visitor for Beside<'_> {
        type Output = Option<(Frame, f64)>;
        fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
            let middle = Middle(self.0).visit(geometry)?;
            // Above the horizon of the light, and so far aside that the eye sees what it lights.
            let step = TOWARDS * 0.5 + DVec3::new(-0.8, 0.6, 0.0) * 0.35;
            Some((middle.frame.moved(geometry, step * middle.inradius), 0.1 * middle.inradius))
        }
    }
    let mut scene = picture::scene(space, Some(light))?;
    let beside = visit(space.geometry, Beside(space)).ok_or_else(|| Trouble(String::from("no such place")))?;
    let mut small = scene.objects[0].clone();
    small.place = Place::World(beside.0);
    small.shape = Shape::Ball { radius: beside.1 };
    scene.objects.push(small);
    Ok(scene)
}

/// Field of view of the pictures.
const FOV: f64 = 100.0;

/// From the middle of the cell to the eye.
const TOWARDS: DVec3 = DVec3::new(0.36, 0.48, 0.8);

/// The eye, and the light exactly and twice beside.
struct Places<'a>(&'a Space, Spot);

impl Visitor for Places<'_> {
    type Output = Option<(Frame, [(usize, DVec4); 3])>;
    fn visit<G: Geometry>(self, geometry: G) -> Self::Output {
        let Self(space, spot) = self;
        let middle = Middle(space).visit(geometry)?;
        let radius = 0.4 * middle.inradius;
        let towards = TOWARDS;
        let eye = middle.frame.moved(geometry, towards * (0.9 * middle.inradius)).point;
        let eye = picture::looking_at(geometry, eye, middle.frame.point);
        let domain = Domain::new(space);
        let velocity = middle.frame.vector(towards);
        let from_middle = |length: f64| {
            let arrival = transport(geometry, &domain, Geodesic { point: middle.frame.point, velocity }, 0, length);
            arrival.ok().map(|arrival| (arrival.cell, arrival.state.point))
        };
        let hair = HAIR * middle.inradius;
        let exact = match spot {
            Spot::Surface => radius,
            Spot::Eye => 0.9 * middle.inradius,
            // The antipode of the point of the ball that is nearest to the eye.
            Spot::Conjugate => radius + PI,
        };
        Some((eye, [from_middle(exact)?, from_middle(exact + hair)?, from_middle(exact + 2.0 * hair)?]))
    }
}

fn judge(bench: &mut Bench, on: On, space: &Space, spot: Spot) -> Result<Reading, Trouble> {
    let places = visit(space.geometry, Places(space, spot)).ok_or_else(|| Trouble(String::from("no such place")))?;
    let (eye, lights) = places;
    let mut pictures = Vec::new();
    for (number, (cell, light)) in lights.into_iter().enumerate() {
        let mut scene = scene(space, light)?;
        for lamp in &mut scene.lights {
            lamp.cell = cell;
            if let Spot::Conjugate = spot {
                lamp.range = lamp.range.max(PI + 0.5);
            }
        }
        let key = format!("{} lit {} {number}", space.name, spot as u32);
        pictures.push(picture::draw(bench, on, &key, &scene, eye, FOV)?);
    }
    // The same without the light: where it shows nothing, nothing is shown.
    let mut dark = scene(space, lights[0].1)?;
    dark.lights.iter_mut().for_each(|lamp| (lamp.cell, lamp.color) = (lights[0].0, [0.0; 3]));
    let dark = picture::draw(bench, on, &format!("{} dark", space.name), &dark, eye, FOV)?;
    match pictures.as_slice() {
        [exact, beside, _] if picture::differ(exact, &dark).max(picture::differ(beside, &dark)) < 3 => {
            Err(Trouble(String::from("the light lights nothing that is seen")))
        }
        [exact, beside, further] => Ok(picture::compare([exact, beside, further])),
        _ => Err(Trouble(String::from("no pictures"))),
    }
}
