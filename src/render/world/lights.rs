//! Images of lights, and which of them may shine on a place.

use super::{
    WorldError,
    place::{Balls, Copy, Everywhere, Sphere, copies, keeps_to_chart},
    shapes::ball_box,
};
use crate::{
    geometry::{Geodesic, Geometry},
    render::bvh::Aabb,
    scene::PointLight,
    space::{domain::Domain, polyhedron::Polyhedron},
};
use glam::{DVec3, DVec4, UVec3};

/// The images of all lights in all cells. In a cell many reach in from outside (in hyperbolic space exponentially many for
/// their range), and few shine on a place: a grid over the cell lists for each of its boxes those that may.
#[derive(Clone, Debug, Default)]
pub struct Lights {
    /// The images, by cell.
    pub images: Vec<WorldLight>,
    /// The grid of each cell.
    pub grids: Vec<LightGrid>,
    /// Of each grid the place in here where each of its boxes' list begins, and where the last one ends; then the lists:
    /// indices of images, in their order.
    pub lists: Vec<u32>,
}

/// An image of a light.
#[derive(Clone, Copy, Debug)]
pub struct WorldLight {
    /// Position, possibly outside of the cell.
    pub point: DVec4,
    /// Linear colour times intensity.
    pub color: [f32; 3],
    /// Fades to nothing here.
    pub range: f64,
    /// [`crate::geometry::Geometry::closeness`] of points at that distance.
    pub closest: f64,
    /// Spot: axis at `point` and cosine of half the opening angle.
    pub spot: Option<(DVec4, f64)>,
    /// Throws shadows.
    pub shadows: bool,
}

/// A cell's grid. Boxes at its sides reach as far out as there are points.
#[derive(Clone, Copy, Debug)]
pub struct LightGrid {
    /// Lower corner, in the chart; as f32 has it.
    pub lower: DVec3,
    /// Boxes per unit of the chart along each axis; as f32 has it.
    pub scale: DVec3,
    /// Boxes along each axis, at least 1.
    pub boxes: u32,
    /// Place of its first box in [`Lights::lists`].
    pub first: u32,
}

/// Most boxes of a grid along each axis.
const MOST_BOXES: u32 = 16;
/// Entries in the lists of a grid for each image: where lights reach through a whole cell, boxes bring nothing.
const MOST_ENTRIES: usize = 128;
/// Boxes list what comes this near, in units of their coordinates: the rounding of f32.
const SLACK: f64 = 1e-5;

impl Lights {
    /// All images of `lights` that reach into each cell; `polyhedra` are the cells' shapes.
    ///
    /// # Errors
    /// [`WorldError::TooManyCopies`]: a light reaches into too many cells.
    pub(super) fn new<G: Geometry>(
        geometry: G,
        domain: &Domain,
        polyhedra: &[Option<Polyhedron>],
        lights: &[PointLight],
    ) -> Result<Self, WorldError> {
        let mut per_cell: Vec<Vec<(WorldLight, Aabb)>> = polyhedra.iter().map(|_| Vec::new()).collect();
        for (number, light) in lights.iter().enumerate() {
            let closest = closeness_at(geometry, light.range);
            for (copy, reach) in reaching(geometry, domain, light, &format!("light {number}"))? {
                let velocity = light.spot.map_or(DVec4::ZERO, |spot| spot.direction);
                let image = geometry.apply(&copy.isometry, Geodesic { point: light.point, velocity });
                let image = WorldLight {
                    point: image.point,
                    color: light.color,
                    range: light.range,
                    closest,
                    spot: light.spot.map(|spot| (image.velocity, spot.cos_angle)),
                    shadows: light.shadows,
                };
                per_cell[copy.cell].push((image, reach));
            }
        }
        let mut all = Self::default();
        for (images, polyhedron) in per_cell.iter().zip(polyhedra) {
            let within = polyhedron.as_ref().map(|p| Aabb::around(p.vertices.iter().copied()));
            let reaches: Vec<Aabb> = images.iter().map(|(_, reach)| *reach).collect();
            all.add_grid(&reaches, within);
            all.images.extend(images.iter().map(|(image, _)| *image));
        }
        Ok(all)
    }

    /// Images that may shine on a place in the chart of a cell, among them all that do.
    pub fn near(&self, cell: usize, place: DVec3) -> impl Iterator<Item = &WorldLight> {
        let grid = self.grids[cell];
        let start = (grid.first + grid.box_at(place)) as usize;
        let list = self.lists[start] as usize..self.lists[start + 1] as usize;
        self.lists[list].iter().map(|image| &self.images[*image as usize])
    }

    /// Adds the grid of the next cell, whose images will be the next ones and reach so far.
    fn add_grid(&mut self, reaches: &[Aabb], within: Option<Aabb>) {
        let bounds = reaches.iter().fold(Aabb::EMPTY, |bounds, reach| bounds.union(*reach));
        let bounds = within.map_or(bounds, |within| bounds.intersection(within));
        let mut grid = LightGrid::new(bounds, (2.0 * (reaches.len() as f64).cbrt()) as u32, self.lists.len() as u32);
        while grid.boxes > 1
            && reaches.iter().map(|r| grid.boxes_of(*r).count()).sum::<usize>() > MOST_ENTRIES * reaches.len()
        {
            grid = LightGrid::new(bounds, grid.boxes / 2, grid.first);
        }
        let mut lists = vec![Vec::new(); (grid.boxes * grid.boxes * grid.boxes) as usize];
        for (image, reach) in (self.images.len() as u32..).zip(reaches) {
            grid.boxes_of(*reach).for_each(|index| lists[index as usize].push(image));
        }
        let mut end = self.lists.len() + lists.len() + 1;
        self.lists.push(end as u32);
        for list in &lists {
            end += list.len();
            self.lists.push(end as u32);
        }
        self.lists.extend(lists.concat());
        self.grids.push(grid);
    }
}

impl LightGrid {
    /// So many boxes along each axis of the bounds, or one of everything where they have no end.
    fn new(bounds: Aabb, boxes: u32, first: u32) -> Self {
        let margin = (bounds.lower.abs().max(bounds.upper.abs()) + 1.0) * SLACK;
        let lower = (bounds.lower - margin).as_vec3().as_dvec3();
        let extent = bounds.upper + margin - lower;
        if !extent.is_finite() || extent.min_element() <= 0.0 {
            return Self { lower: DVec3::ZERO, scale: DVec3::ZERO, boxes: 1, first };
        }
        let boxes = boxes.clamp(1, MOST_BOXES);
        Self { lower, scale: (f64::from(boxes) / extent).as_vec3().as_dvec3(), boxes, first }
    }

    /// Column, row and layer of the box that a place is in.
    fn at(&self, place: DVec3) -> UVec3 {
        ((place - self.lower) * self.scale).max(DVec3::ZERO).as_uvec3().min(UVec3::splat(self.boxes - 1))
    }

    fn index(&self, at: UVec3) -> u32 {
        (at.z * self.boxes + at.y) * self.boxes + at.x
    }

    /// Index of the box that a place is in.
    fn box_at(&self, place: DVec3) -> u32 {
        self.index(self.at(place))
    }

    /// Indices of the boxes that have something in common with another one.
    fn boxes_of(&self, reach: Aabb) -> impl Iterator<Item = u32> {
        let slack = |corner: DVec3| (corner.abs() + 1.0) * SLACK;
        let first = self.at(reach.lower - slack(reach.lower));
        let last = self.at(reach.upper + slack(reach.upper));
        let row = move |y, z| (first.x..=last.x).map(move |x| self.index(UVec3::new(x, y, z)));
        (first.z..=last.z).flat_map(move |z| (first.y..=last.y).flat_map(move |y| row(y, z)))
    }
}

/// The copies of a light that shine into cells, each with the part of its cell's chart that it may shine on.
fn reaching<G: Geometry>(
    geometry: G,
    domain: &Domain,
    light: &PointLight,
    name: &str,
) -> Result<Vec<(Copy, Aabb)>, WorldError> {
    if geometry.ball(light.point, light.range).is_none() {
        let extent = Sphere::new(geometry, light.point, light.range);
        let copies = copies(geometry, domain, light.cell, &extent, name)?;
        return Ok(copies.into_iter().map(|copy| (copy, extent.bounds(geometry, &copy))).collect());
    }
    if !keeps_to_chart(geometry, light.range) {
        let copies = copies(geometry, domain, light.cell, &Everywhere, name)?;
        return Ok(copies.into_iter().map(|copy| (copy, Aabb::EVERYTHING)).collect());
    }
    let extent = Balls { centres: &[light.point], radius: light.range };
    let reach = |copy: &Copy| {
        let image = geometry.apply(&copy.isometry, Geodesic { point: light.point, velocity: DVec4::ZERO }).point;
        geometry.ball(image, light.range).map_or(Aabb::EVERYTHING, |ball| ball_box(&ball))
    };
    let copies = copies(geometry, domain, light.cell, &extent, name)?;
    Ok(copies.into_iter().map(|copy| (copy, reach(&copy))).collect())
}

/// The closeness of points at a distance; less than that of any two points where none are so far apart.
fn closeness_at<G: Geometry>(geometry: G, distance: f64) -> f64 {
    let base = geometry.base();
    let point = geometry.flow(Geodesic { point: base, velocity: geometry.frame(base)[0] }, distance).point;
    let reached = geometry.distance(base, point) > distance * (1.0 - 1e-9);
    if reached { geometry.closeness(base, point) } else { f64::NEG_INFINITY }
}
