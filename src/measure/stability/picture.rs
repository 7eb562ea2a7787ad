//! Small pictures of a ball in a cell, and how they are compared: with the same picture from a hair's breadth beside.

use super::{Bench, On, Reading, Trouble};
use crate::{
    geometry::{Geodesic, Geometry, Visitor, across, orthonormalise, visit},
    render::{Shot, Stats, Target},
    scene::{Object, Place, PointLight, Scene, Shading, Shape, file, folder::Folder},
    shader_io::COUNT_LOST,
    space::{Space, observer::Frame, polyhedron::Polyhedron},
};
use glam::{DVec3, DVec4};

/// Size of the pictures.
pub(super) const SIZE: [u32; 2] = [48, 36];

/// Where rays end, in units of the distance of the cell's corners: farther on neighbours part in hyperbolic spaces. Not
/// after a number of faces, which differs from one side of an edge to the other.
const REACH: f64 = 2.0;

/// Colour where nothing is seen, so that no pixel is black.
const BACKGROUND: [f32; 3] = [0.1, 0.2, 0.3];

/// Share of the pixels that may be off: outlines of three pixels in a row.
const SHARE: f64 = 0.005;

/// A space with a light at the viewer and a material.
pub(super) fn bare(space: &Space) -> Result<Scene, Trouble> {
    let text = format!(
        "[space]\n{}\n[[light]]\nkind = \"viewer\"\nintensity = 0.5\n[[material]]\nname = \"m\"\ncolor = [0.7, 0.6, 0.4]\n",
        named(space)
    );
    Ok(file::read("stability.toml", text.as_bytes(), &Folder::Embedded)?)
}

/// A ball in the middle of the first cell, seen by a light at the viewer, and a light somewhere.
pub(super) fn scene(space: &Space, light: Option<DVec4>) -> Result<Scene, Trouble> {
    let mut scene = bare(space)?;
    let ball = visit(space.geometry, Middle(space)).ok_or_else(|| Trouble(String::from("the cell has no middle")))?;
    scene.objects.push(Object {
        name: String::from("ball"),
        shape: Shape::Ball { radius: 0.4 * ball.inradius },
        place: Place::World(ball.frame),
        scale: 1.0,
        material: Some(0),
        motion: None,
    });
    // A light in any case, so that all pictures of a space share a pipeline.
    scene.lights.push(PointLight {
        cell: 0,
        point: light.unwrap_or(ball.aside),
        color: [2.0; 3],
        range: ball.inradius,
        shadows: true,
        spot: None,
    });
    scene.observer.frame = ball.frame;
    scene.settings.bounces = 64;
    scene.settings.max_distance = Some(REACH * ball.reach);
    scene.settings.background = BACKGROUND;
    scene.settings.ambient = [0.2; 3];
    scene.settings.shading = Shading::Riemannian;
    Ok(scene)
}

/// The line of a scene file that says which space.
pub(super) fn named(space: &Space) -> String {
    let catalogue = crate::space::catalogue::NAMES.contains(&space.name.as_str());
    format!("{} = \"{}\"", if catalogue { "manifold" } else { "geometry" }, space.name)
}

/// The middle of the first cell.
pub(super) struct Middle<'a>(pub &'a Space);

/// What [`Middle`] finds.
pub(super) struct Ball {
    /// A frame in the middle.
    pub frame: Frame,
    /// Distance to the nearest face's centre.
    pub inradius: f64,
    /// Distance to the farthest corner.
    pub reach: f64,
    /// A point between the middle and a face, outside of the ball of 0.4 inradii.
    pub aside: DVec4,
}

impl Visitor for Middle<'_> {
    type Output = Option<Ball>;
    fn visit<G: Geometry>(self, geometry: G) -> Option<Ball> {
        let cell = Polyhedron::new(&self.0.cells[0]).ok()?;
        let point = geometry.unchart(cell.centroid)?;
        let far = |c: DVec3| geometry.unchart(c).map(|q| geometry.distance(point, q));
        let centres: Vec<DVec3> = (0..cell.face_vertices.len()).map(|face| centre(&cell, face)).collect();
        let inradius = centres.iter().map(|c| far(*c)).try_fold(f64::INFINITY, |least, d| Some(least.min(d?)))?;
        let reach = cell.vertices.iter().map(|c| far(*c)).try_fold(0.0, |most: f64, d| Some(most.max(d?)))?;
        let frame = Frame { cell: 0, point, axes: geometry.frame(point) };
        let aside = frame.moved(geometry, DVec3::new(0.3, 0.4, 0.5) * inradius).point;
        Some(Ball { frame, inradius, reach, aside })
    }
}

/// Mean of a face's corners.
pub(super) fn centre(cell: &Polyhedron, face: usize) -> DVec3 {
    let corners = &cell.face_vertices[face];
    corners.iter().map(|v| cell.vertices[*v]).sum::<DVec3>() / corners.len() as f64
}

/// A frame at a point that looks past another, so that it has it on its right: half of what it sees is on either side of a
/// face between the two.
pub(super) fn looking_past<G: Geometry>(geometry: G, point: DVec4, other: DVec4) -> Frame {
    let (right, _) = geometry.log(point, other);
    let [up, back] = across(geometry, Geodesic { point, velocity: right });
    Frame { cell: 0, point, axes: orthonormalise(geometry, point, [right, up, back]) }
}

/// A frame at a point that looks at another.
pub(super) fn looking_at<G: Geometry>(geometry: G, point: DVec4, other: DVec4) -> Frame {
    let past = looking_past(geometry, point, other);
    let [right, up, back] = past.axes;
    Frame { axes: [back, up, -right], ..past }
}

/// Draws one picture; rays that are lost are trouble.
pub(super) fn draw(
    bench: &mut Bench,
    on: On,
    key: &str,
    scene: &Scene,
    eye: Frame,
    fov: f64,
) -> Result<Target, Trouble> {
    let shot = |_: &Scene| Shot::symmetric(eye, fov, SIZE);
    let (target, stats): (Target, Stats) = bench.draw(on, key, || Ok(scene.clone()), shot)?;
    match stats.counts[COUNT_LOST as usize] {
        0 => Ok(target),
        lost => Err(Trouble(format!("{lost} rays are lost"))),
    }
}

/// The share of pixels of a picture that are no colour or none of those around the same place in the picture beside it, with
/// the share between that and another beside for a floor.
pub(super) fn compare([exact, beside, further]: [&Target; 3]) -> Reading {
    let floor = strange(beside, further);
    Reading { floor, ..Reading::new(strange(exact, beside), SHARE + 2.0 * floor) }
}

/// Share of the pixels of `a` that are not finite, or black where nothing can be, or beyond the range of the 3 × 3 pixels
/// around the same place in `b`.
fn strange(a: &Target, b: &Target) -> f64 {
    const SLACK: f32 = 0.03;
    let (width, height) = (a.width as i32, a.height as i32);
    let shown = |target: &Target, x: i32, y: i32| {
        let at = y.clamp(0, height - 1) * width + x.clamp(0, width - 1);
        target.pixels[at as usize]
    };
    let bad = |index: i32| {
        let (x, y) = (index % width, index / width);
        let pixel = shown(a, x, y);
        let around = || (-1..=1).flat_map(|dy| (-1..=1).map(move |dx| (dx, dy)));
        (0..3).any(|channel| {
            let value = pixel[channel].min(1.0);
            let near = || around().map(|(dx, dy)| shown(b, x + dx, y + dy)[channel].min(1.0));
            let (low, high) = (near().fold(f32::INFINITY, f32::min), near().fold(f32::NEG_INFINITY, f32::max));
            // Written so that what is no number is bad.
            !(pixel[channel].is_finite() && value >= low - SLACK && value <= high + SLACK)
        }) || pixel[..3] == [0.0; 3]
    };
    let count = (0..width * height).filter(|index| bad(*index)).count();
    count as f64 / f64::from(width * height)
}

/// Number of pixels that are not the same.
pub(super) fn differ(a: &Target, b: &Target) -> usize {
    let other = |(a, b): &(&[f32; 4], &[f32; 4])| (0..3).any(|channel| (a[channel] - b[channel]).abs() > 0.02);
    a.pixels.iter().zip(&b.pixels).filter(other).count()
}
